# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The keeper begins a pod anew whose node hangs: the simulated cluster, graph and clock of its other work."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._robot.cluster_api import ApiError
from ansible_collections.rosops.fleet.plugins.module_utils._robot.hung import Silence
from ansible_collections.rosops.fleet.plugins.module_utils._robot.step_watch import LOOK
from ansible_collections.rosops.fleet.tests.unit.plugins.module_utils._robot.steps_left import NAMESPACE, lease
from ansible_collections.rosops.fleet.tests.unit.plugins.module_utils._robot.test_hung import ADDRESSES, KEEPER, pod
from ansible_collections.rosops.fleet.tests.unit.plugins.module_utils._robot.test_step_watch import (
    ACTIVE,
    SUCCEEDED,
    World,
    busy,
)

URI = f"http://{ADDRESSES['camera']}:4711/"
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
    world.pods_now = [pod("camera", ADDRESSES["camera"]), KEEPER]
    world.uris["/camera"] = URI
    world.silence = Silence({"/camera": (URI, seconds)})
    return world


def test_its_pod_is_begun_anew() -> None:
    world = hanging()
    world.run(LOOK)
    assert world.done == EVICTED
    assert world.said == [f"{NAMESPACE}/camera: {WORDS}: its pod camera-x is begun anew"]


def test_while_all_answer_nothing_is_asked_for() -> None:
    world = hanging()
    world.silence = Silence()
    world.run(10 * LOOK)
    assert world.requests.count("pods") == 0


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


def test_nobody_takes_a_step_meanwhile() -> None:
    """Neither is one disturbed that is under way, nor does one begin that would find the pod gone."""
    world = hanging()
    for number in range(4, 20):
        world.leases_now[NAMESPACE] = lease("host 77", number)
        world.run(LOOK)
    assert world.done == []
    world = hanging()
    find, looks = world.lease, iter(range(100))

    def taken_after_the_look(namespace: str) -> dict[str, Any] | None:
        if next(looks) == 0:
            world.leases_now[NAMESPACE] = lease("host 77", 50)
        return find(namespace)

    world.lease = taken_after_the_look  # type: ignore[method-assign]
    world.run(LOOK)
    assert world.done == []


def test_a_lease_that_is_taken_just_then_is_the_other_ones() -> None:
    world = hanging()
    write = world.write_lease

    def taken_first(namespace: str, body: dict[str, Any]) -> dict[str, Any] | None:
        world.leases_now[NAMESPACE] = lease("host 77", 50)
        return write(namespace, body)

    world.write_lease = taken_first  # type: ignore[method-assign]
    world.run(LOOK)
    assert world.done == []
    assert world.said == [LEFT + "somebody else changes it now"]


def test_not_during_a_goal() -> None:
    """Of another node in that pod, or of the node itself."""
    world = hanging(seconds=5000.0)
    world.uris["/planner"] = f"http://{ADDRESSES['camera']}:4712/"
    world.serve("/plan", "/planner")
    world.goals["/planner"] = busy(ACTIVE)
    world.run(10 * LOOK)
    assert world.done == []
    assert world.said == [LEFT + "/plan ACTIVE"]
    world.goals["/planner"] = busy(SUCCEEDED)
    world.run(LOOK)
    assert world.done[1] == f"evict {NAMESPACE}/camera-x in its own time"  # a goal that begins now may end


def test_a_goal_that_begins_while_the_lease_is_taken_is_waited_for_too() -> None:
    world = hanging()
    world.serve("/plan", "/planner")
    world.uris["/planner"] = f"http://{ADDRESSES['camera']}:4712/"
    world.goals["/planner"] = busy()
    write = world.write_lease

    def meanwhile(namespace: str, body: dict[str, Any]) -> dict[str, Any] | None:
        world.goals["/planner"] = busy(ACTIVE)
        return write(namespace, body)

    world.write_lease = meanwhile  # type: ignore[method-assign]
    world.run(LOOK)
    assert world.done == ["lease ros-keeper", "lease free"]
    assert world.said == [LEFT + "/plan ACTIVE"]


def test_a_node_that_answers_by_then_stays() -> None:
    world = hanging()
    world.answering.add("/camera")
    world.run(LOOK)
    assert world.done == ["lease ros-keeper", "lease free"]
    assert world.said == [f"{NAMESPACE}/camera: node /camera answers again"]


def test_goals_elsewhere_are_no_reason() -> None:
    world = hanging()
    world.uris["/planner"] = f"http://{ADDRESSES['arm']}:4712/"
    world.serve("/plan", "/planner")
    world.goals["/planner"] = busy(ACTIVE)
    world.run(LOOK)
    assert world.done == EVICTED


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
    world.pods_now.append(pod("arm", ADDRESSES["arm"]))
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
