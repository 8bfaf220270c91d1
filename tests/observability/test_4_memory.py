# SPDX-License-Identifier: GPL-3.0-or-later
"""What the watchers hold in memory: by their cgroups, which is what the kubelet acts upon, and by their processes.

The budgets are of what is taken from others: cgroups' working sets, and the processes' own memory. The resident size
that `ps` shows is printed, too: it has the pages of programs' files, which stay while nobody else needs the room.
"""

from __future__ import annotations

import memory
from watched import ALONE, EDGE, NAMESPACE, Watched

MB = 1_000_000
ROBOT_BUDGET = 105 * MB  # beside the apps; with the whole keeper, which is there without it, too
STANDALONE_BUDGET = 600 * MB  # without Grafana


def measured(fleet: Watched, what: str, held: list[memory.Held], budget: int) -> None:
    """Say it and hold it against the budget."""
    cgroup, rss, own = (sum(sizes) for sizes in zip(*(one[3:] for one in held)))
    fleet.say(*(memory.said(*one[2:]) for one in held))
    fleet.say(f"{memory.said(what, cgroup, rss, own)} (budget {budget / MB:.0f})")
    assert min(one.cgroup for one in held) > 0, "a cgroup that was not read"
    assert max(cgroup, own) <= budget


def test_robot(fleet: Watched) -> None:
    """All that watching costs a robot that stands alone: the stack's pods, and the keeper, which shows the graph."""
    watching = [one for one in fleet.memory(ALONE) if one.namespace == NAMESPACE or one.app == "ros-keeper"]
    assert {one.app for one in watching} == {"vmagent", "log-shipper", "node-exporter", "ros-keeper"}
    measured(fleet, f"profile robot on {ALONE}", watching, ROBOT_BUDGET)


def test_standalone_without_grafana(fleet: Watched) -> None:
    """On a hub, which does all that `standalone` does and takes a robot's samples and lines as well."""
    watching = [one for one in fleet.memory(EDGE) if one.namespace == NAMESPACE]
    assert {one.app for one in watching} == {"prometheus", "loki", "log-shipper", "node-exporter"}
    measured(fleet, f"profile hub on {EDGE}", watching, STANDALONE_BUDGET)
