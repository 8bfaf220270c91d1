# SPDX-License-Identifier: GPL-3.0-or-later
"""Which claims go where, whatever a host says that it has."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.claims import sources


def claim(volume: str, namespace: str = "robot-robot1", number: int = 1) -> str:
    return f"pvc-u{number}_{namespace}_{volume}-pvc"


OWN = {"robot1": "robot-robot1", "robot2": "robot-robot2"}
ALL = {"fleet", "robot-robot1", "robot-robot2"}


def test_each_claim_has_its_directory() -> None:
    found = sources({"edge1": [claim("logs", "fleet")], "robot1": [claim("maps"), claim("logs")]}, ALL, OWN)
    assert [(one.host, one.volume, one.target) for one in found] == [
        ("edge1", "logs", "fleet/logs"),
        ("robot1", "logs", "robot1/logs"),
        ("robot1", "maps", "robot1/maps"),
    ]


def test_a_claim_that_is_there_twice_is_told_apart_by_its_volume() -> None:
    twice = {"robot1": [claim("logs", number=2)], "edge1": [claim("logs", number=1)]}
    of_ones_own = {"robot1": [claim("logs", number=1), "pvc-u2_robot-robot1_logs"]}  # without the end that ours have
    for there in (twice, of_ones_own):
        assert [one.target for one in sources(there, ALL, OWN)] == ["robot1/logs.pvc-u1", "robot1/logs.pvc-u2"]


@pytest.mark.parametrize(
    "directory",
    [
        *(f"pvc-u1_robot-{place}" for place in ("../.._.ssh", "/root_.ssh", "_logs-pvc", "Robot1_logs-pvc")),
        *(
            f"pvc-u1_robot-robot1_{claim}"
            for claim in ("..", "../robot2/logs-pvc", "/etc/cron.d-pvc", "a/b", "logs.sh")
        ),
        *(f"pvc-u1_robot-robot1_{claim}" for claim in ("logs-pvc\n", "-pvc", "", "l" * 64, "l\0", "$(id)")),
        *(f"{volume}_robot-robot1_logs-pvc" for volume in ("pvc-../../x", "/pvc-u1", "x", "pvc-", "pvc-U")),
        "..",
        "",
    ],
)
def test_a_directory_that_is_no_claim_s_is_left_alone(directory: str) -> None:
    namespace = "_".join(directory.split("_")[1:2])  # also where such a namespace were asked for
    assert sources({"robot1": [directory]}, {"robot-robot1", namespace}, {}) == []


def test_a_robot_gives_what_is_its_own_alone() -> None:
    """Results under another robot's name would be forged; the edge has those of all robots' apps that run there."""
    both = [claim("logs", "robot-robot1"), claim("logs", "robot-robot2", 2), claim("logs", "fleet", 3)]
    assert [one.target for one in sources({"robot1": both}, ALL, OWN)] == ["robot1/logs"]
    assert [one.target for one in sources({"edge1": both}, ALL, OWN)] == ["robot1/logs", "robot2/logs", "fleet/logs"]


def test_what_nobody_asked_for_stays_there() -> None:
    there = {"edge1": [claim("logs", "kube-system"), claim("logs", "robot-robot2"), claim("logs"), claim("maps")]}
    assert [one.target for one in sources(there, {"robot-robot1"}, OWN, ["maps"])] == ["robot1/maps"]
