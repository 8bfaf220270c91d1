# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of raw objects, graphs and reports, and the page of text that they make."""

from __future__ import annotations

import json
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import Object
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.attention import attention
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.glance import counts
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.glance import level as level_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.page import status_page
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import cluster_rows, nodes_off, status_rows
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.text import size_words, status_text
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._report.html_check import Page

NOW = 1_795_536_750.0  # 2026-11-24T16:12:30Z


def node(name: str, ready: str = "True", **labels: str) -> Object:
    return {
        "metadata": {
            "name": name,
            "labels": {
                "kubernetes.io/hostname": name,
                "beta.kubernetes.io/os": "linux",
                "node.kubernetes.io/instance-type": "k3s",
                "deploymentType": "local" if name.startswith("robot") else "remote",
                **({"rosops.fleet/robot": name} if name.startswith("robot") else {}),
                **labels,
            },
        },
        "spec": {},
        "status": {
            "conditions": [
                {"type": "Ready", "status": ready, "reason": "KubeletReady" if ready == "True" else "NoKubelet"}
            ],
            "addresses": [{"type": "Hostname", "address": name}, {"type": "InternalIP", "address": "10.0.0.11"}],
            "nodeInfo": {"kubeletVersion": "v1.34.2+k3s1"},
        },
    }


def workload(name: str, ready: int = 1, remote: bool = False, manager: str = "rosops.fleet") -> Object:
    robot = "robot1"
    where = {"deploymentType": "remote"} if remote else {"rosops.fleet/robot": robot}
    own = {"app.kubernetes.io/managed-by": manager, "rosops.fleet/app": name, "rosops.fleet/robot": robot}
    pod_spec = {"nodeSelector": where, "containers": [{"name": "ros-app", "image": "lab/apps:1.0"}]}
    return {
        "metadata": {"name": name, "namespace": f"robot-{robot}", "labels": own},
        "spec": {"replicas": 1, "template": {"spec": pod_spec}},
        "status": {"readyReplicas": ready},
    }


def pod(app: str, node_name: str, robot: str = "robot1", ready: bool = True, restarts: int = 0) -> Object:
    waiting = {"waiting": {"reason": "ImagePullBackOff", "message": "no such image"}}
    container = {"name": "ros-app", "image": "lab/apps:1.0", "restartCount": restarts}
    return {
        "metadata": {"name": f"{app}-1", "namespace": f"robot-{robot}", "labels": {"rosops.fleet/app": app}},
        "spec": {"nodeName": node_name},
        "status": {
            **({"podIP": "10.42.0.7"} if ready else {}),
            "conditions": [{"type": "Ready", "status": "True" if ready else "False"}],
            "containerStatuses": [{**container, "state": {"running": {}} if ready else waiting}],
        },
    }


def claim(phase: str = "Bound") -> Object:
    return {
        "metadata": {"name": "logs-pvc", "namespace": "robot-robot1", "labels": {"rosops.fleet/robot": "robot1"}},
        "spec": {"storageClassName": "local-path", "resources": {"requests": {"storage": "100Mi"}}},
        "status": {"phase": phase, "capacity": {"storage": "1Gi"}} if phase == "Bound" else {},
    }


