# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts of a robot, and which of them a run's tags mean."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import POLICIES
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import (
    PARTS,
    ground_objects,
    images,
    tagged_parts,
    workload_objects,
)
from ansible_collections.rosops.fleet.tests.unit.robots import robot

SECRET = {"name": "pull", "registry": "r.example", "username": "u", "password": "hunter2"}
TALKER: dict[str, Any] = {"name": "talker", "image": "a:1", "volumes": [{"name": "data"}]}
MADE = robot(TALKER, volumes=[{"name": "data"}], pull_secrets=[SECRET])


def kinds(objects: list[dict[str, Any]]) -> list[str]:
    return [f"{one['kind']} {one['metadata']['name']}" for one in objects]


@pytest.mark.parametrize(
    ("asked", "run", "skip", "meant"),
    [
        (PARTS, ["all"], [], PARTS),
        (PARTS, ["all"], ["ready"], PARTS[:-1]),
        (PARTS, ["apps", "ready", "k3s"], [], ("apps", "ready")),
        (PARTS, ["apps", "ready"], ["ready"], ("apps",)),
        (PARTS, ["mine"], [], PARTS),  # a tag of the user's on the whole playbook
        (PARTS, ["all"], [*PARTS], ()),
        (("apps",), ["storage"], [], ("apps",)),  # a role alone, under whatever tag
        (("namespace", "storage"), ["storage", "apps"], [], ("storage",)),
    ],
)
def test_the_parts_that_tags_mean(asked: Sequence[str], run: list[str], skip: list[str], meant: Sequence[str]) -> None:
    assert tagged_parts(asked, run, skip) == meant


def test_every_part_has_its_own_and_says_where_it_lives() -> None:
    secrets = [SECRET, {"name": "made-elsewhere"}]
    ground = {part: kinds(ground_objects(MADE, [part], secrets, {})) for part in PARTS}
    policies = ("rosops-fleet-keeper", "rosops-fleet-pods")
    policy = ["PriorityClass rosops-fleet", *(f"{kind} {name}" for name in policies for kind in POLICIES)]
    keeper = [*policy, *(f"{kind} ros-keeper" for kind in ("ServiceAccount", "Role", "RoleBinding"))]
    closed = ["NetworkPolicy robot", "NetworkPolicy ros-keeper"]
    assert ground == {
        "namespace": ["Namespace robot-robot1", *keeper, "Secret pull", *closed],
        "storage": ["PersistentVolumeClaim data-pvc"],
        "master": [*keeper, *closed, "ConfigMap rosops-code", "ConfigMap robot-rest"],
        "apps": [*closed, "ConfigMap rosops-code", "ConfigMap robot-rest"],
        "ready": [],
    }
    external = robot(master={"mode": "external", "uri": "http://h:11311"})
    # what keeps nothing of a master disturbs nobody
    beside = ["Deployment ros-keeper", "Service ros-keeper"]
    assert kinds(ground_objects(external, ["master"], [], {})) == [*ground["master"], *beside]
    assert kinds(ground_objects(external, ["apps"], [], {})) == ground["apps"]
    assert workload_objects(external, PARTS) == []
    assert images(external, "local") == ["ros:noetic-ros-core"]
    assert kinds(workload_objects(MADE, ["apps", "storage"])) == ["Deployment talker"]
    assert "Deployment ros-master" in kinds(workload_objects(MADE, ["master"]))
    made = [*ground_objects(MADE, PARTS, [SECRET], {}), *workload_objects(MADE, PARTS)]
    for one in (one for one in made if one["kind"] not in (*POLICIES, "PriorityClass")):
        assert one["metadata"].get("namespace", one["metadata"]["name"]) == "robot-robot1"
