# SPDX-License-Identifier: GPL-3.0-or-later
"""A cache of built things, by the content of what they are built from.

An artifact is a directory `<kind>-<key>`; it is built beside its place and renamed when whole, so that an interruption
never leaves half of one. A lock per artifact makes a second builder wait for the first.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from .errors import LabError
from .run import PROGRESS_SECONDS, say

KEEP = 2


@dataclass(frozen=True)
class Recipe:
    """What an artifact is made of. `values` is any JSON data; `files` are files or directories that it depends on."""

    kind: str
    title: str
    values: dict[str, Any] = field(default_factory=dict)
    files: tuple[Path, ...] = ()

    def key(self) -> str:
        digest = hashlib.sha256(json.dumps([self.kind, self.values], sort_keys=True).encode())
        for name, content in sorted(_contents(self.files)):
            digest.update(f"\0{name}\0{content}".encode())
        return digest.hexdigest()[:16]


def _locked(handle: IO[str]) -> bool:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _contents(roots: tuple[Path, ...]) -> Iterator[tuple[str, str]]:
    """Names are relative to each root: the same sources in another checkout make the same key."""
    for root in roots:
        files = [root] if root.is_file() else sorted(path for path in root.rglob("*") if path.is_file())
        for path in files:
            if "__pycache__" in path.parts:
                continue
            name = f"{root.name}/{path.relative_to(root)}:{os.access(path, os.X_OK)}"
            yield name, file_sha256(path)


def file_sha256(path: Path) -> str:
    with path.open("rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()


class Cache:
    """The artifacts under one directory."""

    def __init__(self, root: Path) -> None:
        self.artifacts = root / "artifacts"
        self.locks = root / "locks"
        self.logs = root / "logs"

    def path(self, recipe: Recipe) -> Path:
        return self.artifacts / f"{recipe.kind}-{recipe.key()}"

    def ensure(self, recipe: Recipe, make: Callable[[Path, Path], None]) -> Path:
        """The artifact's directory. `make(directory, log)` fills an empty directory where it is not there yet."""
        target = self.path(recipe)
        if not target.is_dir():
            with self.lock(target.name, f"another build of {recipe.title}"):
                if not target.is_dir():
                    self._build(recipe, target, make)
        os.utime(target)
        self._prune(recipe.kind, target)
        return target

    def _build(self, recipe: Recipe, target: Path, make: Callable[[Path, Path], None]) -> None:
        self.logs.mkdir(parents=True, exist_ok=True)
        log = self.logs / f"{target.name}.log"
        log.unlink(missing_ok=True)
        part = self.artifacts / f".part-{target.name}-{os.getpid()}"
        part.mkdir(parents=True)
        started = time.monotonic()
        say(f"building {recipe.title} ({target.name}; log {log})")
        try:
            make(part, log)
            part.rename(target)
        finally:
            shutil.rmtree(part, ignore_errors=True)
        say(f"built {recipe.title} in {time.monotonic() - started:.0f} s")

    @contextmanager
    def lock(self, name: str, waiting_for: str) -> Iterator[None]:
        """Held by one process at a time; the kernel releases it when its holder ends, however it ends."""
        self.locks.mkdir(parents=True, exist_ok=True)
        with (self.locks / f"{name}.lock").open("w") as handle:
            started = reported = time.monotonic()
            while not _locked(handle):
                if reported == started or time.monotonic() - reported >= PROGRESS_SECONDS:
                    reported = time.monotonic()
                    say(f"  ... waiting for {waiting_for} to end: {reported - started:.0f} s")
                time.sleep(0.2)
            yield

    def _prune(self, kind: str, current: Path) -> None:
        """Keeps the newest of a kind and removes what an interrupted build left."""
        whole = [path for path in self.artifacts.glob(f"{kind}-*") if _is_kind(path.name, kind)]
        whole.sort(key=lambda path: path.stat().st_mtime, reverse=True)
        left_over = [path for path in self.artifacts.glob(f".part-{kind}-*") if not _is_running(path)]
        for path in [*(old for old in whole[KEEP:] if old != current), *left_over]:
            shutil.rmtree(path, ignore_errors=True)
            (self.logs / f"{path.name}.log").unlink(missing_ok=True)

    def wipe(self) -> None:
        for path in (self.artifacts, self.logs):
            shutil.rmtree(path, ignore_errors=True)
            if path.exists():
                raise LabError(f"{path} could not be removed", todo="see what still uses it, then remove it by hand")


def _is_kind(name: str, kind: str) -> bool:
    """`apps-0123456789abcdef` is of kind apps; of kind `app` it is not."""
    return name.startswith(f"{kind}-") and "-" not in name[len(kind) + 1 :]


def _is_running(part: Path) -> bool:
    """The builder's process id is the last part of the directory's name."""
    return Path("/proc", part.name.rpartition("-")[2]).exists()