GRAPH = {
    "nodes": {
        "/sensor": {
            "pid": 1,
            "reachable": True,
            "publications": ["/temperature", "/rosout"],
            "subscriptions": [],
            "services": ["/s"],
        },
        "/ghost": {"reachable": False, "error": "connection refused"},
    },
    "topics": {
        "/temperature": {
            "type": "demo/Sample",
            "publishers": ["/sensor"],
            "subscribers": ["/stats"],
            "connections": [{"publisher": "/sensor", "subscriber": "/stats"}],
            "rate": 499.83,
        },
        "/rosout": {"type": "rosgraph_msgs/Log"},
        "/idle": {"type": "std_msgs/String", "rate": None, "rate_error": "no publisher answers"},
    },
}
CHOSEN = {"node-role.kubernetes.io/control-plane": "true", "zone": "a"}
HOSTS = [
    {"name": "edge1", "group": "edge", "address": "10.0.0.11", "role": "server", "cluster": "edge", "reachable": True},
    {
        "name": "robot2",
        "group": "robots",
        "role": "agent",
        "cluster": "edge",
        "reachable": False,
        "reason": "timed out",
    },
]
SOURCES: dict[str, Any] = {
    "hosts": HOSTS,
    "nodes": [
        node("robot1", "Unknown"),
        node("edge1", **{"node-role.kubernetes.io/control-plane": "true", "zone": "a"}),
    ],
    "deployments": [
        workload("temperature-sensor"),
        workload("stats", remote=True, ready=0),
        workload("ros-master"),
        workload("not-ours", manager="helm"),
    ],
    "pods": [
        pod("temperature-sensor", "robot1", restarts=2),
        pod("stats", "edge1", ready=False),
        pod("ros-master", "robot1"),
        pod("stats", "edge9", robot="robot9"),
    ],
    "claims": [claim()],
    "graphs": {"robot1": GRAPH},
    "usage": {"robot-robot1/logs-pvc": 5_345_678},
}


def fleet_status(sources: dict[str, Any]) -> dict[str, list[dict[str, Any]]]:
    kinds = {
        "Node": "nodes", "Deployment": "deployments", "Pod": "pods", "PersistentVolumeClaim": "claims",
        "StorageClass": "classes",
    }  # fmt: skip
    found = {kind: sources[key] for kind, key in kinds.items() if key in sources}
    fleet = {"hosts": sources.get("hosts", []), **cluster_rows([found], sources.get("usage", {}), NOW)}
    return status_rows(fleet, sources.get("graphs", {}), {}, sources.get("promised", {}))


def test_nodes() -> None:
    assert fleet_status(SOURCES)["nodes"] == [
        {
            "name": "edge1",
            "ready": True,
            "reason": "",
            "since": "",
            "version": "v1.34.2+k3s1",
            "address": "10.0.0.11",
            "roles": ["control-plane"],
            "placement": "remote",
            "robot": "",
            "labels": {"zone": "a"},
        },
        {
            "name": "robot1",
            "ready": False,
            "reason": "NoKubelet",
            "since": "",
            "version": "v1.34.2+k3s1",
            "address": "10.0.0.11",
            "roles": [],
            "placement": "local",
            "robot": "robot1",
            "labels": {},
        },
    ]


def test_masters_and_apps() -> None:
    status = fleet_status(SOURCES)
    assert [row["name"] for row in status["masters"]] == ["ros-master"]
    stats, sensor = status["apps"]
    assert sensor == {
        "name": "temperature-sensor",
        "namespace": "robot-robot1",
        "robot": "robot1",
        "placement": "local",
        "ready": 1,
        "wanted": 1,
        "nodes": ["robot1"],
        "addresses": ["10.42.0.7"],
        "images": ["lab/apps:1.0"],
        "restarts": 2,
        "ended": "",
        "ended_at": "",
        "since": "",
        "note": "",
    }
    assert (stats["placement"], stats["ready"], stats["nodes"]) == ("remote", 0, ["edge1"])
    assert stats["note"] == "ImagePullBackOff: image lab/apps:1.0: no such image"


def test_a_version_that_the_keeper_took_back() -> None:
    told = {"from": "rev2", "to": "rev1", "at": "2026-11-22T06:01:40.123456Z", "reason": "not ready 120 s"}
    there = workload("sensor")
    there["metadata"].setdefault("annotations", {})["rosops.fleet/went-back"] = json.dumps(told)
    status = fleet_status({"deployments": [there, workload("other")]})
    assert status["went_back"] == [{"name": "sensor", "namespace": "robot-robot1", "robot": "robot1", **told}]
    title, headers, row = status_text(status).partition("TAKEN BACK")[2].splitlines()[:3]
    assert title == " BY THE KEEPER"
    assert headers.split() == ["robot", "app", "from", "to", "at", "reason"]
    assert row.split() == ["robot1", "sensor", "rev2", "rev1", told["at"], "not", "ready", "120", "s"]
    assert "TAKEN BACK" not in status_text(fleet_status({"deployments": [workload("other")]}))


