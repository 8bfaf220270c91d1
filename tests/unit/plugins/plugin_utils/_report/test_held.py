# SPDX-License-Identifier: GPL-3.0-or-later
"""What the clusters hold, as rows."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.attention import attention
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.glance import counts
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.held import nodes_off
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import Claim, WentBack, Workload
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.text import status_text
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Object
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._report.a_fleet import (
    HOSTS,
    SOURCES,
    claim,
    fleet_status,
    node,
    pod,
    workload,
)


def test_masters_helpers_and_apps() -> None:
    """What stands beside a master is no app, and what others manage is nothing."""
    _stats, sensor = fleet_status(SOURCES).apps
    assert sensor == Workload(
        "robot1", "temperature-sensor", "robot-robot1", "local", 1, 1, ("robot1",), ("10.42.0.7",), ("lab/apps:1.0",), 2
    )
    shared = workload("map-server", remote=True)  # of the whole fleet
    del shared["metadata"]["labels"]["rosops.fleet/robot"]
    names = ("ros-master", "ros-keeper", "ros-exporter", "sensor")
    status = fleet_status({"hosts": HOSTS, "Deployment": [*map(workload, names), shared]})
    assert [(row.robot, row.name) for row in status.apps] == [("(shared)", "map-server"), ("robot1", "sensor")]
    assert [row.name for row in status.helpers] == ["ros-exporter", "ros-keeper"]
    told = {count.section: count.words for count in counts(status)}
    assert (told["apps"], told["helpers"]) == ("2 of 2 ready", "2 of 2 ready")


def test_a_version_that_the_keeper_took_back() -> None:
    told = {"from": "rev2", "to": "rev1", "at": "2026-11-22T06:01:40.123456Z", "reason": "not ready 120 s"}
    there = workload("sensor")
    there["metadata"].setdefault("annotations", {})["rosops.fleet/went-back"] = json.dumps(told)
    status = fleet_status({"Deployment": [there, workload("other")]})
    row = WentBack("robot1", "sensor", *told.values())
    assert status.went_back == (row,)
    title, headers, line = status_text(status).partition("TAKEN BACK")[2].splitlines()[:3]
    assert (title, headers.split()) == (" BY THE KEEPER", ["robot", "app", "from", "to", "at", "reason"])
    assert line.split() == ["robot1", "sensor", "rev2", "rev1", told["at"], "not", "ready", "120", "s"]


LOST, LATER = "2026-11-24T16:00:00Z", "2026-11-24T16:05:00Z"


@pytest.mark.parametrize(
    ("said", "since"),
    [
        ([{"type": "Available", "status": "False", "lastTransitionTime": LOST}], LOST),
        ([{"type": "Available", "status": "True", "lastTransitionTime": LOST}], LATER),
        ([], LATER),
    ],
)
def test_since_when_something_is_not_ready(said: list[dict[str, str]], since: str) -> None:
    """By the Deployment's word, which outlives its pods; else by the pod's."""
    there, down, off = workload("stats", ready=0), pod("stats", "robot1", ready=False), node("robot1", "Unknown")
    there["status"]["conditions"] = said
    down["status"]["conditions"] = [{"type": "Ready", "status": "False", "lastTransitionTime": LATER}]
    off["status"]["conditions"][0]["lastTransitionTime"] = LOST
    waits = claim("Pending")
    waits["metadata"]["creationTimestamp"] = LOST
    status = fleet_status({"Deployment": [there], "Pod": [down], "Node": [off], "PersistentVolumeClaim": [waits]})
    assert (status.nodes[0].since, status.apps[0].since, status.claims[0].since) == (LOST, since, LOST)


def test_claims() -> None:
    bound = Claim(
        "robot1", "logs-pvc", "robot-robot1", bound=True, phase="Bound", storage_class="local-path", size="1Gi",
        used_bytes=5_345_678,
    )  # fmt: skip
    assert fleet_status(SOURCES).claims == (bound,)
    [pending] = fleet_status({"PersistentVolumeClaim": [claim("Pending")]}).claims
    asked = replace(bound, bound=False, phase="Pending", size="100Mi", used_bytes=None)
    assert replace(pending, note="", unused=False) == asked


MOUNTS = workload("rosbag")
MOUNTS["spec"]["template"]["spec"]["volumes"] = [{"persistentVolumeClaim": {"claimName": "logs-pvc"}}]


@pytest.mark.parametrize(
    ("mode", "apps", "unused", "note"),
    [
        ("WaitForFirstConsumer", [workload("other")], True, "waits for its first consumer, and none "),
        ("WaitForFirstConsumer", [MOUNTS], False, "waits for the pod of Deployment rosbag"),
        ("Immediate", [workload("other")], False, "Pending: no volume is bound yet"),
    ],
)
def test_a_claim_that_nobody_mounts_is_in_order(mode: str, apps: list[Object], unused: bool, note: str) -> None:
    """As a run's own wait has it, which ends there."""
    classes = [{"metadata": {"name": "local-path"}, "volumeBindingMode": mode}]
    status = fleet_status({"PersistentVolumeClaim": [claim("Pending")], "StorageClass": classes, "Deployment": apps})
    [row] = status.claims
    assert row.unused is unused and row.note.startswith(note)
    about = [one.told.what for one in attention(status) if one.told.where == "claim logs-pvc of robot1"]
    assert about == ([] if unused else [row.note])


