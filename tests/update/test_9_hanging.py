# SPDX-License-Identifier: GPL-3.0-or-later
"""A node that hangs is begun anew by the robot's keeper, without a control node, and not during a goal."""

from __future__ import annotations

import signal

import pytest
from cluster import running
from fleet import LIMIT, Fleet
from runs import wait_until

SENSOR, SERVER, CLIENT = "temperature", "prime-factors", "prime-factors-client"


@pytest.mark.long
@pytest.mark.promise("a node that hangs is begun anew, and no goal is lost")
def test_a_node_that_hangs_is_begun_anew(fleet: Fleet) -> None:
    usual = fleet.variables
    changes = usual
    for app in (SENSOR, SERVER):
        changes = fleet.changed("robot1", app, on=changes, liveness_timeout=30)
    changes = fleet.changed("robot1", CLIENT, on=changes, env={"GOAL_TIMEOUT": 240})  # it waits for its server
    fleet.update(changes, *LIMIT).must(0)
    fleet.wait_settled()
    before = fleet.pods()["robot1"]
    (sensor,), (server,) = before[SENSOR], before[SERVER]
    watch = fleet.watch()
    spared = "node /prime_factors does not answer, and its pod is left as it is: "
    for pod in (sensor, server):  # the server with a goal: its client sends one after the other
        fleet.hosts.signal("robot1", pod.uid, signal.SIGSTOP)
    try:

        def judged() -> tuple[bool, bool]:
            hung = [one for one in fleet.cluster.events("robot1", "NodeHung") if one.startswith(sensor.name)]
            return bool(hung), spared in fleet.cluster.keeper_log("robot1")

        wait_until(judged, all, 150, "the keeper's judgement of both nodes that hang", pause=1)
        assert [pod.uid for pod in fleet.cluster.pods("robot1")[SERVER]] == [server.uid]
    finally:
        fleet.hosts.signal("robot1", server.uid, signal.SIGCONT)
    fleet.wait_settled()
    (said,) = [one for one in fleet.cluster.events("robot1", "NodeHung") if one.startswith(sensor.name)]
    assert said.startswith(f"{sensor.name}: node /temperature_{sensor.version} has not answered for "), said
    losses = watch.losses("robot1")["robot1"]
    assert (losses.failed, losses.unsuccessful, losses.twice) == ([], [], []), losses
    assert losses.goals > 0, losses
    now = running(fleet.pods()["robot1"])
    assert now == {**running(before), SENSOR: now[SENSOR]}

    watch = fleet.watch()  # the sensor is heard again, also by the gate of the next update
    fleet.return_to(usual)
    watch.assert_nothing_lost("robot1")
