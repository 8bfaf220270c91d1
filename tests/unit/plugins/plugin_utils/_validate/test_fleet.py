# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
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
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.formats import FORMS, moving_tag, quantity_value
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.keys import keys
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.merge import deep_merge
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.master import master_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.namespace import namespace_objects, storage_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import graph_conditions, images
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.explain import nearest_name
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.fleet import Report, check_fleet
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.schema import variables
from ansible_collections.rosops.fleet.tests.unit.bad_input import table

GOLDEN = Path(__file__).resolve().parents[3] / "golden" / "cases"
CASES: list[dict[str, Any]] = table.load_cases()
SHARE = 1 if os.environ.get("ROSOPS_TEST_ALL") else 5  # of what is made up, one of so many


def lines(report: Report) -> str:
    return "\n".join(problem.line() for problem in report.problems)


def check(app: dict[str, Any] | None = None, **robot: Any) -> Report:
    apps = {} if app is None else {"ros_apps": [table.changed_app(app)]}
    return check_fleet({"groups": table.GROUPS, "hosts": {"robot1": {**robot, **apps}}})


def test_the_table_is_large_enough_and_its_names_are_apart() -> None:
    assert len(CASES) >= 60
    assert len({case["id"] for case in CASES}) == len(CASES)


@pytest.mark.parametrize("case", CASES, ids=lambda case: str(case["id"]))
def test_bad_input(case: dict[str, Any]) -> None:
    report = check_fleet(table.fleet_of(case))
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
    fleet = {
        "groups": {"edge": ["edge1", "edge2"], "robots": ["robot1"]},
        "hosts": {"robot1": {"ros_apps": [{"name": "A"}, table.changed_app({"placement": "moon"})], "robot_mode": "x"}},
    }
    found = {problem.path for problem in check_fleet(fleet).problems}
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
        (
            {"host_paths": [{"path": p} for p in ("/data", "/opt/maps", "/dev/input", "/home/robot", "/var/log/a")]},
            {},
        ),
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
        (
            {
                "readiness": {
                    "services": ["a", {"name": "/b"}],
                    "actions": ["c"],
                    "topics": [{"name": "~p", "publishers": 0}],
                }
            },
            {},
        ),
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
    assert lines(check_fleet({"groups": table.GROUPS, "hosts": {"edge1": edge, "robot1": robot}})) == ""


def test_overlap_on_a_volume_of_one_node_depends_on_the_nodes() -> None:
    app = {"volumes": [{"name": "v", "shared": True}], "pattern": "pubsub"}

    def problems(placement: str, storage_class: str | None, edge: list[str]) -> int:
        volume = {"name": "v", **({"storage_class": storage_class} if storage_class else {})}
        hosts = {
            "robot1": {
                "persistent_storage": {"volumes": [volume]},
                "ros_apps": [table.changed_app({**app, "placement": placement})],
            }
        }
        return len(check_fleet({"groups": {"edge": edge, "robots": ["robot1"]}, "hosts": hosts}).problems)

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
        ({"image": "talker:latest"}, "may mean another image tomorrow"),
        ({"devices": ["/dev/ttyUSB0"]}, "devices: the container runs privileged"),
        ({"private_names": ["a"]}, "private_names: has no effect"),
        ({"command": ["rosrun", "a", "b"]}, "rosrun is found once the image's entry point has run"),
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


def test_a_command_that_begins_with_the_entry_point_is_no_warning() -> None:
    assert check({"command": ["/ros_entrypoint.sh"], "args": ["rosrun", "a", "b"]}).warnings == []


def test_unused_volume_and_moving_master_image_are_warned_of() -> None:
    report = check({}, persistent_storage={"volumes": [{"name": "v"}]}, ros_master_image="ros:latest")
    assert len(report.warnings) == 2
    assert report.problems == []


ODDITIES: list[Any] = [
    None, True, 0, -1, 1.5, float("nan"), float("inf"), "", "x", "\x00", [], [None], [[]], {}, {"": None}, {5: 5},
    {None: 1}, [{}], [{"name": None}], [{"name": ["x"]}], [{"name": {}}], {"name": 1}, (1,), {1, 2},
    datetime.date(2026, 1, 31), b"bytes",
    object(), "9" * 400, {"volumes": None}, {"volumes": [5]}, [{"name": "a", "image": "b", "args": None}],
]  # fmt: skip


