# SPDX-License-Identifier: GPL-3.0-or-later
"""When a robot goes back by itself, on a clock that the test turns."""

from __future__ import annotations

import json
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._robot import way_back
from ansible_collections.rosops.fleet.plugins.module_utils._robot.way_back import Observed, Step, steps_of
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import rolled_out
from ansible_collections.rosops.fleet.plugins.module_utils._step.words import HANDOFF
from ansible_collections.rosops.fleet.tests.unit.plugins.module_utils._robot.steps_left import (
    UPDATING,
    WENT_BACK,
    lease,
    left,
    live,
    member,
    pod,
    version,
)

OLD, NEW = version("camera", 1), version("camera", 2)
RUN = "host 77"


def at(*pods: dict[str, Any], ready: bool = False, **contract: Any) -> Step:
    return Step((member(live(NEW, ready=ready), left(OLD, **contract), pods),))


# ---- whether a version is ready


@pytest.mark.parametrize(
    ("status", "ready"),
    [
        ({"observedGeneration": 2, "replicas": 1, "updatedReplicas": 1, "readyReplicas": 1}, True),
        ({"observedGeneration": 1, "replicas": 1, "updatedReplicas": 1, "readyReplicas": 1}, False),  # the one before
        ({"observedGeneration": 2, "replicas": 2, "updatedReplicas": 1, "readyReplicas": 1}, False),  # overlap: old
        ({"observedGeneration": 2, "replicas": 2, "updatedReplicas": 1, "readyReplicas": 2}, False),  # old still there
        ({"observedGeneration": 2, "replicas": 1, "updatedReplicas": 1}, False),
        ({}, False),
    ],
)
def test_ready_means_all_of_the_present_template(status: dict[str, Any], ready: bool) -> None:
    assert rolled_out({**live(NEW), "status": status}) is ready
    asked_for_none = {**live(NEW), "spec": {**NEW["spec"], "replicas": 0}}
    assert rolled_out({**asked_for_none, "status": {"observedGeneration": 2}})


# ---- what is taken back


BY_HAND, WITH_DEFAULTS = json.loads(json.dumps([OLD, live(OLD)]))
BY_HAND["spec"]["template"]["spec"]["containers"][0]["image"] = "x/camera:mine"
WITH_DEFAULTS["spec"]["template"]["spec"]["dnsPolicy"] = "ClusterFirst"
WITH_DEFAULTS["spec"]["template"]["spec"]["containers"][0]["terminationMessagePath"] = "/dev/termination-log"
OTHERS = [pod("camera", 1, crashes=True), pod("lidar", 2, crashes=True), {"metadata": {}}]


@pytest.mark.parametrize(
    ("one", "came_up", "fails"),
    [
        (member(live(NEW), left(OLD)), False, True),
        (member(live(NEW, ready=True), left(OLD)), False, False),  # it kept its contract
        (member(live(NEW), left(OLD, proven=True, revision="rev2")), False, False),  # only its mark has to come off
        (member(live(NEW), left(OLD, revision="rev3")), False, False),  # nobody has written down who brought this one
        (member(live(NEW), left()), False, False),  # the step made it: no way back
        (member(live(NEW), None), False, False),
        (member(live(OLD), left(OLD)), False, False),  # it is the way back itself, cut off
        (member(live(NEW), left(version("lidar", 1))), False, False),  # somebody else's
        # what somebody changed by hand has our hash: the step that puts it right, and a way back changed once more
        (member(live(OLD), left(BY_HAND)), False, True),
        (member(live(BY_HAND), left(OLD)), False, True),
        (member(WITH_DEFAULTS, left(OLD)), False, False),
        # one that came up fails only by crashing
        (member(live(NEW), left(OLD), [pod("camera", 2)]), True, False),
        (member(live(NEW), left(OLD), [pod("camera", 2, crashes=True)]), True, True),
        (member(live(NEW), left(OLD), OTHERS), True, False),
    ],
)
def test_what_is_taken_back_would_be_better_afterwards(one: way_back.Member, came_up: bool, fails: bool) -> None:
    assert Step((one,)).failing(came_up) is fails


def test_a_pod_of_ours_without_the_label_is_known_by_its_hash() -> None:
    master, own = version("ros-master", 2, node=""), pod("ros-master", 2, crashes=True)
    for metadata in (master["spec"]["template"]["metadata"], own["metadata"]):
        metadata["labels"].pop("rosops.fleet/revision")
        metadata["annotations"] = {"rosops.fleet/spec-hash": "0123456789abcdef"}
    assert member(live(master), left(), [own]).pods == [own]