def test_since_when_something_is_not_ready() -> None:
    """By the Deployment's word, which outlives its pods; else by the pod's. What is ready has no such time."""
    lost, later = "2026-11-24T16:00:00Z", "2026-11-24T16:05:00Z"
    there, down = workload("stats", ready=0), pod("stats", "robot1", ready=False)
    down["status"]["conditions"] = [{"type": "Ready", "status": "False", "lastTransitionTime": later}]
    off = node("robot1", "Unknown")
    off["status"]["conditions"][0]["lastTransitionTime"] = lost

    def since(*conditions: dict[str, str]) -> str:
        there["status"]["conditions"] = list(conditions)
        found = fleet_status({"deployments": [there], "pods": [down], "nodes": [off]})
        assert found["nodes"][0]["since"] == lost
        return str(found["apps"][0]["since"])

    assert since({"type": "Available", "status": "False", "lastTransitionTime": lost}) == lost
    assert since({"type": "Available", "status": "True", "lastTransitionTime": lost}) == later
    assert since() == later
    waits = {**claim("Pending")}
    waits["metadata"]["creationTimestamp"] = lost
    assert fleet_status({"claims": [waits]})["claims"][0]["since"] == lost


def test_what_runs_where() -> None:
    assert fleet_status(SOURCES)["placement"] == [
        {"node": "edge1", "placement": "remote", "runs": ["robot1/stats"]},
        {"node": "robot1", "placement": "local", "runs": ["robot1/ros-master", "robot1/temperature-sensor"]},
    ]


def test_an_app_of_the_whole_fleet() -> None:
    shared = workload("map-server", remote=True)
    del shared["metadata"]["labels"]["rosops.fleet/robot"]
    assert fleet_status({"deployments": [shared]})["apps"][0]["robot"] == "(shared)"


