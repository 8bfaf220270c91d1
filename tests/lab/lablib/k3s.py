# SPDX-License-Identifier: GPL-3.0-or-later
"""Which k3s the lab runs, and the airgap directory of it: the real release where it can be downloaded, else labk3s."""

from __future__ import annotations

import http.client
import os
import urllib.error
import urllib.request
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

from .artifacts import Cache, Recipe, file_sha256
from .errors import LabError
from .go import complete, go_command, go_environment, go_pin
from .oci import Image, architecture, write_archive, write_layer
from .paths import LABK3S, pins
from .run import Job, build, say

CHOICES = ("release", "labk3s")
PROBE_SECONDS = 4
ROOT_PATH = "PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"


def choose() -> str:
    """`release` or `labk3s`: LAB_K3S if set, else whether the release's checksum file can be had right now."""
    wanted = os.environ.get("LAB_K3S", "")
    if wanted:
        if wanted not in CHOICES:
            raise LabError(f"LAB_K3S={wanted} is unknown", todo=f"set it to one of {', '.join(CHOICES)}, or not at all")
        say(f"k3s: {describe(wanted)} (LAB_K3S)")
        return wanted
    url = _url(pins()["k3s"]["version"], _sums_name())
    try:
        _get(url, PROBE_SECONDS)
    except LabError as error:
        say(f"k3s: {describe('labk3s')} (the release cannot be downloaded: {str(error).splitlines()[0]})")
        return "labk3s"
    say(f"k3s: {describe('release')}")
    return "release"


def describe(choice: str) -> str:
    if choice == "release":
        return f"the real k3s {pins()['k3s']['version']}"
    return f"labk3s {pins()['labk3s']['version']}, a stand-in built from upstream Kubernetes modules"


def airgap(cache: Cache, choice: str, pin: str = "version") -> Path:
    """The airgap directory: k3s, its images, SHA256SUMS. `pin` names which of the versions in pins.toml."""
    kind = pin.rpartition("version")[0].replace("_", "-")  # each is kept
    if choice == "release":
        return _release(cache, f"k3s-{kind}release", pins()["k3s"][pin])
    return _labk3s(cache, f"labk3s-{kind}".rstrip("-"), pins()["labk3s"][pin])


# --- the release ---------------------------------------------------------------------------------------------------


def _binary_name() -> str:
    return {"amd64": "k3s", "arm64": "k3s-arm64", "arm": "k3s-armhf"}[architecture()]


def _images_name() -> str:
    return f"k3s-airgap-images-{architecture()}.tar"


def _sums_name() -> str:
    return f"sha256sum-{architecture()}.txt"


def _url(version: str, name: str) -> str:
    return f"{pins()['k3s']['url']}/{quote(version, safe='')}/{name}"


def _get(url: str, timeout: float) -> bytes:
    try:
        with urllib.request.urlopen(url, timeout=timeout) as answer:  # noqa: S310 - the pinned https address
            return bytes(answer.read())
    except (OSError, urllib.error.URLError, http.client.HTTPException) as error:
        raise LabError(f"{url}: {error}", todo="see whether the address is reachable from here") from error


def _release(cache: Cache, kind: str, version: str) -> Path:
    recipe = Recipe(
        kind=kind,
        title=f"the real k3s {version}",
        values={"version": version, "url": pins()["k3s"]["url"], "architecture": architecture()},
        files=(Path(__file__),),
    )
    return cache.ensure(recipe, lambda directory, log: _download(version, directory, log))


def parse_sums(text: str) -> dict[str, str]:
    """A checksum file as sha256sum writes it: file name to digest."""
    pairs = (line.split(maxsplit=1) for line in text.splitlines() if line.strip())
    return {name.strip().lstrip("*"): digest for digest, name in pairs}


def _download(version: str, directory: Path, log: Path) -> None:
    sums_url = _url(version, _sums_name())
    sums = parse_sums(_get(sums_url, 30).decode())
    lines: list[str] = []
    for name in (_binary_name(), _images_name()):
        if name not in sums:
            raise LabError(f"{name} has no checksum in the release", where=sums_url, todo="check tests/lab/pins.toml")
        target = directory / name
        command = ["curl", "--fail", "--location", "--silent", "--show-error", "--retry", "3", "--output", str(target)]
        build(Job([*command, _url(version, name)], f"{name} (download)", log))
        found = file_sha256(target)
        if found != sums[name]:
            raise LabError(
                f"the download of {name} is damaged: SHA-256 {found}, expected {sums[name]}",
                where=_url(version, name),
                todo="run it again",
            )
        lines.append(f"{found}  {name}\n")
    (directory / _binary_name()).chmod(0o755)
    (directory / "SHA256SUMS").write_text("".join(lines))


# --- labk3s --------------------------------------------------------------------------------------------------------


def _labk3s(cache: Cache, kind: str, version: str) -> Path:
    recipe = Recipe(
        kind=kind,
        title=f"labk3s {version}",
        values={"version": version, "pins": pins()["labk3s"], "go": go_pin(), "architecture": architecture()},
        files=(LABK3S, *(Path(__file__).with_name(name) for name in ("k3s.py", "go.py", "oci.py"))),
    )
    return cache.ensure(recipe, lambda directory, log: _build_labk3s(version, labk3s_modules(cache), directory, log))


def labk3s_modules(cache: Cache) -> Path:
    """The whole go.mod of labk3s, with its go.sum beside it; for -modfile."""
    sums = pins()["labk3s"]["sums"]
    values = {"sums": sums, "go": go_pin()}
    recipe = Recipe("gomodules", "labk3s's Go modules", values, (LABK3S, Path(__file__).with_name("go.py")))
    make: Callable[[Path, Path], None] = partial(complete, LABK3S, ["-test", "./..."], sums)
    return cache.ensure(recipe, make) / "go.mod"


def _build_labk3s(version: str, modules: Path, directory: Path, log: Path) -> None:
    scratch = directory / "scratch"
    scratch.mkdir()

    def compile_(package: str, target: Path) -> None:
        flags = [f"-modfile={modules}", "-ldflags", f"-s -w -X main.version={version}", "-o", str(target), package]
        what = f"labk3s {version}, {target.name} (Go; the first time takes minutes)"
        build(Job([go_command(), "build", *flags], what, log, cwd=LABK3S, env=go_environment()))

    compile_(".", directory / _binary_name())
    compile_("./cmd/pause", scratch / "pause")
    compile_("./cmd/coredns", scratch / "coredns")
    _write_system_images(directory / _images_name(), scratch)
    names = (_binary_name(), _images_name())
    (directory / "SHA256SUMS").write_text("".join(f"{file_sha256(directory / name)}  {name}\n" for name in names))
    for path in scratch.iterdir():
        path.unlink()
    scratch.rmdir()


def _write_system_images(target: Path, scratch: Path) -> None:
    config: dict[str, Any] = {"Env": [ROOT_PATH], "WorkingDir": "/"}
    images = [
        Image(
            pins()["labk3s"][name],
            [write_layer(scratch / f"{name}.tar", [(f"/{name}", scratch / name)])],
            {**config, "Entrypoint": [f"/{name}"]},
        )
        for name in ("pause", "coredns")
    ]
    write_archive(target, images)
