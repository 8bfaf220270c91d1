# SPDX-License-Identifier: GPL-3.0-or-later
"""Validation: the table of bad inputs, what must pass, and that nothing whatever makes it crash."""

from __future__ import annotations

import copy
import datetime
import json
import os
from pathlib import Path
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.app import App
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.keys import keys
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.master import master_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.namespace import namespace_objects, storage_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import graph_conditions, images
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.fleet import Report, check_fleet
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.schema import variables
from ansible_collections.rosops.fleet.tests.unit.bad_input import table

GOLDEN = Path(__file__).resolve().parents[3] / "golden" / "cases"
CASES: list[dict[str, Any]] = table.load_cases()
SHARE = 1 if os.environ.get("ROSOPS_TEST_ALL") else 5  # of what is made up, one of so many


def lines(report: Report) -> str:
    return "\n".join(problem.line() for problem in report.problems)


def check(app: dict[str, Any], **robot: Any) -> Report:
    return check_fleet(table.GROUPS, {"robot1": {**robot, "ros_apps": [table.changed_app(app)]}})


@pytest.mark.parametrize("case", CASES, ids=lambda case: str(case["says"]))
def test_bad_input(case: dict[str, Any]) -> None:
    report = check_fleet(**table.fleet_of(case))
    assert table.missing_words(case, lines(report)) == [], lines(report)
    assert report.fleet is None
    assert all(problem.path and problem.problem and problem.allowed for problem in report.problems)
    assert "hush" not in lines(report)
    assert len(report.problems) <= 3  # one mistake is not reported as a dozen


def test_the_good_app_is_good() -> None:
    report = check({})
    assert report.problems == []
    assert report.warnings == []
    assert report.fleet is not None
    assert report.fleet.robots["robot1"].apps[0].handoff == "replace"
    assert report.fleet.hosts["robot1"].cluster == "edge"


def test_all_errors_at_once() -> None:
    groups = {"edge": ["edge1", "edge2"], "robots": ["robot1"]}
    robot = {"ros_apps": [{"name": "A"}, table.changed_app({"placement": "moon"})], "robot_mode": "x"}
    found = {problem.path for problem in check_fleet(groups, {"robot1": robot}).problems}
    assert found == {
        "groups.edge",
        "hosts.robot1.robot_mode",
        "hosts.robot1.ros_apps[0].name",
        "hosts.robot1.ros_apps[0].image",
        "hosts.robot1.ros_apps[1].placement",
    }


@pytest.mark.parametrize(
    ("app", "robot"),
    [
        ({"args": None, "command": ["sleep", "1"]}, {}),
        ({"args": []}, {}),
        ({"env": {"A": 1, "B": True, "C": 1.5}}, {}),
        ({"resources": {"requests": {"cpu": 1, "memory": "1Gi", "nvidia.com/gpu": 1}, "limits": {"cpu": "1000m"}}}, {}),
        ({"host_paths": [{"path": path} for path in ("/data", "/dev/input", "/home/robot", "/var/log/a")]}, {}),
        ({"devices": ["/dev/ttyUSB0", "/dev/bus/usb/"]}, {}),
        ({"pattern": "action", "drain_deadline": 45, "termination_grace_period": 50}, {}),
        ({"pattern": "pubsub", "termination_grace_period": 5}, {}),
        ({"pattern": "action", "handoff": "replace"}, {}),
        ({"args": ["roslaunch", "a", "b.launch"], "readiness": {"nodes": False}}, {}),
        ({"command": ["sh", "-c", 'rosrun a b "$@"', "sh"], "pattern": "pubsub"}, {}),
        ({"args": ["talk", "--about", "roscore-like-things"]}, {}),
        ({"args": ["roscore"]}, {"ros_master_mode": "external", "ros_master_uri": "http://192.0.2.1:11311"}),
        ({}, {"ros_master_mode": "external", "ros_master_uri": "http://[2001:db8::1]:11311"}),
        ({"scope": "fleet", "placement": "remote"}, {"ros_master_mode": "shared"}),
        ({}, {"robot_mode": "standalone"}),
        ({"volumes": [{"name": "v"}], "pattern": "pubsub"}, {"persistent_storage": {"volumes": [{"name": "v"}]}}),
        (
            {"volumes": [{"name": "v"}], "pattern": "pubsub", "placement": "remote"},
            {"persistent_storage": {"volumes": [{"name": "v", "storage_class": "longhorn", "size": 1}]}},
        ),
        ({"overrides": {"metadata": {"name": "talker"}}}, {}),
        ({"hooks": "sidecar", "ports": [{"name": "web", "port": 11412, "protocol": "UDP"}]}, {}),
        ({"readiness": {"services": ["a", {"name": "/b"}], "actions": ["c"]}}, {}),
        ({"readiness": {"topics": [{"name": "~p", "publishers": 0}]}}, {}),
    ],
)
def test_what_must_pass(app: dict[str, Any], robot: dict[str, Any]) -> None:
    report = check(app, **robot)
    assert lines(report) == ""


