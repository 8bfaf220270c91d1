# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""How the fleet stands, out of all that was looked at, and the page of text that shows it."""

from __future__ import annotations

import json
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.attention import attention
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.glance import level as level_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.look import Look, status_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.page import status_page
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import Ended, Host, Promise, Status, Trouble
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.text import status_text
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._report.a_fleet import (
    SOURCES,
    fleet_status,
    pod,
    workload,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._report.html_check import Page


def test_the_graph() -> None:
    status = fleet_status(SOURCES)
    assert [(row.name, row.reachable, row.error) for row in status.ros_nodes] == [
        ("/ghost", False, "connection refused"),
        ("/sensor", True, ""),
    ]
    assert [(row.name, row.rate, row.publishers, row.connections) for row in status.topics] == [
        ("/idle", None, 0, 0),
        ("/temperature", 499.83, 1, 1),
    ]


def test_a_process_of_a_launch_file_that_crashed_stands_beside_its_app() -> None:
    died = {"node": "/lidar", "host": "10.42.0.7", "alive": False, "exit_code": 3, "crash": "ended with exit code 3"}
    sources = {
        "deployments": [workload("base")],
        "pods": [pod("base", "robot1")],
        "graphs": {"robot1": {"launched": [died, {**died, "node": "/map", "exit_code": None, "crash": ""}]}},
    }
    status = fleet_status(sources)
    todo = "k3s kubectl -n robot-robot1 logs deploy/base"
    problem = Trouble("app base of robot1", "/lidar ended with exit code 3", todo)
    assert (status.problems, status.ended) == ((problem,), (Ended("robot1", "base", "/map", "10.42.0.7"),))
    text = status_text(status)
    assert text.index("PROBLEMS") == 0 and f"{problem.where} {problem.what}" in " ".join(text.split())
    title, headers, row = text.partition("ENDED")[2].splitlines()[:3]
    assert (title, headers.split()) == (" IN LAUNCH FILES", ["robot", "app", "node", "host"])
    assert row.split() == ["robot1", "base", "/map", "10.42.0.7"]
    assert problem.what in status_page(status, "2026-11-21T09:07:52Z")


def promise(least: float) -> dict[str, Any]:
    return {"robot1": {"/imu": Promise(least, "bringup", "robot1")}}


@pytest.mark.parametrize(
    ("rate", "least", "level", "cell"),
    [
        (87.0, 90, "warn", "90 Hz not kept"),
        (17.9, 18, "ok", "18 Hz"),  # which a window of some seconds cannot tell apart, as at an update
        (17.8, 18, "warn", "18 Hz not kept"),
        (90.0, 90, "ok", "90 Hz"),
        (None, 90, "ok", "90 Hz"),  # nobody listens, so nobody counts
    ],
)
def test_rates_are_held_against_what_was_promised(rate: float | None, least: float, level: str, cell: str) -> None:
    topic = {"type": "sensor_msgs/Imu", "publishers": ["/imu"], "subscribers": [], "connections": [], "rate": rate}
    sources = {
        "deployments": [workload("bringup")],
        "pods": [pod("bringup", "robot1")],
        "graphs": {"robot1": {"topics": {"/imu": topic, "/free": topic}}},
        "promised": promise(least),
    }
    status = fleet_status(sources)
    free, imu = status.topics
    assert (level_of(free), level_of(imu)) == ("", level)
    assert cell in status_text(status).partition("TOPICS")[2]
    found = [(one.told.where, one.told.what) for one in attention(status)]
    told = ("topic /imu of robot1", f"{rate} Hz; bringup promises at least {least} Hz")
    assert found == ([told] if level == "warn" else [])
    assert ("tr", {"role": "row", "class": "warn"}) not in Page(status_page(status, "")).attributes or level == "warn"


def test_a_promised_topic_that_nobody_publishes() -> None:
    """Only of an app that is there: what the inventory has new is no fault of the robot."""
    sources: dict[str, Any] = {"graphs": {"robot1": {}}, "promised": promise(90)}
    assert fleet_status(sources).topics == ()
    status = fleet_status({**sources, "deployments": [workload("bringup")]})
    assert [level_of(row) for row in status.topics] == ["bad"]
    assert [one.told.what for one in attention(status)] == ["nobody publishes it; bringup promises at least 90 Hz"]
    down = fleet_status({**sources, "deployments": [workload("bringup", ready=0)]})
    assert [(one.told.where, one.takes) for one in attention(down)] == [("app bringup of robot1", ["topic /imu"])]


def test_nothing_found() -> None:
    assert status_of(Look(Status()), {}, {}) == fleet_status({}) == Status()
    text = status_text(Status())
    assert text.count("  none") == 8 and "HOSTS\n  none\n" in text and "LAST" not in text and "ENDED" not in text


def test_what_is_handed_on_between_the_tasks_is_the_same_afterwards() -> None:
    sources = {**SOURCES, "promised": promise(5)}
    look = Look(fleet_status(sources), promised=sources["promised"], name="demo")
    assert Look.from_dict(json.loads(json.dumps(look.as_dict()))) == look
    assert Look.from_dict({"graphs": {}, "hosts": [{"name": "a"}]}).status == Status(hosts=(Host("a"),))


PAGE = """\
HOSTS
  host    group   address    role    cluster  state
  edge1   edge    10.0.0.11  server  edge     up
  robot2  robots  -          agent   edge     offline timed out

NODES
  node    state                version       address    roles          deploymentType  robot   other labels
  edge1   Ready                v1.34.2+k3s1  10.0.0.11  control-plane  remote          -       zone=a
  robot1  NotReady, NoKubelet  v1.34.2+k3s1  10.0.0.11  -              local           robot1  -

PLACEMENT
  node    deploymentType  runs
  edge1   remote          robot1/stats
  robot1  local           robot1/ros-master, robot1/temperature-sensor

ROS MASTERS
  robot   ready  node    restarts  image
  robot1  1/1    robot1  0         lab/apps:1.0

APPS
  robot   app                 placement  ready  node    restarts  image         note
  robot1  stats               remote     0/1    edge1   0         lab/apps:1.0  ImagePullBackOff: image lab/..
  robot1  temperature-sensor  local      1/1    robot1  2         lab/apps:1.0  -

ROS NODES
  robot   node     on  state                     publishes  subscribes  services
  robot1  /ghost   -   down: connection refused  0          0           0
  robot1  /sensor  -   up                        2          0           1

ROS GRAPHS
  robot   topic         action  from     to
  robot1  /temperature  no      /sensor  /stats

TOPICS
  robot   topic         type             publishers  subscribers  connections  rate    note
  robot1  /idle         std_msgs/String  0           0            0            -       no publisher answers
  robot1  /temperature  demo/Sample      1           1            1            500 Hz  -

CLAIMS
  robot   claim     state  class       size  used
  robot1  logs-pvc  Bound  local-path  1Gi   5.1 MiB
"""


def test_the_page() -> None:
    assert status_text(fleet_status(SOURCES), width=110) == PAGE


@pytest.mark.parametrize("width", [80, 100, 120])
def test_the_page_fits(width: int) -> None:
    assert max(map(len, status_text(fleet_status(SOURCES), width).splitlines())) <= width
