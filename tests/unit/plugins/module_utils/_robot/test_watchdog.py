# SPDX-License-Identifier: GPL-3.0-or-later
"""A pod of which a node hangs: which those are, and how the keeper begins one anew beside its other work."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._robot.cluster_api import ApiError
from ansible_collections.rosops.fleet.plugins.module_utils._robot.memory import Silence
from ansible_collections.rosops.fleet.plugins.module_utils._robot.step_watch import LOOK
from ansible_collections.rosops.fleet.plugins.module_utils._robot.watchdog import hung_pods
from ansible_collections.rosops.fleet.plugins.module_utils._step.words import LIVENESS, LIVENESS_TIMEOUT
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_deployment
from ansible_collections.rosops.fleet.tests.unit.plugins.module_utils._robot.steps_left import NAMESPACE, lease
from ansible_collections.rosops.fleet.tests.unit.plugins.module_utils._robot.test_step_watch import (
    ACTIVE,
    SUCCEEDED,
    World,
    busy,
)
from ansible_collections.rosops.fleet.tests.unit.robots import robot

HOST, OTHER_HOST = "192.0.2.11", "192.0.2.12"
ADDRESSES = {"camera": "10.42.0.1", "arm": "10.42.0.2", "laptop": "10.0.0.7", "ros-keeper": "10.42.0.9"}
URI = f"http://{ADDRESSES['camera']}:4711/"


def pod(name: str, address: str = "", *, ready: bool = True, host: str = HOST, **notes: str) -> dict[str, Any]:
    """With the host's address it has the host's network."""
    metadata = {
        "name": f"{name}-x",
        "uid": f"uid of {name}",
        "labels": {"rosops.fleet/app": name},
        "annotations": {"rosops.fleet/ros-node": f"/{name}", **notes},
    }
    conditions = [{"type": "Ready", "status": "True" if ready else "False"}]
    status = {"podIP": address or ADDRESSES[name], "hostIP": host, "conditions": conditions}
    return {"metadata": metadata, "spec": {"hostNetwork": address == host}, "status": status}


def silence(*answering: str, **silent: float) -> Silence:
    """A node is called as its pod's app, and is at the pod's address."""
    found = {f"/{name}": (f"http://{ADDRESSES[name]}:4711/", seconds) for name, seconds in silent.items()}
    return Silence(found, frozenset(f"http://{ADDRESSES[name]}:4712/" for name in answering))


CAMERA, ARM, KEEPER = pod("camera"), pod("arm"), pod("ros-keeper")
GOING = {**CAMERA, "metadata": {**CAMERA["metadata"], "deletionTimestamp": "now"}}
NOBODYS = {**CAMERA, "metadata": {**CAMERA["metadata"], "labels": {}}}
LONE, ALL = silence(camera=500), silence(camera=500, arm=600)


@pytest.mark.parametrize(
    ("pods", "known", "hung"),
    [
        ([CAMERA, ARM], silence("arm", camera=LIVENESS_TIMEOUT - 1), []),
        ([CAMERA, ARM], silence("arm", camera=LIVENESS_TIMEOUT), ["camera"]),
        ([CAMERA, ARM], silence("arm"), []),
        # nobody of a host that is away answers; the keeper, where it is on that host, is somebody who does
        ([CAMERA, ARM], ALL, []),
        ([CAMERA, ARM, KEEPER], ALL, ["arm", "camera"]),
        ([CAMERA, ARM, pod("ros-keeper", host=OTHER_HOST)], ALL, []),
        ([CAMERA, pod("arm", host=OTHER_HOST)], silence("arm", camera=500), []),
        # its host may be away, and it may still be at its start
        ([pod("camera", ready=False), KEEPER], LONE, []),
        *(([pod("camera", **{LIVENESS: said}), KEEPER], LONE, []) for said in ("0", "501", "soon")),
        # what is no app's, or ends already
        *(([one, KEEPER], LONE, []) for one in (GOING, NOBODYS)),
        *(([pod(name, ADDRESSES["camera"]), KEEPER], LONE, []) for name in ("ros-master", "ros-keeper")),
        ([KEEPER], silence(laptop=5000), []),
        # with the host's network the address is everybody's: only the node counts that the pod is known by
        (
            [pod("camera", HOST), pod("arm", HOST)],
            Silence({"/camera": (f"http://{HOST}:1/", 500.0)}, frozenset({f"http://{HOST}:2/"})),
            ["camera"],
        ),
    ],
)
def test_which_pods_hang(pods: list[dict[str, Any]], known: Silence, hung: list[str]) -> None:
    assert [one.app for one in hung_pods(pods, known)] == hung


def test_of_several_nodes_in_a_pod_the_longest_silent_counts() -> None:
    nodes = {"/base": (URI, 130.0), "/lidar": (URI, 150.0), "/x": ("http://[", 900.0)}
    (found,) = hung_pods([CAMERA, KEEPER], Silence(nodes))
    assert (found.node, found.seconds, found.timeout) == ("/lidar", 150.0, LIVENESS_TIMEOUT)


def test_a_pod_says_what_is_not_the_usual() -> None:
    """The keeper knows the usual timeout by itself."""

    def notes(**options: Any) -> dict[str, str]:
        of = robot({"name": "camera", "image": "x/camera:1", "command": ["run"], **options})
        return dict(app_deployment(of.apps[0], of)["spec"]["template"]["metadata"]["annotations"])

    assert LIVENESS not in notes()
    assert notes(liveness_timeout=0)[LIVENESS] == "0"
    assert notes(liveness_timeout=30)[LIVENESS] == "30"


# ---- what is done


LEFT = f"{NAMESPACE}/camera: node /camera does not answer, and its pod is left as it is: "
WORDS = "node /camera has not answered for 500 s while its process lives"
EVICTED = [
    "lease ros-keeper",
    f"evict {NAMESPACE}/camera-x in 10 s",
    f"NodeHung {NAMESPACE}/camera-x: {WORDS}",
    "lease free",
]


def hanging(seconds: float = 500.0) -> World:
    """A robot at rest, one node of which does not answer."""
    world = World()
    world.leases_now[NAMESPACE] = lease("", 3)
    world.pods_now = [pod("camera"), KEEPER]
    world.uris["/camera"] = URI
    world.silence = Silence({"/camera": (URI, seconds)})
    return world


def test_a_laptop_that_sleeps_costs_one_request() -> None:
    world = hanging()
    laptop = Silence({"/rviz": (f"http://{ADDRESSES['laptop']}:1/", 9000.0)})
    world.silence = laptop
    world.run(10 * LOOK)
    assert (world.requests.count("pods"), world.done) == (1, [])
    world.silence = Silence({**laptop.silent, "/camera": (URI, 29.0)})  # nobody may say so short a time
    world.run(LOOK)
    assert world.requests.count("pods") == 1
    world.silence = Silence({**laptop.silent, "/camera": (URI, 500.0)})
    world.run(LOOK)
    assert world.done == EVICTED


@pytest.mark.parametrize(("request_", "said"), [("lease", []), ("write_lease", ["somebody else changes it now"])])
def test_a_lease_that_is_taken_just_then_is_the_other_ones(request_: str, said: list[str]) -> None:
    world = hanging()
    world.before(request_, lambda *_: world.take())
    world.run(LOOK)
    assert world.done == []
    assert world.said == [LEFT + words for words in said]


def planning(world: World, *states: int, pod_of: str = "camera") -> World:
    """Another node, in that pod or elsewhere, with goals in these states."""
    world.uris["/planner"] = f"http://{ADDRESSES[pod_of]}:4712/"
    world.serve("/plan", "/planner")
    world.goals["/planner"] = busy(*states)
    return world


def test_not_during_a_goal() -> None:
    """Of another node in that pod, or of the node itself."""
    world = planning(hanging(seconds=5000.0), ACTIVE)
    world.run(10 * LOOK)
    assert world.done == []
    assert world.said == [LEFT + "/plan ACTIVE"]
    world.goals["/planner"] = busy(SUCCEEDED)
    world.run(LOOK)
    assert world.done[1] == f"evict {NAMESPACE}/camera-x in its own time"  # a goal that begins now may end


@pytest.mark.parametrize(
    ("happens", "said"),
    [
        (lambda world: world.goals.update({"/planner": busy(ACTIVE)}), LEFT + "/plan ACTIVE"),
        (lambda world: world.answering.add("/camera"), f"{NAMESPACE}/camera: node /camera answers again"),
    ],
)
def test_what_comes_while_the_lease_is_taken_keeps_the_pod(happens: Callable[[World], None], said: str) -> None:
    world = planning(hanging())
    world.before("write_lease", lambda *_: happens(world))
    world.run(LOOK)
    assert (world.done, world.said) == (["lease ros-keeper", "lease free"], [said])


def test_goals_elsewhere_are_no_reason() -> None:
    world = planning(hanging(), ACTIVE, pod_of="arm")
    world.run(LOOK)
    assert world.done == EVICTED
    assert world.said == [f"{NAMESPACE}/camera: {WORDS}: its pod camera-x is begun anew"]


def test_goals_that_nobody_can_read_are_waited_for_five_times_as_long() -> None:
    """A server that computes for two minutes and answers nobody may be at work."""
    world = hanging(seconds=599.0)
    world.serve("/capture", "/camera")
    world.run(LOOK)
    assert world.done == []
    assert world.said[-1].endswith("/capture of /camera (mute)")
    world.silence = Silence({"/camera": (URI, 600.0)})
    world.run(LOOK)
    assert world.done[1] == f"evict {NAMESPACE}/camera-x in 10 s"


def test_a_server_with_the_hosts_network_is_known_by_its_name() -> None:
    world = hanging()
    for item in world.pods_now:
        item["spec"] = {"hostNetwork": True}
    world.serve("/capture", "/camera")
    world.goals["/camera"] = busy(ACTIVE)
    world.run(LOOK)
    assert world.done == []


def test_three_times_an_hour_at_most() -> None:
    world = hanging()
    for _time in range(6):
        world.run(LOOK)
    assert [done for done in world.done if done.startswith("evict")] == [EVICTED[1]] * 3
    assert world.said[-1] == LEFT + "it was begun anew 3 times within 60 min"
    world.at += 3600
    world.run(LOOK)
    assert [done for done in world.done if done.startswith("evict")] == [EVICTED[1]] * 4


def test_one_at_a_look() -> None:
    world = hanging()
    arm = f"http://{ADDRESSES['arm']}:1/"
    world.pods_now.append(pod("arm"))
    world.silence = Silence({"/camera": (URI, 500.0), "/arm": (arm, 501.0)})
    world.run(LOOK)
    assert [done for done in world.done if done.startswith("evict")] == [f"evict {NAMESPACE}/arm-x in 10 s"]


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (ApiError("no such pod", 404), f"{WORDS}; its pod is gone already"),
        (ApiError("the UID differs", 409), f"{WORDS}; its pod is gone already"),
        (ApiError("needs 1", 429), f"{WORDS}, and a PodDisruptionBudget keeps its pod: needs 1"),
    ],
)
def test_what_the_api_does_not_evict(error: ApiError, words: str) -> None:
    world = hanging()
    world.unevictable = [error]
    world.run(LOOK)
    assert world.done == ["lease ros-keeper", "lease free"]
    assert world.said == [f"{NAMESPACE}/camera: {words}"]
