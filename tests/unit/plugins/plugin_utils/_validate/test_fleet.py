# SPDX-License-Identifier: GPL-3.0-or-later
"""Validation: the table of bad inputs, what must pass, and that nothing whatever makes it crash."""

from __future__ import annotations

import datetime
import json
import os
from itertools import product
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


def test_all_errors_at_once_and_each_once() -> None:
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
    assert len(check_fleet(**table.fleet_of({"apps": [{}, {}]})).problems) == 1


EXTERNAL = {"ros_master_mode": "external", "ros_master_uri": "http://192.0.2.5:11311"}
OLD, NEW = {"k3s_version": "v1.34.2+k3s1"}, {"k3s_version": "v1.35.0+k3s1"}
SHARED = {"app": {"volumes": [{"name": "v", "shared": True}], "pattern": "pubsub", "placement": "remote"}}
THREE = {"edge": ["e1", "e2", "e3"], "robots": ["robot1"]}
PORT = {"ports": [{"name": "w", "port": 80, "node_port": 30080}]}
FLEETS = {
    "ros_master_mode": "shared",
    "ros_apps": [table.changed_app({"scope": "fleet", "placement": "remote", **PORT})],
}
NEEDS = [{"depends_on": ["b", "c"]}, {"name": "b", "depends_on": ["c"]}, {"name": "c"}]


@pytest.mark.parametrize(
    "case",
    [
        {"app": {"args": None, "command": ["sleep", "1"]}},
        {"app": {"args": []}},
        {"app": {"env": {"A": 1, "B": True, "C": 1.5}}},
        {"app": {"resources": {
            "requests": {"cpu": 1, "memory": "1Gi", "nvidia.com/gpu": 1}, "limits": {"cpu": "1000m"},
        }}},
        {"app": {"host_paths": [{"path": path} for path in ("/data", "/dev/input", "/home/robot", "/var/log/a")]}},
        {"app": {"devices": ["/dev/ttyUSB0", "/dev/bus/usb/"]}},
        {"app": {"pattern": "action", "drain_deadline": 45, "termination_grace_period": 50}},
        {"app": {"pattern": "pubsub", "termination_grace_period": 5}},
        {"app": {"pattern": "action", "handoff": "replace"}},
        {"app": {"args": ["roslaunch", "a", "b.launch"], "readiness": {"nodes": False}}},
        {"app": {"command": ["sh", "-c", 'rosrun a b "$@"', "sh"], "pattern": "pubsub"}},
        {"app": {"args": ["talk", "--about", "roscore-like-things"]}},
        {"app": {"args": ["roscore"]}, "robot": EXTERNAL},
        {"app": {}, "robot": {"ros_master_mode": "external", "ros_master_uri": "http://[2001:db8::1]:11311"}},
        {"app": {}, "robot": {"robot_mode": "standalone"}},
        {"app": {}, "robot": {"robot_namespace_admits": ["192.0.2.0/24", "2001:db8::7/128"]}},
        {"app": {"overrides": {"metadata": {"name": "talker"}}}},
        {"app": {"hooks": "sidecar", "ports": [{"name": "web", "port": 11412, "protocol": "UDP"}]}},
        {"app": {"readiness": {"services": ["a", {"name": "/b"}], "actions": ["c"]}}},
        {"app": {"readiness": {"topics": [{"name": "~p", "publishers": 0}]}}},
        {"groups": {**table.GROUPS, "all": ["localhost", "edge1", "robot1"]}},
        # an app of the fleet comes out of every robot's variables
        {"groups": {"edge": ["e"], "robots": ["r1", "r2"]}, "vars": {"r1": FLEETS, "r2": FLEETS}},
        # versions that overlap on one node may share a volume
        {**SHARED, "volumes": [{"name": "v", "storage_class": "longhorn", "size": 1}]},
        {**SHARED, "volumes": [{"name": "v", "storage_class": "local-path"}], "groups": THREE},
        {**SHARED, "volumes": [{"name": "v"}], "groups": THREE},
        {"app": {**SHARED["app"], "placement": "local"}, "groups": THREE,
         "volumes": [{"name": "v", "storage_class": "longhorn"}]},
        # dependencies within a group and to the outside, but never back
        {"apps": NEEDS},
        {"apps": [*({**app, "update": {"group": "g"}} for app in NEEDS[:2]), NEEDS[2]]},
        # versions of k3s as an upgrade has them between its waves, or that are not known yet
        {"edge": NEW, "robot": OLD},
        {"edge": OLD, "robot": {**NEW, "robot_mode": "standalone"}},
        {"edge": {**OLD, "k3s_install_source": "airgap"}, "robot": NEW},
        {"robot": NEW},
        # names may come as text
        *({"robot": {"update_apps": apps, "update_remove_apps": apps}} for apps in (
            "camera", "camera, lidar", ["camera"], "", None, [],
        )),
    ],
)  # fmt: skip
def test_what_must_pass(case: dict[str, Any]) -> None:
    report = check_fleet(**table.fleet_of(case))
    assert lines(report) == ""
    assert report.fleet is not None