def test_a_group_is_proven_together() -> None:
    """Its contracts say so one after the other, and a run may end in between: as the next run reads it."""
    apps = ["lidar", "camera"]
    proven = left(version("lidar", 1), apps=apps, proven=True)
    lidar = member(live(version("lidar", 2)), proven)
    camera = member(live(NEW), left(OLD, apps=apps), lidar=proven)
    for members in ([lidar, camera], [camera]):  # of lidar the mark is off already
        (group,) = steps_of(members, [])
        assert not group.failing(came_up=False)
    open_ = left(version("lidar", 1), apps=apps)
    lidar, camera = member(live(version("lidar", 2)), open_), member(live(NEW), left(OLD, apps=apps), lidar=open_)
    (group,) = steps_of([lidar, camera], [])
    assert group.failing(came_up=False)


def test_a_group_goes_back_together_providers_first() -> None:
    apps = ["lidar", "camera", "fusion"]
    camera = member(live(NEW, ready=True), left(OLD, apps=apps, ready_timeout=60))
    lidar = member(live(version("lidar", 2)), left(version("lidar", 1), apps=apps, ready_timeout=90))
    fusion = member(live(version("fusion", 2)), left(apps=apps))  # new in this step
    other = member(live(version("other", 2), ready=True), left(version("other", 1)))
    group, alone = steps_of([camera, lidar, fusion, other], [])
    assert (group.name, alone.name) == ("lidar, camera, fusion", "other")
    assert group.failing(came_up=False)
    assert [member.name for member in group.going_back] == ["lidar", "camera"]
    assert group.ready_timeout == 180.0  # that of the last to be ready
    assert not alone.failing(came_up=False)


def test_a_group_of_which_one_is_back_already_goes_on_at_once() -> None:
    apps = ["camera", "lidar"]
    back = live(OLD, marked=False, ready=True)
    back["metadata"]["annotations"][WENT_BACK] = '{"from": "rev2", "run": "7"}'
    lidar = member(live(version("lidar", 2), ready=True), left(version("lidar", 1), apps=apps, run="7"))
    (step,) = steps_of([lidar], [back, lidar.deployment])
    seen = Observed()
    seen.lease(None, 0.0)
    assert seen.due([step]) == [step]
    later = member(lidar.deployment, left(version("lidar", 1), apps=apps, run="8"))
    assert not steps_of([later], [back, lidar.deployment])[0].begun  # a note that `kubectl rollout undo` brought back
    marked_again = live(OLD)
    marked_again["metadata"]["annotations"][WENT_BACK] = '{"from": "rev2", "run": "7"}'
    (step,) = steps_of([lidar], [marked_again])
    assert not step.failing(came_up=False)


def test_the_keeper_does_not_take_back_itself() -> None:
    own = version("ros-keeper", 2, node="")
    master = member(live(version("ros-master", 2, node="")), left(version("ros-master", 1, node="")))
    found = steps_of([member(live(own), left(version("ros-keeper", 1, node=""))), master], [])
    assert [step.name for step in found] == ["ros-master"]


# ---- since when


class Look:
    """Looks at one namespace, some seconds apart."""

    def __init__(self) -> None:
        self.seen, self.at = Observed(), 5000.0

    def __call__(self, found: dict[str, Any] | None, *steps: Step, after: float = 10.0) -> list[Step]:
        self.at += after
        self.seen.lease(found, self.at)
        return self.seen.due(steps) if self.seen.free else []


def test_a_lease_that_stands_still_is_over_after_its_own_time() -> None:
    look, step = Look(), at(ready_timeout=30)
    found = lease(RUN)
    found["spec"]["renewTime"] = "2999-01-01T00:00:00.000000Z"  # a clock that is a day, or a life, ahead
    free = []
    for _look in range(6):
        look(found, step)
        free.append(look.seen.free)
    assert free == [False, False, True, True, True, True]  # 0, 10, 20 s
    assert look(found, step) == [step]


@pytest.mark.parametrize("found", [None, lease(""), lease("ros-keeper")])
def test_a_lease_that_nobody_has_is_free_at_once(found: dict[str, Any] | None) -> None:
    look = Look()
    look(found)
    assert look.seen.free


def test_a_run_that_comes_back_begins_it_anew() -> None:
    look, step = Look(), at(ready_timeout=120)
    for _look in range(10):
        look(lease(""), step)
    look(lease(RUN, 2), step)
    assert [bool(look(lease("", 3), step)) for _look in range(13)] == [False] * 12 + [True]


UP, DOWN, CRASHES = at(ready=True), at(pod("camera", 2)), at(pod("camera", 2, crashes=True))


def test_a_version_that_came_up_and_crashes_again_and_again_is_due() -> None:
    look = Look()
    waited = [bool(look(lease(""), CRASHES if number % 3 else UP)) for number in range(29)]
    assert waited == [False] * 28 + [True]  # 180 s of crashes: two looks of three, the first of which begins the time
    assert look.seen.why(CRASHES) == "crashed again and again 180 s"


