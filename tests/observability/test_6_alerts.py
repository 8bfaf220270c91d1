# SPDX-License-Identifier: GPL-3.0-or-later
"""Alerts on a live fleet: each is raised by what it is about, and is gone once that is over."""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Iterator

import pytest
from runs import wait_until
from watched import MEMBER, Watched

FIRES, CLEARS = 150.0, 120.0
TOPIC = "/temperature"


@pytest.fixture(autouse=True)
def at_rest(standing_fleet: Watched) -> Iterator[None]:
    """After each case the robot comes to rest, so that what it did is no cause of the next one's alerts."""
    yield
    namespace = f"robot-{MEMBER}"

    def not_ready() -> list[str]:
        return [
            pod.metadata.name
            for pod in standing_fleet.pods(MEMBER, namespace)
            if not all(one.ready for one in pod.status.container_statuses or [])
        ]

    wait_until(not_ready, lambda found: not found, 180, "a robot at rest", pause=2)


def raised(fleet: Watched, alert: str, fires: float = FIRES, **labels: str) -> None:
    """It fires; with an address of its runbook."""
    took = fleet.wait_alert(alert, True, fires, **labels)
    [one, *_more] = fleet.prometheus.firing(alert, **labels)
    assert one["annotations"]["runbook_url"].endswith(f"/docs/runbooks/{alert}.md"), one
    assert one["annotations"]["summary"], one
    fleet.say(f"{alert}: fires after {took:.0f} s: {one['annotations']['summary']}")


def cleared(fleet: Watched, alert: str, **labels: str) -> None:
    took = fleet.wait_alert(alert, False, CLEARS, **labels)
    fleet.say(f"{alert}: gone {took:.0f} s after its cause")


def test_master_that_is_dead(fleet: Watched) -> None:
    """Its pod is not started again: a master that is killed alone is back within seconds, which is nobody's alarm."""
    assert fleet.prometheus.firing("RosMasterDown", robot=MEMBER) == []
    fleet.scale(MEMBER, "ros-master", 0)
    try:
        raised(fleet, "RosMasterDown", robot=MEMBER)
    finally:
        fleet.scale(MEMBER, "ros-master", 1)
    cleared(fleet, "RosMasterDown", robot=MEMBER)


def test_node_that_hangs(fleet: Watched) -> None:
    [pod] = fleet.pods(MEMBER, f"robot-{MEMBER}", "add-two-ints-client")
    where = (pod.spec.node_name, pod.metadata.uid)
    fleet.hosts.signal(*where, signal.SIGSTOP)
    try:
        raised(fleet, "RosNodeDown", robot=MEMBER)
        [alert] = fleet.prometheus.firing("RosNodeDown", robot=MEMBER)
        assert alert["labels"]["node"].startswith("/add_two_ints_client"), alert
    finally:
        fleet.hosts.signal(*where, signal.SIGCONT)
    cleared(fleet, "RosNodeDown", robot=MEMBER)


def test_update_that_is_blocked(fleet: Watched) -> None:
    """As the record shows it: begun a quarter of an hour ago and more, and still running."""
    before = fleet.record(MEMBER)
    stuck = {
        **{"id": "0123456789ab", "app": "temperature", "step": "temperature", "handoff": "overlap"},
        **{"outcome": "running", "reason": "", "from": "aaaaaaaa", "to": "bbbbbbbb"},
        **{"started": time.time() - 1000, "finished": None, "phases": {"gate": 990.0}, "busy_wait": 0.0},
    }
    fleet.write_record(MEMBER, json.dumps({"updates": [stuck]}))
    try:
        raised(fleet, "RobotUpdateStuck", robot=MEMBER, app="temperature")
    finally:
        ended = {**stuck, "outcome": "updated", "finished": time.time(), "id": "0123456789ac"}
        fleet.write_record(MEMBER, json.dumps({"updates": [ended]}))
    cleared(fleet, "RobotUpdateStuck", robot=MEMBER)
    fleet.write_record(MEMBER, before)


@pytest.mark.faults
def test_topic_at_half_its_rate(fleet: Watched) -> None:
    """The topic's own last hour says what is normal, so there have to be some minutes of it."""
    rate = "robot_topic:ros_topic_messages_out:rate1m"
    topic = f'{rate}{{robot="{MEMBER}",topic="{TOPIC}"}}'
    steady = f"quantile_over_time(0.25, {topic}[1h] offset 3m) > 400 and {topic} offset 8m > 400 and {topic} > 400"
    wait_until(lambda: fleet.prometheus.instant(steady), bool, 900, f"a past of {TOPIC}", pause=5)
    deployment, namespace = "temperature", f"robot-{MEMBER}"
    api = fleet.apps(MEMBER)

    def send_at(hertz: int) -> None:
        found = api.read_namespaced_deployment(deployment, namespace)
        name = found.spec.template.spec.containers[0].name
        container = {"name": name, "env": [{"name": "RATE_HZ", "value": str(hertz)}]}
        body = {"spec": {"template": {"spec": {"containers": [container]}}}}
        api.patch_namespaced_deployment(deployment, namespace, body)

    send_at(250)
    try:
        raised(fleet, "RosTopicRateDrop", 300, robot=MEMBER, topic=TOPIC)
    finally:
        send_at(500)
    cleared(fleet, "RosTopicRateDrop", robot=MEMBER, topic=TOPIC)
