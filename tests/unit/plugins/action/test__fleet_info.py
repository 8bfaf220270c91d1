# SPDX-License-Identifier: GPL-3.0-or-later
"""The hosts and their clusters, from what a former task registered and the API answers."""

from __future__ import annotations

import json
from typing import Any
from unittest.mock import Mock

import pytest
from ansible_collections.rosops.fleet.plugins.action import _fleet_info
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.look import Answer
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import run
from ansible_collections.rosops.fleet.tests.unit.robots import fleet

GROUPS = {"edge": ["edge1"], "robots": ["robot1", "robot2"]}
MASTER = {"metadata": {"name": "ros-master", "namespace": "robot-robot1"}, "spec": {"clusterIP": "10.43.0.1"}}
NODE = {"metadata": {"name": "robot1"}, "status": {"conditions": [{"type": "Ready", "status": "True"}]}}


def info(monkeypatch: pytest.MonkeyPatch, answers: dict[str, Answer], **results: Any) -> dict[str, Any]:
    ask = Mock(side_effect=lambda clusters: {cluster: answers[cluster] for cluster in clusters})
    monkeypatch.setattr(_fleet_info.look, "ask", ask)
    monkeypatch.setattr(_fleet_info.look, "read_by_keepers", lambda graphs, *_rest: {robot: {} for robot in graphs})
    hostvars = {host: {"usage": results.get(host, {})} for hosts in GROUPS.values() for host in hosts}
    known = {**fleet(GROUPS, hostvars).as_dict(), "name": "demo"}
    given = {"hostvars": hostvars, "fleet": known, "ansible_play_hosts_all": list(hostvars)}
    found = run(_fleet_info, {"volumes": "usage", "images": "usage", "graphs": True}, given)
    return {**found.pop("status"), **found, "asked": [*ask.call_args.args[0]]}


def test_hosts_and_what_their_cluster_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    answer = Answer({"Node": [NODE], "Service": [MASTER]})
    found = info(monkeypatch, {"edge": answer}, robot2={"unreachable": True, "msg": "timed out"})
    assert (found["asked"], found["problems"], found["changed"]) == (["edge"], [], False)
    assert found["name"] == "demo"
    reachable = {"edge1": True, "robot1": True, "robot2": False}
    assert {row["name"]: row["reachable"] for row in found["hosts"]} == reachable
    assert [row["name"] for row in found["nodes"]] == ["robot1"]
    own = {"robot": "robot1", "master_uri": "http://10.43.0.1:11311", "addresses": [], "promised": {}}
    assert (found["graphs"], found["read"]) == ({"robot1": own}, {"robot1": {}})


def test_claims_have_their_use(monkeypatch: pytest.MonkeyPatch) -> None:
    claim = {"metadata": {"name": "logs", "namespace": "robot-robot1"}, "status": {"phase": "Bound"}}
    used = {"stdout": "512\t/var/lib/rancher/k3s/storage/pvc-1_robot-robot1_logs"}
    found = info(monkeypatch, {"edge": Answer({"PersistentVolumeClaim": [claim]})}, robot1=used)
    assert [row["used_bytes"] for row in found["claims"]] == [512]


def test_a_pod_that_keeps_an_image_which_its_name_does_not_mean_any_more(monkeypatch: pytest.MonkeyPatch) -> None:
    image = {"id": "sha256:2", "repoTags": ["docker.io/lab/apps:1.0"]}
    container = {"name": "ros-app", "imageID": "sha256:1", "state": {"running": {}}}
    pod = {
        "metadata": {"name": "sensor-1", "namespace": "robot-robot1", "labels": {"rosops.fleet/app": "sensor"}},
        "spec": {"nodeName": "robot1", "containers": [{"name": "ros-app", "image": "lab/apps:1.0"}]},
        "status": {"containerStatuses": [container]},
    }
    listed = {"rc": 0, "stdout": json.dumps({"images": [image]})}
    found = info(monkeypatch, {"edge": Answer({"Pod": [pod]})}, robot1=listed, robot2={"unreachable": True})
    [problem] = found["problems"]
    assert (problem["where"], problem["what"]) == (
        "sensor in robot-robot1",
        "runs another image than lab/apps:1.0 is by now on robot1: its pod keeps the old one",
    )
    assert problem["todo"].startswith("give the image a version of its own")


@pytest.mark.parametrize(
    ("off", "answer", "asked", "why"),
    [
        ({"unreachable": True}, Answer(), [], "its servers are unreachable"),
        ({}, Answer({"Node": [NODE]}, "connection refused"), ["edge"], "connection refused"),
    ],
)
def test_a_cluster_that_does_not_answer_is_a_problem(
    monkeypatch: pytest.MonkeyPatch, off: dict[str, Any], answer: Answer, asked: list[str], why: str
) -> None:
    found = info(monkeypatch, {"edge": answer}, edge1=off)
    [problem] = found["problems"]
    said = {"where": "cluster edge", "what": f"does not answer: {why}", "cluster": "edge"}
    assert {**said, "todo": "ansible edge1 -b -a 'systemctl status k3s'"}.items() <= problem.items()
    assert found["asked"] == asked
    assert len(found["nodes"]) == len(asked)  # what it did answer is shown
