# SPDX-License-Identifier: GPL-3.0-or-later
"""Which claims go where, whatever a host says that it has."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.claims import sources


def claim(volume: str, namespace: str = "robot-robot1", number: int = 1) -> str:
    return f"pvc-u{number}_{namespace}_{volume}-pvc"


OWN = {"robot1": "robot-robot1", "robot2": "robot-robot2"}
ALL = {"fleet", "robot-robot1", "robot-robot2"}


BOTH = [claim("logs", "robot-robot1"), claim("logs", "robot-robot2", 2), claim("logs", "fleet", 3)]


@pytest.mark.parametrize(
    ("there", "volumes", "found"),
    [
        ({"edge1": [claim("logs", "fleet")], "robot1": [claim("maps"), claim("logs")]}, [],
         ["edge1 logs fleet/logs", "robot1 logs robot1/logs", "robot1 maps robot1/maps"]),
        # one that is there twice is told apart by its volume
        ({"robot1": [claim("logs", number=2)], "edge1": [claim("logs")]}, [],
         ["edge1 logs robot1/logs.pvc-u1", "robot1 logs robot1/logs.pvc-u2"]),
        ({"robot1": [claim("logs"), "pvc-u2_robot-robot1_logs"]}, [],  # without the end that ours have
         ["robot1 logs robot1/logs.pvc-u1", "robot1 logs robot1/logs.pvc-u2"]),
        # results under another robot's name would be forged; the edge has those of all robots' apps that run there
        ({"robot1": BOTH}, [], ["robot1 logs robot1/logs"]),
        ({"edge1": BOTH}, [], [f"edge1 logs {of}/logs" for of in ("robot1", "robot2", "fleet")]),
        # what nobody asked for stays there
        ({"edge1": [claim("logs", "kube-system"), claim("logs"), claim("maps")]}, ["maps"], ["edge1 maps robot1/maps"]),
        ({"edge1": [claim("logs", "kube-system")]}, [], []),
    ],
)  # fmt: skip
def test_each_claim_has_its_directory(there: dict[str, list[str]], volumes: list[str], found: list[str]) -> None:
    assert [f"{one.host} {one.volume} {one.target}" for one in sources(there, ALL, OWN, volumes)] == found


@pytest.mark.parametrize(
    "directory",
    [
        *(f"pvc-u1_robot-{place}" for place in ("../.._.ssh", "/root_.ssh", "_logs-pvc", "Robot1_logs-pvc")),
        *(f"pvc-u1_robot-robot1_{claim}" for claim in ("..", "../robot2/logs-pvc", "/etc/cron.d-pvc", "a/b")),
        *(f"pvc-u1_robot-robot1_{claim}" for claim in ("logs.sh", "logs-pvc\n", "-pvc", "", "l" * 64, "l\0", "$(id)")),
        *(f"{volume}_robot-robot1_logs-pvc" for volume in ("pvc-../../x", "/pvc-u1", "x", "pvc-", "pvc-U")),
        "..",
        "",
    ],
)
def test_a_directory_that_is_no_claim_s_is_left_alone(directory: str) -> None:
    namespace = "_".join(directory.split("_")[1:2])  # also where such a namespace were asked for
    assert sources({"robot1": [directory]}, {"robot-robot1", namespace}, {}) == []
