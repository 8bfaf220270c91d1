# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which claims go where, whatever a host says that it has."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.claims import Asked, sources


def claim(volume: str, namespace: str = "robot-robot1", number: int = 1) -> str:
    return f"pvc-u{number}_{namespace}_{volume}-pvc"


OWN = {"robot1": "robot-robot1", "robot2": "robot-robot2"}
ASKED = Asked({"fleet", "robot-robot1", "robot-robot2"}, OWN)


def test_each_claim_has_its_directory() -> None:
    found = sources({"edge1": [claim("logs", "fleet")], "robot1": [claim("maps"), claim("logs")]}, ASKED)
    assert [(one.host, one.volume, one.target) for one in found] == [
        ("edge1", "logs", "fleet/logs"),
        ("robot1", "logs", "robot1/logs"),
        ("robot1", "maps", "robot1/maps"),
    ]


def test_a_claim_that_is_there_twice_is_told_apart_by_its_volume() -> None:
    found = sources({"robot1": [claim("logs", number=2)], "edge1": [claim("logs", number=1)]}, ASKED)
    assert [one.target for one in found] == ["robot1/logs.pvc-u1", "robot1/logs.pvc-u2"]


def test_two_claims_never_share_a_directory() -> None:
    """One of somebody's own may lack the end that ours have."""
    found = sources({"robot1": [claim("logs", number=1), "pvc-u2_robot-robot1_logs"]}, ASKED)
    assert [one.target for one in found] == ["robot1/logs.pvc-u1", "robot1/logs.pvc-u2"]


@pytest.mark.parametrize(
    "directory",
    [
        "pvc-u1_robot-../.._.ssh",
        "pvc-u1_robot-/root_.ssh",
        "pvc-u1_robot-robot1_..",
        "pvc-u1_robot-robot1_../robot2/logs-pvc",
        "pvc-u1_robot-robot1_/etc/cron.d-pvc",
        "pvc-u1_robot-robot1_a/b",
        "pvc-u1_robot-robot1_logs.sh",
        "pvc-u1_robot-robot1_logs-pvc\n",
        "pvc-u1_robot-robot1_-pvc",
        "pvc-u1_robot-robot1_",
        "pvc-u1_robot-_logs-pvc",
        "pvc-u1_robot-Robot1_logs-pvc",
        "pvc-u1_robot-robot1_" + "l" * 64,
        "pvc-u1_robot-robot1_l\0",
        "pvc-u1_robot-robot1_$(id)",
        "pvc-../../x_robot-robot1_logs-pvc",
        "/pvc-u1_robot-robot1_logs-pvc",
        "x_robot-robot1_logs-pvc",
        "pvc-_robot-robot1_logs-pvc",
        "pvc-U_robot-robot1_logs-pvc",
        "..",
        "",
    ],
)
def test_a_directory_that_is_no_claim_s_is_left_alone(directory: str) -> None:
    namespace = "_".join(directory.split("_")[1:2])  # also where such a namespace were asked for
    assert sources({"robot1": [directory]}, Asked({"robot-robot1", namespace}, {})) == []


def test_a_robot_gives_what_is_its_own_alone() -> None:
    """Results under another robot's name would be forged; the edge has those of all robots' apps that run there."""
    both = [claim("logs", "robot-robot1"), claim("logs", "robot-robot2", 2), claim("logs", "fleet", 3)]
    assert [one.target for one in sources({"robot1": both}, ASKED)] == ["robot1/logs"]
    assert [one.target for one in sources({"edge1": both}, ASKED)] == ["robot1/logs", "robot2/logs", "fleet/logs"]


def test_what_nobody_asked_for_stays_there() -> None:
    there = {"edge1": [claim("logs", "kube-system"), claim("logs", "robot-robot2"), claim("logs"), claim("maps")]}
    assert [one.target for one in sources(there, Asked({"robot-robot1"}, OWN, ["maps"]))] == ["robot1/maps"]