def test_the_graph() -> None:
    status = fleet_status(SOURCES)
    assert [(row["name"], row["reachable"], row["error"]) for row in status["ros_nodes"]] == [
        ("/ghost", False, "connection refused"),
        ("/sensor", True, ""),
    ]
    assert [(row["name"], row["rate"], row["publishers"], row["connections"]) for row in status["topics"]] == [
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
    problem = {"where": "app base of robot1", "what": "/lidar ended with exit code 3", "todo": todo}
    assert status["problems"] == [problem]
    text = status_text(status)
    assert f"{problem['where']} {problem['what']}" in " ".join(text.split())
    assert text.index("PROBLEMS") == 0
    assert status["ended"] == [{"robot": "robot1", "app": "base", "node": "/map", "host": "10.42.0.7"}]
    title, headers, row = text.partition("ENDED")[2].splitlines()[:3]
    assert (title, headers.split()) == (" IN LAUNCH FILES", ["robot", "app", "node", "host"])
    assert row.split() == ["robot1", "base", "/map", "10.42.0.7"]
    assert "ENDED" not in status_text(fleet_status({**sources, "graphs": {}}))
    assert problem["what"] in status_page(status, "2026-11-21T09:07:52Z")


def test_claims() -> None:
    bound = fleet_status(SOURCES)["claims"][0]
    assert (bound["bound"], bound["size"], bound["used_bytes"]) == (True, "1Gi", 5_345_678)
    pending = fleet_status({"claims": [claim("Pending")]})["claims"][0]
    assert (pending["bound"], pending["phase"], pending["size"], pending["used_bytes"]) == (
        False,
        "Pending",
        "100Mi",
        None,
    )


def mounts(name: str, **more: Any) -> Object:
    there = workload(name)
    there["spec"]["template"]["spec"]["volumes"] = [{"persistentVolumeClaim": {"claimName": "logs-pvc"}}]
    return {**there, **more}


@pytest.mark.parametrize(
    ("mode", "apps", "unused", "note"),
    [
        ("WaitForFirstConsumer", [workload("other")], True, "waits for its first consumer, and none "),
        ("WaitForFirstConsumer", [mounts("rosbag")], False, "waits for the pod of Deployment rosbag"),
        ("Immediate", [workload("other")], False, "Pending: no volume is bound yet"),
    ],
)
def test_a_claim_that_nobody_mounts_is_in_order(mode: str, apps: list[Object], unused: bool, note: str) -> None:
    """As a run's own wait has it, which ends there."""
    classes = [{"metadata": {"name": "local-path"}, "volumeBindingMode": mode}]
    status = fleet_status({"claims": [claim("Pending")], "classes": classes, "deployments": apps})
    [row] = status["claims"]
    assert row["unused"] is unused and row["note"].startswith(note)
    about = [one.told.what for one in attention(status) if one.section == "claims"]
    assert about == ([] if unused else [row["note"]])


def ended(app: str, at: str, restarts: int = 2, code: int = 1, sandbox: str = "2026-11-24T10:00:00Z") -> Object:
    found = pod(app, "robot1", restarts=restarts)
    last = {"exitCode": code, "reason": "Error", "finishedAt": at}
    found["status"]["containerStatuses"][0]["lastState"] = {"terminated": last}
    made = {"type": "PodReadyToStartContainers", "status": "True", "lastTransitionTime": sandbox}
    found["status"]["conditions"].append(made)
    return found


def test_a_container_that_ended_lately_needs_attention() -> None:
    """Ready, and down every 20 s: nothing else would say so."""
    lately = "2026-11-24T16:12:10Z"
    status = fleet_status({"deployments": [workload("bringup")], "pods": [ended("bringup", lately)]})
    [row] = status["apps"]
    assert (row["ready"], row["restarts"], row["ended_at"]) == (1, 2, lately)
    [told] = [one.told for one in attention(status)]
    assert (told.where, told.since) == ("bringup of robot1", lately)
    assert told.what == "container ros-app restarted 2 times, last: exit code 1 (Error)"
    assert told.todo == "k3s kubectl -n robot-robot1 logs deploy/bringup --previous"


@pytest.mark.parametrize(
    ("at", "restarts", "sandbox"),
    [
        ("2026-11-24T16:02:29Z", 2, "2026-11-24T10:00:00Z"),  # long ago
        ("2026-11-24T16:12:10Z", 0, "2026-11-24T10:00:00Z"),  # of another container of the same name
        ("2026-11-24T16:12:10Z", 1, "2026-11-24T16:12:20Z"),  # with its host
    ],
)
def test_an_end_that_is_no_news(at: str, restarts: int, sandbox: str) -> None:
    there = ended("bringup", at, restarts, 255, sandbox)
    status = fleet_status({"deployments": [workload("bringup")], "pods": [there]})
    assert (status["apps"][0]["ended"], attention(status)) == ("", [])


def test_what_ended_lately_and_is_not_ready_is_one_finding() -> None:
    there = ended("bringup", "2026-11-24T16:12:10Z")
    there["status"]["conditions"][0]["status"] = "False"
    status = fleet_status({"deployments": [workload("bringup", ready=0)], "pods": [there]})
    [told] = [one.told for one in attention(status)]
    assert told.what.startswith("0 of 1 ready") and told.what.endswith("2 times, last: exit code 1 (Error)")
    assert told.todo == "k3s kubectl -n robot-robot1 logs deploy/bringup --previous"


def promise(least: float, app: str = "bringup") -> dict[str, Any]:
    return {"min_rate": least, "app": app, "robot": "robot1"}


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
        "graphs": {"robot1": {"topics": {"/imu/data": topic, "/free": topic}}},
        "promised": {"robot1": {"/imu/data": promise(least)}},
    }
    status = fleet_status(sources)
    free, imu = status["topics"]
    assert (level_of("topics", free), level_of("topics", imu)) == ("", level)
    assert cell in status_text(status).partition("TOPICS")[2]
    found = [(one.told.where, one.told.what) for one in attention(status)]
    told = ("topic /imu/data of robot1", f"{rate} Hz; bringup promises at least {least} Hz")
    assert found == ([told] if level == "warn" else [])
    assert ("tr", {"role": "row", "class": "warn"}) not in Page(status_page(status, "")).attributes or level == "warn"