@pytest.mark.parametrize(
    ("edge", "robot"),
    [
        ({"k3s_version": "v1.35.0+k3s1"}, {"k3s_version": "v1.34.2+k3s1"}),  # as an upgrade has it between its waves
        ({"k3s_version": "v1.34.2+k3s1"}, {"k3s_version": "v1.35.0+k3s1", "robot_mode": "standalone"}),
        ({"k3s_version": "v1.34.2+k3s1", "k3s_install_source": "airgap"}, {"k3s_version": "v1.35.0+k3s1"}),
        ({}, {"k3s_version": "v1.35.0+k3s1"}),
    ],
)
def test_versions_of_k3s_that_go_together_or_are_not_known_yet(edge: dict[str, Any], robot: dict[str, Any]) -> None:
    assert lines(check_fleet(table.GROUPS, {"edge1": edge, "robot1": robot})) == ""


def test_overlap_on_a_volume_of_one_node_depends_on_the_nodes() -> None:
    app = {"volumes": [{"name": "v", "shared": True}], "pattern": "pubsub"}

    def problems(placement: str, storage_class: str | None, edge: list[str]) -> int:
        volume = {"name": "v", **({"storage_class": storage_class} if storage_class else {})}
        apps = [table.changed_app({**app, "placement": placement})]
        robot = {"persistent_storage": {"volumes": [volume]}, "ros_apps": apps}
        return len(check_fleet({"edge": edge, "robots": ["robot1"]}, {"robot1": robot}).problems)

    three = ["e1", "e2", "e3"]
    assert problems("remote", "longhorn", three) == 1
    assert problems("remote", "longhorn", ["e1"]) == 0
    assert problems("remote", "local-path", three) == 0
    assert problems("remote", None, three) == 0
    assert problems("local", "longhorn", three) == 0


@pytest.mark.parametrize(
    ("app", "words"),
    [
        ({"image": "talker"}, "image: talker may mean another image tomorrow"),
        ({"devices": ["/dev/ttyUSB0"]}, "devices: the container runs privileged"),
        ({"private_names": ["a"]}, "private_names: has no effect"),
        (
            {"command": ["rostopic"], "handoff": "replace"},
            "command[0]: rostopic is found once the image's entry point has run, which a command replaces; begin it "
            "with /ros_entrypoint.sh",
        ),
    ],
)
def test_warnings(app: dict[str, Any], words: str) -> None:
    report = check(app)
    assert report.problems == []
    assert any(words in warning.line() for warning in report.warnings)


def test_unused_volume_and_moving_master_image_are_warned_of() -> None:
    """A command that begins with the entry point is no warning."""
    app = {"command": ["/ros_entrypoint.sh"], "args": ["rosrun", "a", "b"]}
    report = check(app, persistent_storage={"volumes": [{"name": "v"}]}, ros_master_image="ros:latest")
    assert len(report.warnings) == 2
    assert report.problems == []


