# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Versions of k3s, in their order."""

from __future__ import annotations

import re
from dataclasses import dataclass

_VERSION = re.compile(r"v(\d+)\.(\d+)\.(\d+)(?:-([a-z]+)\.?(\d+))?(?:\+([a-z0-9]*[a-z])(\d+))?")

_Order = tuple[int, int, int, int, str, int]


@dataclass(frozen=True)
class Version:
    """`v1.34.2-rc1+k3s1`; without `-rc1` it is the release, which is newer than its candidates."""

    minor: tuple[int, int]
    order: _Order
    vendor: str
    build: int

    def newer_than(self, other: Version) -> bool:
        """Builds of different vendors of one version are neither newer nor older."""
        if self.order != other.order:
            return self.order > other.order
        return self.vendor == other.vendor and self.build > other.build


def version(text: str) -> Version | None:
    """A version as k3s says it; None for a text that is none."""
    found = _VERSION.fullmatch(text)
    if found is None:
        return None
    major, minor, patch, stage, number, vendor, build = found.groups()
    order = (int(major), int(minor), int(patch), int(stage is None), stage or "", int(number or 0))
    return Version((int(major), int(minor)), order, vendor or "", int(build or 0))