def test_a_promised_topic_that_nobody_publishes() -> None:
    """Only of an app that is there: what the inventory has new is no fault of the robot."""
    sources: dict[str, Any] = {"graphs": {"robot1": {}}, "promised": {"robot1": {"/imu": promise(90)}}}
    assert fleet_status(sources)["topics"] == []
    status = fleet_status({**sources, "deployments": [workload("bringup")]})
    [row] = status["topics"]
    assert level_of("topics", row) == "bad"
    assert [one.told.what for one in attention(status)] == ["nobody publishes it; bringup promises at least 90 Hz"]
    down = fleet_status({**sources, "deployments": [workload("bringup", ready=0)]})
    assert [(one.told.where, one.takes) for one in attention(down)] == [("app bringup of robot1", ["topic /imu"])]


def test_what_stands_beside_a_master_is_no_app() -> None:
    names = ("ros-master", "ros-keeper", "ros-exporter", "sensor")
    status = fleet_status({"hosts": HOSTS, "deployments": [workload(name) for name in names]})
    assert [row["name"] for row in status["apps"]] == ["sensor"]
    assert [row["name"] for row in status["helpers"]] == ["ros-exporter", "ros-keeper"]
    told = {count.label: count.words for count in counts(status)}
    assert (told["Apps"], told["Helpers"]) == ("1 of 1 ready", "2 of 2 ready")
    assert "HELPERS\n  robot   helper" in status_text(status)


def test_nothing_found() -> None:
    assert all(rows == [] for rows in fleet_status({}).values())
    assert status_rows({}, {}, {}) == fleet_status({})
    assert status_text(fleet_status({})).count("  none") == 8


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


def test_a_missing_section_is_left_out() -> None:
    assert status_text({"hosts": []}) == "HOSTS\n  none\n"
    assert status_text({}) == ""


@pytest.mark.parametrize(
    ("count", "words"), [(None, ""), (0, "0 B"), (1023, "1023 B"), (1536, "1.5 KiB"), (3 * 2**40, "3072.0 GiB")]
)
def test_sizes(count: int | None, words: str) -> None:
    assert size_words(count) == words


def test_a_node_is_off_unless_it_says_that_it_is_ready() -> None:
    def said(name: str, *conditions: tuple[str, str]) -> Object:
        status = {"conditions": [{"type": kind, "status": status} for kind, status in conditions]}
        return {"metadata": {"name": name}, "status": status}

    nodes = [
        said("on", ("DiskPressure", "False"), ("Ready", "True")),
        said("away", ("Ready", "Unknown")),
        said("broken", ("DiskPressure", "True"), ("Ready", "False")),
        said("new"),
    ]
    assert nodes_off(nodes) == ["away", "broken", "new"]
    assert nodes_off([]) == []


# --- reports --------------------------------------------------------------------------------------------------------

STEP = {
    "id": "0123456789ab",
    "name": "temperature",
    "apps": ["temperature"],
    "handoff": "overlap",
    "from": {"temperature": {"image": "lab/apps:1.0", "revision": "1793ed6c"}},
    "to": {"temperature": {"image": "lab/apps:1.1", "revision": "3f0e725c"}},
    "phases": {"gate": 1.0, "apply": 7.5},
    "busy_wait": 0,
    "outcome": "updated",
    "reason": "",
}


def host(name: str, outcome: str = "updated", *steps: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"host": name, "outcome": outcome, "reason": "", "changed": ["a"], "steps": list(steps), **more}


def report(playbook: str, started: str, *hosts: dict[str, Any], check_mode: bool = False) -> str:
    return json.dumps({"playbook": playbook, "check_mode": check_mode, "started": started, "hosts": list(hosts)})