@pytest.mark.parametrize(
    ("app", "robot", "told"),
    [
        ({"host_network": True}, {}, "hosts.robot1.ros_apps[0].host_network: no NetworkPolicy holds there: "
                                     "who reaches the host reaches the app"),
        ({}, {"ros_master_mode": "external", "ros_master_uri": "http://192.0.2.5:11311"},
         "hosts.robot1.ros_master_uri: no NetworkPolicy holds for a master outside, and nodes outside reach the "
         "robot's pods from networks in robot_namespace_admits alone"),
    ],
)  # fmt: skip
def test_what_no_network_policy_holds_is_warned_of(app: dict[str, Any], robot: dict[str, Any], told: str) -> None:
    report = check(app, **robot)
    assert (lines(report), [one.line() for one in report.warnings]) == ("", [told])


def test_networks_that_are_admitted_are_the_robot_s() -> None:
    report = check({}, robot_namespace_admits=["192.0.2.0/24", "2001:db8::7/128"])
    assert lines(report) == ""
    assert report.fleet is not None
    assert report.fleet.robots["robot1"].admits == ("192.0.2.0/24", "2001:db8::7/128")


def test_a_device_that_two_apps_drive_is_warned_of() -> None:
    apps = [{"devices": ["/dev/video0"]}, {"name": "other", "devices": ["/dev/video0"]}]
    found = [warning.line() for warning in check_fleet(**table.fleet_of({"apps": apps})).warnings]
    assert "hosts.robot1.ros_apps[1].devices: /dev/video0 is talker's, too; few devices serve two" in found


ODDITIES: list[Any] = [
    None, True, 0, -1, 1.5, float("nan"), float("inf"), "", "x", "\x00", [], [None], [[]], {}, {"": None}, {5: 5},
    {None: 1}, [{}], [{"name": None}], [{"name": ["x"]}], [{"name": {}}], {"name": 1}, (1,), {1, 2},
    datetime.date(2026, 1, 31), b"bytes",
    object(), "9" * 400, {"volumes": None}, {"volumes": [5]}, [{"name": "a", "image": "b", "args": None}],
]  # fmt: skip


@pytest.mark.parametrize("oddity", ODDITIES, ids=lambda value: type(value).__name__)
def test_no_value_anywhere_makes_it_crash(oddity: Any) -> None:
    """Every variable and every key of an app, replaced by something absurd."""
    good = {"ros_apps": [table.changed_app({})]}
    for variable in variables():
        check_fleet(table.GROUPS, {"robot1": {**good, variable: oddity}})
    for number, key in enumerate(keys(App), list(map(id, ODDITIES)).index(id(oddity))):
        for value in (oddity, [oddity], {"spec": oddity}, {"topics": oddity}, {"requests": oddity})[
            number % SHARE :: SHARE
        ]:
            check(copy.deepcopy({key: value}) if not isinstance(oddity, type(object())) else {key: value})


def _places(value: Any) -> list[tuple[Any, Any]]:
    """Every (container, key) in a structure."""
    there = list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else []
    return [(value, key) for key in there] + [place for key in there for place in _places(value[key])]


def test_mutated_cases_are_refused_or_can_be_built() -> None:
    """Golden cases with one value broken: no crash, and from what passes objects can be built."""
    mutants: list[Any] = [None, True, -1, 7, 1.5, "", "x", "A_b/", "~", [], ["x"], [5], {}, {"name": "x"}, {"x": {}}]
    accepted = refused = 0
    for path in sorted(GOLDEN.glob("*.yml")):
        case = yaml.safe_load(path.read_text("utf-8"))
        variables, robot = case["variables"], case["robot"]
        for number, (place, key) in enumerate(_places(variables)):
            good = place[key]
            for mutant in mutants[number % SHARE :: SHARE]:
                place[key] = mutant
                if check_fleet({"edge": ["edge1"], "robots": [robot]}, {robot: variables}).problems:
                    refused += 1
                    continue
                accepted += 1
                made = Robot.from_variables(variables, robot)
                graph_conditions(made)
                images(made)
                makers = (namespace_objects, storage_objects, master_objects, app_objects)
                objects = [item for objects_of in makers for item in objects_of(made)]
                assert json.loads(json.dumps(objects)) == objects
            place[key] = good
    assert accepted > 100 / SHARE
    assert refused > 1000 / SHARE


