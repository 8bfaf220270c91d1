# SPDX-License-Identifier: GPL-3.0-or-later
"""Bring a file of a known SHA-256, or of one that a list of sums beside it names, and put it in place whole."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Callable, Mapping

from .._common.errors import FleetError
from .k3s import BLOCK, sha256

MODE = 0o755
SUM_LINE = re.compile(r"^([0-9a-f]{64}) [ *](\S+)$", re.MULTILINE)
PROXY = re.compile(r"(https?|all|no)_proxy", re.IGNORECASE)


def proxies(environment: Mapping[str, object]) -> dict[str, str]:
    """What of a unit's environment concerns a download, in both spellings that programs read."""
    found = {str(name): str(value) for name, value in environment.items() if PROXY.fullmatch(str(name))}
    return {spelled: value for name, value in found.items() for spelled in (name.lower(), name.upper())}


def listed_sum(text: str, name: str, where: str) -> str:
    """A file's sum out of a list of sha256sum."""
    for digest, listed in SUM_LINE.findall(text):
        if listed == name:
            return str(digest)
    raise FleetError(f"{where} has no SHA-256 of {name}")


def fetch(open_url: Callable[[str], Any], url: str, place: Path, expected: str) -> bool:
    """Whether the file had to be brought. FleetError, and nothing there, where what came is not what was expected."""
    if sha256(place) == expected:
        return False
    part = place.with_name(f"{place.name}.part")
    try:
        answer = open_url(url)
        with part.open("wb") as file:
            for block in iter(lambda: answer.read(BLOCK), b""):
                file.write(block)
        came = sha256(part)
        if came != expected:
            raise FleetError(f"it has the SHA-256 {came}, expected is {expected}")
        part.chmod(MODE)
        part.replace(place)
    finally:
        if part.exists():
            part.unlink()
    return True