def ended(app: str, at: str, restarts: int = 2, sandbox: str = "2026-11-24T10:00:00Z") -> Object:
    found = pod(app, "robot1", restarts=restarts)
    last = {"exitCode": 1, "reason": "Error", "finishedAt": at}
    found["status"]["containerStatuses"][0]["lastState"] = {"terminated": last}
    made = {"type": "PodReadyToStartContainers", "status": "True", "lastTransitionTime": sandbox}
    found["status"]["conditions"].append(made)
    return found


LATELY, SINCE = "2026-11-24T16:12:10Z", "2026-11-24T10:00:00Z"


@pytest.mark.parametrize(
    ("at", "restarts", "sandbox", "told"),
    [
        (LATELY, 2, SINCE, "container ros-app restarted 2 times, last: exit code 1 (Error)"),
        ("2026-11-24T16:02:29Z", 2, SINCE, ""),  # long ago
        (LATELY, 0, SINCE, ""),  # of another container of the same name
        (LATELY, 1, "2026-11-24T16:12:20Z", ""),  # with its host
    ],
)
def test_a_container_that_ended_lately_needs_attention(at: str, restarts: int, sandbox: str, told: str) -> None:
    """Ready, and down every 20 s: nothing else would say so."""
    there = ended("bringup", at, restarts, sandbox=sandbox)
    status = fleet_status({"Deployment": [workload("bringup")], "Pod": [there]})
    assert (status.apps[0].ended, status.apps[0].ended_at) == (told, at if told else "")
    logs = "k3s kubectl -n robot-robot1 logs deploy/bringup --previous"
    said = [(one.told.where, one.told.what, one.told.since, one.told.todo) for one in attention(status)]
    assert said == ([("bringup of robot1", told, at, logs)] if told else [])


def test_what_ended_lately_and_is_not_ready_is_one_finding() -> None:
    there = ended("bringup", LATELY)
    there["status"]["conditions"][0]["status"] = "False"
    status = fleet_status({"Deployment": [workload("bringup", ready=0)], "Pod": [there]})
    [told] = [one.told for one in attention(status)]
    assert told.what.startswith("0 of 1 ready") and told.what.endswith("2 times, last: exit code 1 (Error)")
    assert told.todo == "k3s kubectl -n robot-robot1 logs deploy/bringup --previous"


def test_a_node_is_off_unless_it_says_that_it_is_ready() -> None:
    on, broken, away, new = node("on"), node("broken", "False"), node("away", "Unknown"), node("new")
    broken["status"]["conditions"].insert(0, {"type": "DiskPressure", "status": "True"})
    new["status"]["conditions"] = []
    assert nodes_off([on, broken, away, new]) == ["broken", "away", "new"]
