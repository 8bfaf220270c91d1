# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which claims go where, and what is asked for and is not there."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._collect.sources import Asked, missing, sources, strange


def claim(volume: str, namespace: str = "robot-robot1", number: int = 1) -> dict[str, Any]:
    directory = f"pvc-u{number}_{namespace}_{volume}-pvc"
    return {"directory": directory, "namespace": namespace, "claim": f"{volume}-pvc", "files": {}, "passed": []}


ASKED = Asked(
    frozenset({"fleet", "robot-robot1", "robot-robot2"}), {"robot1": "robot-robot1", "robot2": "robot-robot2"}
)


def test_each_claim_has_its_directory() -> None:
    found = sources({"edge1": [claim("logs", "fleet")], "robot1": [claim("logs"), claim("maps")]}, ASKED)
    assert [(one.host, one.target) for one in found] == [
        ("edge1", "fleet/logs"),
        ("robot1", "robot1/logs"),
        ("robot1", "robot1/maps"),
    ]


def test_a_claim_that_is_there_twice_is_told_apart_by_its_volume() -> None:
    found = sources({"robot1": [claim("logs", number=2)], "edge1": [claim("logs", number=1)]}, ASKED)
    assert [one.target for one in found] == ["robot1/logs.pvc-u1", "robot1/logs.pvc-u2"]


def test_what_no_host_has() -> None:
    assert list(missing({"robot1": [claim("logs")]}, ["logs", "bags"])) == ["bags"]


HOSTILE = [
    ("robot-../..", ".ssh"),
    ("robot-/root", ".ssh"),
    ("robot-robot1", ".."),
    ("robot-robot1", "../robot2/logs-pvc"),
    ("robot-robot1", "/etc/cron.d-pvc"),
    ("robot-robot1", "a/b"),
    ("robot-robot1", "logs.sha256"),
    ("robot-robot1", "logs-pvc\n"),
    ("robot-robot1", "-pvc"),
    ("robot-robot1", ""),
    ("robot-", "logs-pvc"),
    ("robot-Robot1", "logs-pvc"),
    ("robot-robot1", "l" * 64),
    ("robot-robot1", "l\u0000"),
]


@pytest.mark.parametrize(("namespace", "name"), HOSTILE)
@pytest.mark.parametrize("honest", [True, False])
def test_a_host_that_makes_up_names_writes_nothing(namespace: str, name: str, honest: bool) -> None:
    """Whether its directory is called so, or only the answer says it."""
    directory = f"pvc-u1_{namespace}_{name}" if honest else "pvc-u1_robot-robot1_logs-pvc"
    said = {"directory": directory, "namespace": namespace, "claim": name, "files": {}, "passed": []}
    asked = Asked(frozenset({"robot-robot1", namespace}), {})
    targets = [one.target for one in sources({"robot1": [said]}, asked)]
    assert targets == ([] if honest else ["robot1/logs"])
    assert strange([said]) == ([directory] if honest else [])


@pytest.mark.parametrize("volume", ["pvc-../../x", "/pvc-u1", "x", "pvc-", "pvc-U"])
def test_a_volume_that_is_none(volume: str) -> None:
    said = claim("logs") | {"directory": f"{volume}_robot-robot1_logs-pvc"}
    assert sources({"robot1": [said]}, ASKED) == []


def test_a_robot_gives_what_is_its_own_alone() -> None:
    """Results under another robot's name would be forged; the edge has those of all robots' apps that run there."""
    both = [claim("logs", "robot-robot1"), claim("logs", "robot-robot2", 2), claim("logs", "fleet", 3)]
    assert [one.target for one in sources({"robot1": both}, ASKED)] == ["robot1/logs"]
    assert [one.target for one in sources({"edge1": both}, ASKED)] == ["robot1/logs", "robot2/logs", "fleet/logs"]


def test_what_nobody_asked_for_stays_there() -> None:
    asked = Asked(frozenset({"robot-robot1"}), {})
    assert sources({"edge1": [claim("logs", "kube-system"), claim("logs", "robot-robot2")]}, asked) == []
