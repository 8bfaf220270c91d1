# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Have a file of known SHA-256 from the network, put in place whole. Whoever opens the address is handed in."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from typing import Any, Callable, Mapping

from .._common.errors import FleetError

SUM_LINE = re.compile(r"^([0-9a-f]{64}) [ *](\S+)$", re.MULTILINE)
PROXY = re.compile(r"(https?|all|no)_proxy", re.IGNORECASE)
BLOCK = 1 << 20


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


def sha256(path: Path) -> str:
    """Empty where there is no file."""
    digest = hashlib.sha256()
    try:
        with path.open("rb") as file:
            for block in iter(lambda: file.read(BLOCK), b""):
                digest.update(block)
    except FileNotFoundError:
        return ""
    return digest.hexdigest()


def fetch(open_url: Callable[[str], Any], url: str, place: Path, expected: str, mode: int) -> bool:
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
        part.chmod(mode)
        part.replace(place)
    finally:
        if part.exists():
            part.unlink()
    return True
