# SPDX-License-Identifier: GPL-3.0-or-later
"""What k3s, images and ansible-core are made for: machines, versions, a host's Python, and what k3s does by itself."""

from __future__ import annotations

import re
from dataclasses import dataclass

from ansible.module_utils.basic import _PY_MIN as OLDEST
from ansible.release import __version__

CORE = __version__
# What k3s and its kubelet do where nobody says otherwise, as of v1.34.
# k3s's own eviction-hard: with less of the disk free the Node has DiskPressure, and the kubelet evicts pods.
EVICTION_FREE_PERCENT = 5
# The kubelet's imageGCHighThresholdPercent: with more of the disk used it deletes images that no container uses, those
# that were never used first.
IMAGE_GC_USED_PERCENT = 85
# From this minor version on the kubelet ends on a host with cgroup v1, unless failCgroupV1 is false.
CGROUP_V2_FROM = (1, 35)

_NUMBERS = re.compile(r"(\d{1,9})\D+(\d{1,9})", re.ASCII)
_VERSION = re.compile(r"v{0}\.{0}\.{0}(?:-([a-z]+)\.?{0})?(?:\+([a-z0-9]*[a-z]){0})?".format(r"(\d{1,9})"), re.ASCII)


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


@dataclass(frozen=True)
class Version:
    """`v1.34.2-rc1+k3s1`; without `-rc1` it is the release, which is newer than its candidates."""

    minor: tuple[int, int]
    order: tuple[int, int, int, int, str, int]
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


def too_old(text: str) -> str:
    """What is wrong where a host's Python is of the version that `text` begins with; empty where nothing is."""
    found = _NUMBERS.search(text)
    own = tuple(int(number) for number in found.groups()) if found else OLDEST
    if own >= OLDEST:
        return ""
    has, needs = (".".join(map(str, numbers)) for numbers in (own, OLDEST))
    return (
        f"has Python {has}, and ansible-core {CORE} needs {needs} or newer on hosts. Take an ansible-core that takes "
        "it (2.19 takes 3.8, which Ubuntu 20.04 has), or install a newer Python there and name it in "
        "ansible_python_interpreter"
    )
