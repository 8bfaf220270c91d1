# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The machines that k3s and images are made for, and what each calls them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Machine:
    """One hardware name: how images call its architecture, and how the release's k3s for it ends."""

    architecture: str
    suffix: str


# By `uname -m`.
MACHINES = {
    "x86_64": Machine("amd64", ""),
    "aarch64": Machine("arm64", "-arm64"),
    "armv7l": Machine("arm", "-armhf"),
}


def architecture_of(machine: str) -> str:
    """`arm64` for `aarch64`; a machine that is not in the table keeps its name."""
    known = MACHINES.get(machine)
    return known.architecture if known else machine