def test_the_time_that_it_took_to_come_up_is_not_its_crashes() -> None:
    look = Look()
    for _look in range(17):
        assert look(lease(""), DOWN) == []
    look(lease(""), UP)
    assert [bool(look(lease(""), CRASHES)) for _look in range(19)] == [False] * 18 + [True]


def test_crashes_of_another_day_are_forgiven() -> None:
    look = Look()
    look(lease(""), UP)
    for _day in range(10):
        for _look in range(10):
            assert look(lease(""), CRASHES) == []
        for _look in range(61):
            assert look(lease(""), UP) == []


@pytest.mark.parametrize("reason", ["Error", "StartError"])
def test_a_version_that_ended_with_an_error_before_it_came_up_is_due_at_once(reason: str) -> None:
    """As a run says it: whoever waits for the old server must not wait for a time-out."""
    died = at(pod("camera", 2, ended={"exitCode": 3, "reason": reason}))
    look = Look()
    assert look(lease(RUN), died) == []
    assert look(lease(""), died) == [died]
    assert look.seen.why(died) == "ended with exit code 3"
    waits = json.loads(json.dumps(died.members[0].pods[0]))
    status = waits["status"]["containerStatuses"][0]
    status["state"], status["lastState"] = {"terminated": {"exitCode": 3, "reason": reason}}, {}
    assert Look()(lease(""), at(waits)) != []


@pytest.mark.parametrize(
    ("code", "reason"),
    [(0, "Completed"), (143, "Error"), (137, "Error"), (255, "Unknown"), (137, "ContainerStatusUnknown")],
)
def test_a_reboot_is_no_error_of_the_version(code: int, reason: str) -> None:
    again = at(pod("camera", 2, ended={"exitCode": code, "reason": reason}))
    assert Look()(lease(""), again) == []


def test_an_error_after_it_came_up_is_no_crash_loop() -> None:
    look, died = Look(), at(pod("camera", 2, ended={"exitCode": 3, "reason": "Error"}))
    look(lease(""), UP)
    assert [look(lease(""), died) for _look in range(100)] == [[]] * 100


def test_another_version_has_to_come_up_itself() -> None:
    look = Look()
    look(lease(""), UP)
    newer = Step((member(live(version("camera", 3), generation=3), left(OLD, revision="rev3")),))
    assert [bool(look(lease(""), newer)) for _look in range(19)] == [False] * 18 + [True]
    remade = json.loads(json.dumps(live(NEW)))
    remade["metadata"]["uid"] = "another"
    assert Step((member(remade, left(OLD)),)).key != UP.key


# ---- what is written


def test_it_applies_the_version_before_as_it_was_and_says_so() -> None:
    stale = json.loads(json.dumps(OLD))
    stale["metadata"]["annotations"] |= {UPDATING: "900", WENT_BACK: "{}"}
    body = way_back.restored(member(live(NEW), left(stale, run="7")), "not ready 200 s", "2026-01-02T03:04:05.000000Z")
    told = json.loads(body["metadata"]["annotations"].pop(WENT_BACK))
    assert body == OLD
    said = {"from": "rev2", "to": "rev1", "at": "2026-01-02T03:04:05.000000Z", "reason": "not ready 200 s"}
    assert told == {**said, "run": "7"}


# ---- a launch file's nodes


def of_launch(number: int, handoff: str) -> dict[str, Any]:
    made = version("base", number, node="")
    made["spec"]["template"]["metadata"]["annotations"][HANDOFF] = handoff
    return made


@pytest.mark.parametrize(
    ("before", "after", "nodes", "old"),
    [
        ("overlap", "overlap", ["/lidar_rev2", "/front/arm_rev2"], {"/lidar_rev1", "/front/arm_rev1"}),
        ("replace", "overlap", ["/lidar_rev2"], {"/lidar"}),
        ("overlap", "replace", ["/lidar"], {"/lidar_rev1"}),
        ("replace", "replace", ["/lidar"], {"/lidar"}),
    ],
)
def test_the_contract_tells_what_the_version_before_called_its_nodes(
    before: str, after: str, nodes: list[str], old: set[str]
) -> None:
    contract = {"nodes": nodes[:1], "others": {"nodes": nodes[1:]}}
    launched = member(live(of_launch(2, after)), left(of_launch(1, before), **contract))
    assert launched.nodes_before == old


def test_the_node_of_an_apps_own_name_is_known_by_its_annotation() -> None:
    assert member(live(NEW), left(OLD)).nodes_before == {"/camera_1"}
    assert member(live(NEW), left()).nodes_before == set()