@pytest.mark.parametrize("oddity", ODDITIES, ids=lambda value: type(value).__name__)
def test_no_value_anywhere_makes_it_crash(oddity: Any) -> None:
    """Every variable, every key of an app and every part of the fleet, replaced by something absurd."""
    good = {"groups": {**table.GROUPS}, "hosts": {"edge1": {}, "robot1": {"ros_apps": [table.changed_app({})]}}}
    check_fleet(oddity)
    for part in ("groups", "hosts"):
        check_fleet({**good, part: oddity})
    for group in ("edge", "robots", "k3s_server", "all"):
        check_fleet({**good, "groups": {**table.GROUPS, group: oddity}})
    check_fleet({**good, "hosts": {"robot1": oddity}})
    for variable in variables():
        check_fleet({**good, "hosts": {"robot1": {**good["hosts"]["robot1"], variable: oddity}}})
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
        for number in range(len(_places(case["variables"]))):
            for mutant in mutants[number % SHARE :: SHARE]:
                mutated = copy.deepcopy(case)
                place, key = _places(mutated["variables"])[number]
                place[key] = mutant
                robot = case["robot"]
                groups = {"edge": ["edge1"], "robots": [robot]}
                if check_fleet({"groups": groups, "hosts": {robot: mutated["variables"]}}).problems:
                    refused += 1
                    continue
                accepted += 1
                made = Robot.from_variables(mutated["variables"], robot)
                graph_conditions(made)
                images(made)
                objects = [
                    *namespace_objects(made),
                    *storage_objects(made),
                    *master_objects(made),
                    *app_objects(made),
                ]
                assert json.loads(json.dumps(objects)) == objects
    assert accepted > 100 / SHARE
    assert refused > 1000 / SHARE


def test_overrides_of_any_shape_do_not_crash() -> None:
    deep = [
        "metadata",
        "spec",
        "template",
        "containers",
        "replicas",
        "selector",
        "labels",
        "annotations",
        "args",
        "env",
    ]
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


@pytest.mark.parametrize(
    ("form", "good", "bad"),
    [
        (
            "quantity",
            ["0", "1", "1.5", "100m", "1Gi", "2e3", "5E", "1Ki"],
            ["", "1GB", "Gi", "-1", "1 Gi", "1.", "1e", ".5"],
        ),
        (
            "image",
            ["ros", "ros:noetic", "example.org:5000/a/b_c:1.0", "a@sha256:" + "0" * 64, "localhost/x:1"],
            ["", "A", "a:", "a@", "a@sha256:0123", "http://a", "a//b", "a b", ":1"],
        ),
        ("app-name", ["a", "a-1"], ["", "1a", "-a", "a-", "A", "a_b", "a.b", "a" * 41]),
        ("robot-name", ["robot1", "7", "a-b"], ["", "a.b", "a_b", "A", "a" * 58, "robot1\n"]),
        ("graph-name", ["a", "/a/b", "~a", "a/1"], ["", "/", "~", "1a", "a-b", "a//b", "a/", "/a b", "ä"]),
        (
            "host-path",
            ["/data", "/data/x", "/dev/input", "/home/a"],
            [
                *("/home", "/dev", "/", "/datax", "/data-x", "/data//x", "/data/./x", "data/x", "/etc/ssh", "/proc"),
                *("/sys/class/gpio", "/run/k3s/containerd/containerd.sock", "/var/lib/rancher/k3s", "/var/lib/kubelet"),
            ],
        ),
        ("device", ["/dev/ttyUSB0", "/dev/bus/usb/"], ["/dev", "/dev/..", "/devices", "dev/x", "/dev/mem"]),
        ("mount-path", ["/a", "/a/b/"], ["", "/", "a", "/a:b", "/a/../b", "/a b"]),
        ("port-name", ["web", "a1", "9a", "a-b", "a" * 15], ["", "9", "a" * 16, "a--b", "-a", "A"]),
        ("secret-key", ["a", "A.b-c_d", ".x"], ["", "a b", "a/b", "a" * 254]),
        ("file-mode", ["0644", "0755"], ["", "644", "0888", "07777"]),
        (
            "master-uri",
            ["http://a:1", "http://1.2.3.4:11311/"],
            ["a:1", "http://a", "http://1.2.3:1", "http://a:0", "http://a:113110", "https://a:1", "http://:1"],
        ),
        ("env-name", ["A", "_a1"], ["", "1A", "A-B", "A B"]),
        ("unicode", ["", "a: ä\n"], ["\ud800"]),  # half of a surrogate pair
    ],
)
def test_forms(form: str, good: list[str], bad: list[str]) -> None:
    assert [text for text in good if not FORMS[form].test(text)] == []
    assert [text for text in bad if FORMS[form].test(text)] == []


