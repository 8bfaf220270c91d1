# SPDX-License-Identifier: GPL-3.0-or-later
"""Who runs on which of this machine's cores: the robot on its own, so that no step's control node takes from it.

The edge host shares the rest with the control node, as a server near it would.
"""

from __future__ import annotations

import os
from collections.abc import Sequence


def split(cores: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """The robot's cores and the others'. A single core is everybody's.

    >>> split(2), split(5), split(1)
    (((0,), (1,)), ((0, 1), (2, 3, 4)), ((0,), (0,)))
    """
    half = max(1, cores // 2)
    return tuple(range(half)), tuple(range(half, cores)) or tuple(range(cores))


CORES = tuple(range(os.cpu_count() or 1))
ROBOT_CORES, CONTROL_CORES = split(len(CORES))


def listed(cores: Sequence[int]) -> str:
    """As taskset and podman write them."""
    return ",".join(map(str, cores))


def kubelet_arguments(own: Sequence[int], every: Sequence[int]) -> list[str]:
    """What a host's kubelet has to be told that may use some of the machine's cores only.

    It takes those that the kernel shows for its own and writes them into its pods' cgroups, which a host on fewer
    cores refuses. With the static policy it leaves the reserved ones out.

    >>> kubelet_arguments((0,), (0, 1))[1]
    'reserved-cpus=1'
    >>> kubelet_arguments((0,), (0,))
    []
    """
    if not (others := [core for core in every if core not in own]):
        return []
    return [
        "cpu-manager-policy=static",
        f"reserved-cpus={listed(others)}",
        "cpu-manager-policy-options=strict-cpu-reservation=true",
    ]


def on_cores(cores: Sequence[int]) -> tuple[str, ...]:
    """What a command begins with that is to run on these alone."""
    return ("taskset", "--cpu-list", listed(cores))
