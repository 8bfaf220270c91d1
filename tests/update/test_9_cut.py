# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot that is cut off from the edge: what runs on the robot works on, each look at its master included.

A change that somebody asks for meanwhile comes when the link is back.
"""

from __future__ import annotations

import subprocess
import time
from collections.abc import Iterator
from typing import Any

import evidence
import pytest
from fleet import LIMIT, Fleet
from test_9_other_doors import PUBLISHER, assert_alone, deployments, kubectl, replaced

ROBOT, OWN = "robot1", "own"
CUT = 60.0  # s
BIN = "/opt/rosops-apps/bin"


def clients(image: str) -> list[dict[str, Any]]:
    """On the robot what the scenario has at the edge: each of them depends on nothing but its own robot."""
    both: dict[str, Any] = {
        "image": image, "placement": "local", "update": {"group": OWN},
        "env": {"LOG_DIR": f"/mnt/data/sensor-volume/{OWN}"}, "volumes": [{"name": "sensor-volume", "shared": True}],
    }  # fmt: skip
    programs = {"own-stats": "temperature_subscriber", "own-asker": "add_two_ints_client",
                "own-mission": "prime_factors_client"}  # fmt: skip
    return [
        {**both, "name": name, "command": ["/ros_entrypoint.sh", f"{BIN}/{program}"],
         "readiness": {"command": f"{BIN}/readiness_probe.sh"}}
        for name, program in programs.items()
    ]  # fmt: skip


@pytest.fixture
def on_its_own(fleet: Fleet) -> Iterator[Fleet]:
    """The robot has clients of its own; what the tests after this one find is what they know."""
    before = fleet.variables
    wanted = clients(fleet.pods()[ROBOT]["temperature"][0].image)
    fleet.update({**before, "ros_apps_robot": wanted}, *LIMIT).must(0)
    yield fleet
    back = time.time()
    fleet.update(before, *LIMIT, update_remove_apps=[app["name"] for app in wanted]).must(0)
    fleet.wait_for_goal(ROBOT, back)


@pytest.mark.long
@pytest.mark.promise("a robot works through a cut")
def test_a_robot_works_through_a_cut(on_its_own: Fleet) -> None:
    fleet, before = on_its_own, on_its_own.running()
    watch, began, known = fleet.watch(), time.time(), fleet.pods()[ROBOT]
    fleet.hosts.power(ROBOT, "cut")
    try:
        kubectl(fleet, f"rollout restart {deployments([PUBLISHER])}")
        over = time.monotonic() + CUT
        with pytest.raises(subprocess.SubprocessError):
            fleet.hosts.ssh(ROBOT, "true")
        time.sleep(over - time.monotonic())
        joined = time.time()
    finally:
        fleet.hosts.power(ROBOT, "join")
    replaced(fleet, [PUBLISHER], known)
    fleet.figures.append(f"{PUBLISHER}: asked for in the cut, there {time.time() - joined:.0f} s after it")
    fleet.wait_settled()
    # also when the link is back: a cluster that has taken the node for lost has its pods for not ready until then
    after = watch.losses(ROBOT, within=OWN)[ROBOT]
    assert after.nothing, after
    during = evidence.losses(fleet.hosts.logs(ROBOT, OWN), began, joined)
    fleet.figures.append(f"{ROBOT}: cut off for {joined - began:.0f} s: {during}")
    assert during.nothing, during
    assert during.messages > 0, during
    assert during.requests > 9 * CUT, during  # of ten a second
    assert during.goals > 0, during
    assert_alone(fleet, [PUBLISHER])
    others = {app: pods for app, pods in fleet.running()[ROBOT].items() if app != PUBLISHER}
    assert others == {app: pods for app, pods in before[ROBOT].items() if app != PUBLISHER}