def test_quantities_compare() -> None:
    values = [quantity_value(text) for text in ("1n", "1m", "0.5", "1", "1k", "1Ki", "1e6", "1Mi")]
    assert None not in values
    assert values == sorted(values)  # type: ignore[type-var]
    assert (quantity_value("1Ki"), quantity_value("1k"), quantity_value("1Gi")) == (1024, 1000, 1024**3)


def test_localhost_is_no_stranger_unless_it_has_variables_of_ours() -> None:
    groups = {**table.GROUPS, "all": ["localhost", "edge1", "robot1"]}
    assert check_fleet({"groups": groups, "hosts": {"localhost": {}}}).problems == []
    found = check_fleet({"groups": groups, "hosts": {"localhost": {"ros_apps": []}}}).problems
    assert [problem.path for problem in found] == ["hosts.localhost"]


@pytest.mark.parametrize(
    ("image", "moving"),
    [("a", True), ("a:latest", True), ("a:1", False), ("h:5000/a", True), ("a@sha256:" + "0" * 64, False)],
)
def test_moving_tags(image: str, moving: bool) -> None:
    assert moving_tag(image) is moving


def test_nearest_names() -> None:
    assert nearest_name("placment", ["placement", "pattern"]) == "placement"
    assert nearest_name("zzz", ["placement"]) is None


@pytest.mark.parametrize(
    ("base", "overrides", "merged"),
    [
        ({"a": {"b": 1, "c": 2}}, {"a": {"b": 3}}, {"a": {"b": 3, "c": 2}}),  # the dissertation's algorithm 1
        ({"a": {"b": 1}}, {"a": 5}, {"a": 5}),
        ({"a": 1, "b": 2}, {"a": None, "x": None}, {"b": 2}),
        ({"l": [1, 2]}, {"l": [3]}, {"l": [3]}),
        (
            {"env": [{"name": "A", "value": "1"}, {"name": "B", "value": "2"}]},
            {"env": [{"name": "C", "value": "3"}, {"name": "A", "value": "9"}]},
            {"env": [{"name": "A", "value": "9"}, {"name": "B", "value": "2"}, {"name": "C", "value": "3"}]},
        ),
        (
            {"env": [{"name": "A", "value": "1"}]},
            {"env": [{"name": "A", "value": None, "valueFrom": {"x": 1}}]},
            {"env": [{"name": "A", "valueFrom": {"x": 1}}]},
        ),
        (
            {"env": [{"name": "A"}, {"name": "B"}]},
            {"env": [{"name": "A", "$patch": "delete"}]},
            {"env": [{"name": "B"}]},
        ),
        (
            {"volumeMounts": [{"name": "a", "mountPath": "/a"}]},
            {"volumeMounts": [{"name": "a", "mountPath": "/b"}, {"name": "a", "mountPath": "/a", "readOnly": True}]},
            {"volumeMounts": [{"name": "a", "mountPath": "/a", "readOnly": True}, {"name": "a", "mountPath": "/b"}]},
        ),
        (
            {"ports": [{"containerPort": 1, "name": "x"}]},
            {"ports": [{"containerPort": 1, "protocol": "UDP"}]},
            {"ports": [{"containerPort": 1, "name": "x", "protocol": "UDP"}]},
        ),
        ({"l": [{"name": "a"}]}, {"l": [{"x": 1}]}, {"l": [{"x": 1}]}),
        ({}, {"a": {"b": None, "c": [{"d": None, "e": 1}]}}, {"a": {"c": [{"e": 1}]}}),
    ],
)
def test_deep_merge(base: dict[str, Any], overrides: dict[str, Any], merged: dict[str, Any]) -> None:
    before = copy.deepcopy((base, overrides))
    assert deep_merge(base, overrides) == merged
    assert (base, overrides) == before


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
    given = {
        "groups": {name: list(group["hosts"]) for name, group in children.items()},
        "hosts": dict.fromkeys(children["robots"]["hosts"], robots),
    }
    report = check_fleet(given)
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