OBSERVED = {"observability": {"enabled": True}}
HUB = {**OBSERVED, "observability_profile": "hub", "observability_allowed_networks": ["192.0.2.0/24"]}
REPORTS = {**OBSERVED, "robot_mode": "standalone", "observability_profile": "robot"}
HTTP, HTTPS = ({"observability_hub_url": f"{scheme}://192.0.2.10"} for scheme in ("http", "https"))
CERTIFIED = {"observability_tls_secret_name": "telemetry-tls"}
MISSPELT = {
    "persistant_storage": "persistent_storage", "rosapps": "ros_apps", "observabilty": "observability",
    "node_label": "node_labels", "robot_modes": "robot_mode",
}  # fmt: skip
BATTERY = {"update_when": [{"topic": "/battery", "field": "percentage", "above": 0.4}]}


@pytest.mark.parametrize(
    ("case", "told"),
    [
        ({"app": {}}, []),
        ({"app": {"image": "talker"}}, ["app.image: talker may mean another image tomorrow; name a version"]),
        ({"app": {"devices": ["/dev/ttyUSB0"]}}, ["app.devices: the container runs privileged, as Kubernetes has no"]),
        ({"app": {"private_names": ["a"]}}, ["app.private_names: has no effect with the handoff replace"]),
        ({"launched": {}, "launch": {"args": {"a": "", "b": False}}}, ["app.launch.args.a: is empty, so that"]),
        ({"app": {"command": ["rostopic"], "handoff": "replace"}},
         ["app.command[0]: rostopic is found once the image's entry point has run, which a command replaces; begin it "
          "with /ros_entrypoint.sh"]),
        ({"app": {"command": ["/ros_entrypoint.sh"], "args": ["rosrun", "a", "b"]}}, []),
        ({"app": {}, "volumes": [{"name": "v"}], "robot": {"ros_master_image": "ros:latest"}},
         ["robot.persistent_storage.volumes: no app mounts v",
          "robot.ros_master_image: ros:latest may mean another image tomorrow"]),
        ({"app": {"host_network": True}},
         ["app.host_network: no NetworkPolicy holds there: who reaches the host reaches the app"]),
        ({"app": {}, "robot": EXTERNAL},
         ["robot.ros_master_uri: no NetworkPolicy holds for a master outside, and nodes outside reach the robot's pods "
          "from networks in robot_namespace_admits alone"]),
        ({"apps": [{"devices": ["/dev/video0"]}, {"name": "other", "devices": ["/dev/video0"]}]},
         [*(f"apps[{number}].devices: the container runs privileged" for number in (0, 1)),
          "apps[1].devices: /dev/video0 is talker's, too; few devices serve two"]),
        ({"app": {"readiness": {"topics": [{"name": "battery", "publishers": 1}]}}, "robot": BATTERY},
         ["robot.update_when[0].topic: is published by app talker: while that app is down, the robot gives no answer "
          "and is waited for; allowed: -e update_on_busy=force"]),
        ({"app": {"readiness": {"topics": [{"name": "battery", "connected": True}]}}, "robot": BATTERY}, []),
        ({"robot": {**dict.fromkeys(MISSPELT, "x"), "robot_model": "x", "ros_distro": "x", "ansible_host": "x"}},
         [f"robot.{one}: is no variable of this collection; did you mean {meant}?" for one, meant in MISSPELT.items()]),
        # a hub that asks nobody who he is
        ({"edge": HUB, "robot": OBSERVED},
         ["edge.observability_tls_secret_name: is empty: whoever is in observability_allowed_networks reads and writes "
          "at the hub, and nothing is encrypted; docs/observability.md, Certificates, has how to close it"]),
        ({"edge": OBSERVED, "robot": {**REPORTS, **HTTPS}},
         ["robot.observability_tls_secret_name: is empty: the hub is shown no certificate, and has to have one of a "
          "public authority"]),
        ({"edge": OBSERVED, "robot": {**REPORTS, **HTTP}}, []),
        ({"edge": {"observability": {"enabled": True, "prometheus": {"scrape_interval": "1m"}}}},
         ["edge.observability.prometheus.scrape_interval: is 1m: the alerts RosTopicRateDrop and RosTopicSilent never "
          "come; allowed: at most 20s"]),
        ({"edge": {**HUB, **CERTIFIED}, "robot": {**REPORTS, **HTTPS, **CERTIFIED}}, []),
    ],
)  # fmt: skip
def test_warnings(case: dict[str, Any], told: list[str]) -> None:
    report = check_fleet(**table.fleet_of(case))
    assert lines(report) == ""
    found = [one.line() for one in report.warnings]
    assert [line for line, words in zip(found, told, strict=True) if not line.startswith(table.whole_path(words))] == []