def test_overrides_of_any_shape_do_not_crash() -> None:
    deep = (
        "metadata", "spec", "template", "containers", "replicas", "selector", "labels", "annotations", "args", "env",
    )  # fmt: skip
    for value in ODDITIES[:-6]:
        for key in deep:
            for wrap in (
                {key: value},
                {"spec": {key: value}},
                {"spec": {"template": {key: value}}},
                {"spec": {"template": {"spec": {key: value}}}},
                {"spec": {"template": {"spec": {"containers": [{"name": "ros-app", key: value}]}}}},
            ):
                check({"overrides": wrap})


def test_localhost_is_no_stranger() -> None:
    assert check_fleet({**table.GROUPS, "all": ["localhost", "edge1", "robot1"]}, {}).problems == []


def test_an_app_of_the_fleet_has_its_port_though_every_robot_s_variables_have_it() -> None:
    ports = [{"name": "w", "port": 80, "node_port": 30080}]
    app = table.changed_app({"scope": "fleet", "placement": "remote", "ports": ports})
    robot = {"ros_master_mode": "shared", "ros_apps": [app]}
    assert lines(check_fleet({"edge": ["e"], "robots": ["r1", "r2"]}, {"r1": robot, "r2": robot})) == ""


def test_apps_of_one_name_are_told_once() -> None:
    assert len(check_fleet(**table.fleet_of({"apps": [{}, {}]})).problems) == 1


def test_apps_may_depend_on_each_other_in_an_order() -> None:
    """Within a group and to the outside, but never back."""
    alone = [{"depends_on": ["b", "c"]}, {"name": "b", "depends_on": ["c"]}, {"name": "c"}]
    grouped = [{**alone[0], "update": {"group": "g"}}, {**alone[1], "update": {"group": "g"}}, alone[2]]
    for apps in (alone, grouped):
        assert lines(check_fleet(**table.fleet_of({"apps": apps}))) == ""


def test_a_question_that_the_robot_s_own_app_answers_is_told() -> None:
    when = {"update_when": [{"topic": "/battery", "field": "percentage", "above": 0.4}]}
    driver = {"readiness": {"topics": [{"name": "battery", "publishers": 1}]}}
    [told] = [one.line() for one in check(driver, **when).warnings]
    assert "update_when[0].topic" in told
    assert "is published by app talker" in told
    assert "-e update_on_busy=force" in told
    assert check({"readiness": {"topics": [{"name": "battery", "connected": True}]}}, **when).warnings == []


def test_the_quick_start_of_the_readme_is_a_fleet() -> None:
    text = (Path(__file__).resolve().parents[5] / "README.md").read_text("utf-8")
    blocks = [part.split("\n\n\n")[0] for part in text.split("\n`inventory/")[1:]]
    hosts, robots = (yaml.safe_load(_indented(block)) for block in blocks[:2])
    children = hosts["all"]["children"]
    groups = {name: list(group["hosts"]) for name, group in children.items()}
    report = check_fleet(groups, dict.fromkeys(children["robots"]["hosts"], robots))
    assert report.problems == []
    assert report.fleet is not None
    apps = {app.name: (app.placement, app.handoff) for app in report.fleet.robots["robot1"].apps}
    assert apps == {"lidar": ("local", "replace"), "mapping": ("remote", "replace")}


def _indented(text: str) -> str:
    """The first block of a Markdown text that is set off as code."""
    lines = text.splitlines()
    first = next(number for number, line in enumerate(lines) if line.startswith("    "))
    last = next((n for n, line in enumerate(lines[first:], first) if line and not line.startswith(" ")), len(lines))
    return "\n".join(lines[first:last])
