# SPDX-License-Identifier: GPL-3.0-or-later
"""Workloads: golden files, the API's own schema, and the properties that no single example shows."""

from __future__ import annotations

import copy
import json
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.namespace import storage_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import (
    PARTS,
    graph_conditions,
    ground_objects,
    workload_objects,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.fleet import check_fleet
from ansible_collections.rosops.fleet.tests.unit.api_schema import fits_the_api
from ansible_collections.rosops.fleet.tests.unit.golden import regenerate
from ansible_collections.rosops.fleet.tests.unit.robots import robot

CASES = regenerate.cases()


def case_objects(name: str) -> Any:
    return regenerate.built(CASES[name])["objects"]


def app(**changes: Any) -> dict[str, Any]:
    return {"name": "talker", "image": "example.org/talker:1.0", "args": ["talk"], **changes}


def deployment(*, of: dict[str, Any] | None = None, **changes: Any) -> dict[str, Any]:
    return app_objects(robot(app(**changes), **(of or {})))[0]


def pod(item: dict[str, Any]) -> Any:
    return item["spec"]["template"]["spec"]


def container(item: dict[str, Any]) -> Any:
    return pod(item)["containers"][0]


def revision(item: dict[str, Any]) -> str:
    return str(item["spec"]["template"]["metadata"]["labels"]["rosops.fleet/revision"])


def env(item: dict[str, Any]) -> dict[str, Any]:
    return {entry["name"]: entry.get("value", entry.get("valueFrom")) for entry in container(item)["env"]}


@pytest.mark.parametrize("name", CASES)
def test_golden(name: str) -> None:
    assert regenerate.golden(name) == yaml.safe_load((regenerate.HERE / f"{name}.yml").read_text("utf-8"))


def test_golden_files_have_cases() -> None:
    assert {path.stem for path in regenerate.HERE.glob("*.yml")} == set(CASES)


@pytest.mark.parametrize("name", CASES)
def test_objects_fit_the_api_and_each_other(name: str) -> None:
    """Nothing but what a user asked for is started again and again."""
    apps = CASES[name]["variables"].get("ros_apps", [])
    asked = [one.get("readiness", {}).get("command") for one in apps]
    own = [one["overrides"] for one in apps if "overrides" in one]
    for item in case_objects(name):
        fits_the_api(item)
        if item["kind"] == "Deployment":
            labels = item["spec"]["template"]["metadata"]["labels"]
            assert item["spec"]["selector"]["matchLabels"].items() <= labels.items()
            again = container(item).get("readinessProbe", {}).get("exec")
            command = again["command"] if again else []
            assert not again or command[-1] in asked or command in asked or "readinessProbe" in str(own)


@pytest.mark.parametrize("name", CASES)
def test_golden_cases_pass_validation(name: str) -> None:
    case = CASES[name]
    fleet = {"groups": {"edge": ["edge1"], "robots": [case["robot"]]}, "hosts": {case["robot"]: case["variables"]}}
    assert check_fleet(**fleet).problems == []


@pytest.mark.parametrize("name", CASES)
def test_objects_are_json_and_share_nothing(name: str) -> None:
    objects = case_objects(name)
    assert json.loads(json.dumps(objects)) == objects
    before = copy.deepcopy(CASES[name])
    for item in case_objects(name):
        item["metadata"]["labels"]["changed"] = "yes"
        if item["kind"] == "Deployment":
            container(item)["env"].append({"name": "CHANGED"})
    assert CASES[name] == before
    assert case_objects(name) == objects


@pytest.mark.parametrize(
    ("change", "of_pod", "of_deployment"),
    [
        ({"overrides": {"spec": {"template": {"spec": {"priorityClassName": "high"}}}}}, True, True),
        ({"overrides": {"spec": {"progressDeadlineSeconds": 60}}}, False, True),
        ({"readiness": {"nodes": False}}, True, True),
        ({"readiness": {"topics": [{"name": "chatter", "min_rate": 5}]}}, True, True),
        ({"readiness": {"topics": [{"name": "chatter"}]}}, False, False),  # looked at from outside of the pod
        ({"depends_on": ["other"], "update": {"group": "both", "idle": ["arm"], "on_busy": "defer"}}, False, False),
        ({"resources": {"limits": {"memory": "1Gi", "cpu": 1}}, "env": {"B": "2", "A": "1"}}, False, False),
    ],
)
def test_what_is_another_revision(change: dict[str, Any], of_pod: bool, of_deployment: bool) -> None:
    same: dict[str, Any] = {"env": {"A": "1", "B": "2"}, "resources": {"limits": {"cpu": 1, "memory": "1Gi"}}}
    one, other = (deployment(pattern="pubsub", **{**same, **more}) for more in ({}, change))
    hashes = [item["metadata"]["annotations"]["rosops.fleet/spec-hash"] for item in (one, other)]
    assert (revision(one) != revision(other), hashes[0] != hashes[1]) == (of_pod, of_deployment)


def test_an_app_that_names_its_nodes_itself_is_given_no_name() -> None:
    """So an image without command and args runs what it runs by itself."""
    item = deployment(readiness={"nodes": False}, command=["roslaunch"], args=["a", "b.launch"])
    assert container(item)["args"] == ["a", "b.launch"]
    own = container(deployment(readiness={"nodes": False}, hooks="sidecar", command=[], args=[]))
    assert not {"command", "args"} & set(own)


EXTERNAL = {"mode": "external", "uri": "http://10.0.0.5:11311"}


@pytest.mark.parametrize(
    ("changes", "of", "hooks"),
    [
        ({}, {}, "gate"),
        ({"readiness": {"command": "/ready", "topics": [{"name": "t"}]}}, {}, "gate"),
        ({"hooks": "app"}, {}, "app"),
        ({"hooks": "sidecar"}, {}, "sidecar"),
        ({"pattern": "service"}, {}, "app"),  # calls under way are seen in the pod alone
        ({"readiness": {"services": ["s"]}}, {}, "app"),
        ({"readiness": {"actions": ["a"]}}, {}, "app"),
        ({"pattern": "service", "hooks": "gate"}, {}, "gate"),
        ({"handoff": "replace"}, {}, "app"),
        ({"host_network": True, "placement": "local"}, {}, "app"),  # so it is replaced
        ({"launch": {"file": "/a.launch"}, "args": []}, {}, "app"),
        ({"params": {"rate": 5}, "command": ["talk"]}, {}, "app"),
        ({"keep_params": ["rate"], "command": ["talk"]}, {}, "app"),
        ({}, {"master": {"mode": "shared"}}, "gate"),
        ({"scope": "fleet", "placement": "remote"}, {"master": {"mode": "shared"}}, "gate"),
        ({}, {"master": EXTERNAL}, "gate"),
        # each robot has a keeper, and none of them looks after the namespace fleet
        ({"scope": "fleet", "placement": "remote"}, {"master": EXTERNAL}, "app"),
    ],
)
def test_who_says_when_a_pod_is_ready(changes: dict[str, Any], of: dict[str, Any], hooks: str) -> None:
    full = robot(app(**{"pattern": "pubsub", **changes}), **of)
    assert full.apps[0].hooks == hooks
    item = app_objects(full)[0]
    gate = [{"conditionType": "rosops.fleet/ready"}] if hooks == "gate" else None
    assert pod(item).get("readinessGates") == gate
    assert ("rosops.fleet/settings" in item["spec"]["template"]["metadata"]["annotations"]) is (hooks == "gate")


@pytest.mark.parametrize(
    ("changes", "waits"),
    [
        ({}, True),
        ({"pattern": "pubsub", "hooks": "app"}, False),  # it has a name of its own
        ({"readiness": {"nodes": False}}, False),
        ({"host_network": True, "placement": "local"}, False),  # nobody can tell whose a process is
    ],
)
def test_a_new_version_waits_for_the_end_of_the_node_of_its_name(changes: dict[str, Any], waits: bool) -> None:
    assert ("--after" in container(deployment(command=["talk"], **changes))["command"]) is waits
    beside = pod(deployment(**{**changes, "hooks": "sidecar"}))["initContainers"][0]
    assert ("--after" in beside["command"]) is waits


def test_the_order_of_an_apps_environment_is_no_part_of_its_version() -> None:
    env = {"LOG": "$(ROOT)/log", "A": "$(LOG)/$(NOBODY)", "ROOT": "/srv", "B": "$(A)"}
    for said in (env, dict(reversed(env.items()))):
        found = container(deployment(env=said))["env"]
        assert [item["name"] for item in found if item["name"] in env] == ["ROOT", "LOG", "A", "B"]


def test_variables_that_refer_to_each_other_end_somewhere() -> None:
    found = container(deployment(env={"B": "$(A)", "A": "$(B)"}))["env"]
    assert [item["name"] for item in found if item["name"] in "AB"] == ["B", "A"]


def test_an_apps_own_environment_wins() -> None:
    found = env(deployment(env={"ROS_IP": "192.0.2.9", "RATE": 5, "FAST": False}))
    assert (found["ROS_IP"], found["RATE"], found["FAST"]) == ("192.0.2.9", "5", "false")


def test_no_probe_without_hooks_and_a_command() -> None:
    item = deployment(hooks="none")
    assert not {"readinessProbe", "startupProbe", "lifecycle", "volumeMounts"} & set(container(item))
    assert "volumes" not in pod(item)
    assert not {"ROSOPS_SETTINGS", "ROSOPS_REVISION"} & set(env(item))


def test_objects_of_the_fleet_are_the_same_from_every_robot() -> None:
    """But for what has the robot's name: by this it tells the keeper of itself, and who may reach the namespace."""
    fleet_app, found = app(scope="fleet", volumes=[{"name": "map"}]), []
    for name in ("robot1", "robot2"):
        own = [{"name": "own"}] if name == "robot1" else []
        volumes, seen = [{"name": "map"}, *own], {"enabled": bool(own), "ros_metrics": not own}
        more: Any = {"master": {"mode": "shared"}, "observability": seen, "admits": [f"192.0.2.{len(own)}/32"]}
        full = robot(fleet_app, name=name, volumes=volumes, **more)
        objects = [*ground_objects(full, PARTS, (), {}), *workload_objects(full, PARTS)]
        of_fleet = [item for item in objects if "fleet" in {item["metadata"].get(key) for key in ("name", "namespace")}]
        found.append([item for item in of_fleet if item["metadata"]["name"] != full.namespace])
        assert [item["kind"] for item in of_fleet if item not in found[-1]] == ["ConfigMap", "NetworkPolicy"]
    assert found[0] == found[1]
    assert [item["kind"] for item in found[0]] == [
        "Namespace", "ServiceAccount", "Role", "RoleBinding", "NetworkPolicy", "NetworkPolicy", "PersistentVolumeClaim",
        "ConfigMap", "Deployment", "Service", "Deployment", "Service", "Deployment",
    ]  # fmt: skip


def test_claims_follow_their_users() -> None:
    full = robot(
        app(name="a", volumes=[{"name": "both"}]),
        app(name="again", volumes=[{"name": "both"}]),
        app(name="b", scope="fleet", volumes=[{"name": "both"}, {"name": "fleet-only"}]),
        volumes=[{"name": "both"}, {"name": "fleet-only"}, {"name": "unused"}],
        master={"mode": "shared"},
    )
    found = [(item["metadata"]["namespace"], item["metadata"]["name"]) for item in storage_objects(full)]
    assert found == [
        ("robot-robot1", "both-pvc"),
        ("fleet", "both-pvc"),
        ("fleet", "fleet-only-pvc"),
        ("robot-robot1", "unused-pvc"),
    ]


def test_mount_path_defaults_to_the_volumes_then_to_the_usual_one() -> None:
    item = deployment(
        volumes=[{"name": "a"}, {"name": "b"}, {"name": "c", "mount_path": "/c"}],
        of={"volumes": [{"name": "a"}, {"name": "b", "mountPath": "/b"}, {"name": "c", "mountPath": "/other"}]},
    )
    assert [mount["mountPath"] for mount in container(item)["volumeMounts"][:3]] == ["/mnt/data/a", "/b", "/c"]


def test_conditions_unite_all_apps() -> None:
    one = {"topics": [{"name": "t"}], "timeout": 10, "interval": 0.2}
    other = {"topics": [{"name": "/t"}, {"name": "~p"}], "timeout": 90, "consecutive": 3}
    third = {"nodes": False, "services": ["s"]}
    apps = [app(name=name, readiness=said) for name, said in (("a", one), ("b", other), ("c", third))]
    found = graph_conditions(robot(*apps))
    assert (found["nodes"], found["topics"]) == (["/a", "/b"], [{"name": "/t"}, {"name": "/b/p"}])
    assert [found[key] for key in ("timeout", "interval", "consecutive")] == [90, 0.2, 3]