ODDITIES: list[Any] = [
    None, True, 0, -1, 1.5, float("nan"), float("inf"), "", "x", "\x00", [], [None], [[]], {}, {"": None}, {5: 5},
    {None: 1}, [{}], [{"name": None}], [{"name": ["x"]}], [{"name": {}}], {"name": 1}, (1,), {1, 2},
    datetime.date(2026, 1, 31), b"bytes",
    object(), "9" * 400, {"volumes": None}, {"volumes": [5]}, [{"name": "a", "image": "b", "args": None}],
]  # fmt: skip


@pytest.mark.parametrize("number", range(len(ODDITIES)), ids=lambda number: type(ODDITIES[number]).__name__)
def test_no_value_anywhere_makes_it_crash(number: int) -> None:
    """Every variable and every key of an app, replaced by something absurd."""
    oddity = ODDITIES[number]
    for variable in [*variables()][number % SHARE :: SHARE]:
        check_fleet(table.GROUPS, {"robot1": {"ros_apps": [table.changed_app({})], variable: oddity}})
    for at, key in enumerate(keys(App), number):
        values = (oddity, [oddity], {"spec": oddity}, {"topics": oddity}, {"requests": oddity})
        for value in values[at % SHARE :: SHARE]:
            check({key: value})


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
                images(made, "remote")
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
    for number, (value, key) in enumerate(product(ODDITIES[:-6], deep)):
        wraps = (
            {key: value},
            {"spec": {key: value}},
            {"spec": {"template": {key: value}}},
            {"spec": {"template": {"spec": {key: value}}}},
            {"spec": {"template": {"spec": {"containers": [{"name": "ros-app", key: value}]}}}},
        )
        for wrap in wraps[number % SHARE :: SHARE]:
            check({"overrides": wrap})