def status(**reports: str) -> dict[str, list[dict[str, Any]]]:
    return status_rows({}, {}, reports)


def test_each_hosts_newest_run_counts() -> None:
    found = status(
        a=report("update.yml", "2026-01-02T00:00:00Z", host("robot1", "rolled-back", reason="half\nthe rate\nmore")),
        b=report("site.yml", "2026-01-01T00:00:00Z", host("robot1"), host("robot2", "failed", failed_task="Apply")),
    )
    assert [(row["host"], row["outcome"], row["playbook"], row["note"]) for row in found["outcomes"]] == [
        ("robot1", "rolled-back", "update.yml", "half the rate"),
        ("robot2", "failed", "site.yml", "(task: Apply)"),
    ]
    assert found["problems"] == []


@pytest.mark.parametrize(
    ("playbook", "check_mode"), [("status.yml", False), ("validate.yml", False), ("site.yml", True)]
)
def test_a_run_that_only_looked_hides_nothing(playbook: str, check_mode: bool) -> None:
    found = status(
        a=report("update.yml", "2026-01-01T00:00:00Z", host("robot1", "updated", STEP)),
        b=report(playbook, "2026-01-02T00:00:00Z", host("robot1", "unchanged"), check_mode=check_mode),
    )
    assert [(row["outcome"], row["playbook"]) for row in found["outcomes"]] == [("updated", "update.yml")]


def test_the_steps_of_the_last_update_stay_when_later_runs_had_none() -> None:
    found = status(
        a=report("update.yml", "2026-01-01T00:00:00Z", host("robot1", "updated", STEP)),
        b=report("update.yml", "2026-01-02T00:00:00Z", host("robot1", "unchanged")),
    )
    assert [row["outcome"] for row in found["outcomes"]] == ["unchanged"]
    assert found["steps"] == [
        {
            "robot": "robot1",
            "id": "0123456789ab",
            "name": "temperature",
            "handoff": "overlap",
            "outcome": "updated",
            "from": ["lab/apps:1.0 (1793ed6c)"],
            "to": ["lab/apps:1.1 (3f0e725c)"],
            "seconds": 8.5,
            "busy_wait": 0.0,
            "phases": {"gate": 1.0, "apply": 7.5},
            "note": "",
        }
    ]


@pytest.mark.parametrize(
    "text", ["", "no JSON", "[]", "{}", '{"hosts": [1], "check_mode": false, "playbook": "a"}', "1"]
)
def test_a_spoilt_report_is_said_and_hides_no_other(text: str) -> None:
    good = report("update.yml", "2026-01-01T00:00:00Z", host("robot1", "updated", STEP))
    found = status(**{"fleet-report.json": text, "good": good})
    assert [row["where"] for row in found["problems"]] == ["fleet-report.json"]
    assert [row["host"] for row in found["outcomes"]] == ["robot1"]


@pytest.mark.parametrize("steps", [[1], [{"phases": {"a": "b"}}], ["a"], 7])
def test_steps_of_another_shape_are_a_spoilt_report(steps: Any) -> None:
    odd = {**host("robot1"), "steps": steps}
    found = status(a=report("update.yml", "2026-01-01T00:00:00Z", odd))
    assert [row["where"] for row in found["problems"]] == ["a"]


def test_on_the_page_of_text() -> None:
    good = report("update.yml", "2026-01-01T00:00:00Z", host("robot1", "updated", STEP))
    page = status_text(status(a=good, b=""))
    assert page.startswith("PROBLEMS\n  where  what\n  b      not a report of fleet_report")
    assert "LAST OUTCOMES\n  host    outcome  run         started               changed\n  robot1  updated" in page
    assert "robot1  temperature  overlap  updated  lab/apps:1.0 (1793ed6c)  lab/apps:1.1 (3f0e725c)  8.5" in page


def test_without_a_report_the_page_of_text_has_no_such_sections() -> None:
    assert "LAST" not in status_text(status_rows({"hosts": [{"name": "robot1"}]}, {}, {}))
