# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The wait, with a cluster, a clock and a stream that the test holds in its hands."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import NotReadyError
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import Object
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import Ref
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.connection import PATIENCE, ApiError
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.message import telling
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.probe_events import HOPELESS, latest, probe_line
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.resources import Target
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.wait import (
    BEGUN_SECONDS,
    WaitOptions,
    look_once,
    wait_for_rollout,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.watch import StreamEvent
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_objects import (
    NEW,
    NS,
    OLD,
    container,
    deployment,
    gone_soon,
    obj,
    pod,
    ref,
    replica_set,
    unscheduled,
    waiting,
)

DEPLOYMENT = ref("Deployment")
DEPLOYMENTS, SETS, PODS = Target("Deployment", NS), Target("ReplicaSet", NS), Target("Pod", NS)
TALKER = {"kind": "Deployment", "name": "talker", "namespace": NS}
new_pod, old_pod = pod("talker-new-1", NEW), pod("talker-old-1", OLD)


class Clock:
    def __init__(self) -> None:
        self.time = 1000.0

    def __call__(self) -> float:
        return self.time


class Script:
    """Plays changes at set times; the clock moves only while the wait waits."""

    def __init__(self, clock: Clock, steps: Iterable[tuple[float, list[StreamEvent]]]) -> None:
        self.clock, self.start = clock, clock.time
        self.steps = sorted(steps, key=lambda step: step[0])
        self.followed: list[Target] = []
        self.waits = 0

    def __call__(self, _kube: Any, targets: Iterable[Target]) -> Script:
        self.follow(targets)
        return self

    def __enter__(self) -> Script:
        return self

    def __exit__(self, *unused: object) -> None:
        """Nothing to end."""

    def follow(self, targets: Iterable[Target]) -> None:
        self.followed += targets

    def changes(self, timeout: float) -> list[StreamEvent]:
        self.waits += 1
        until = self.clock.time + timeout
        if self.steps and self.start + self.steps[0][0] <= until:
            at, found = self.steps.pop(0)
            self.clock.time = max(self.clock.time, self.start + at)
            return found
        self.clock.time = until
        return []


class FakeKube:
    host = "https://edge1:6443"

    def __init__(self, lists: dict[str, list[Object]] | None = None, log: str = "", refuse: int = 0) -> None:
        self.lists, self.log, self.refuse = lists or {}, log, refuse
        self.no_previous = False
        self.asked: list[tuple[str, ...]] = []

    def objects(self, kind: str, *where: str, **which: str) -> list[Object]:
        self.asked.append((kind, *where, *which.values()))
        if self.refuse:
            raise ApiError("no", status=self.refuse)
        return self.lists.get(kind, [])

    def log_tail(self, *_whose: Any, previous: bool = True) -> str:
        if previous and self.no_previous:
            raise ApiError("previous terminated container not found", status=400)
        return self.log


def listed(target: Target, *objects: Object) -> StreamEvent:
    return StreamEvent("listed", target, list(objects))


def changed(target: Target, obj: Object, what: str = "set") -> StreamEvent:
    return StreamEvent(what, target, [obj])


def lists(*pods: Object, **state: Any) -> list[StreamEvent]:
    return [
        listed(DEPLOYMENTS, deployment(**state)),
        listed(SETS, replica_set("talker-old", "1"), replica_set("talker-new", "2")),
        listed(PODS, *pods),
    ]


class Run:
    """One wait and all that came of it."""

    def __init__(
        self, *steps: tuple[float, list[StreamEvent]], refs: list[Ref] | None = None, kube: Any = None, **more: Any
    ):
        self.clock = Clock()
        self.said: list[str] = []
        self.script = Script(self.clock, steps)
        options = WaitOptions(say=self.said.append, now=self.clock, watch=self.script, **more)
        self.error: Exception | None = None
        self.result: dict[str, Any] = {}
        try:
            self.result = wait_for_rollout(kube or FakeKube(), refs or [DEPLOYMENT], options)
        except (NotReadyError, ApiError) as exc:
            self.error = exc
            self.result = dict(exc.details)
        self.took = self.clock.time - 1000.0

    @property
    def message(self) -> str:
        return str(self.error)


def test_ready_at_the_first_look() -> None:
    done = Run((0.1, lists(new_pod)))
    assert done.result == {
        "objects": [{**TALKER, "verdict": "pass", "reason": "1 of 1 pods updated and available"}],
        "elapsed": 0.1,
    }


def test_returns_with_the_change_that_makes_it_ready() -> None:
    done = Run(
        (0.1, lists(new_pod, old_pod)),
        (2.0, [changed(PODS, gone_soon(old_pod))]),
        (4.5, [changed(PODS, old_pod, "gone")]),
    )
    assert done.error is None
    assert done.took == pytest.approx(4.5)


def test_nothing_passes_before_every_stream_has_listed() -> None:
    first, second, third = lists(new_pod, gone_soon(old_pod))
    done = Run((0.1, [first, second]), (3.0, [third]), (4.0, [changed(PODS, old_pod, "gone")]))
    assert done.took == pytest.approx(4.0)


def test_fails_at_once_with_the_pods_reason() -> None:
    bad = pod("talker-new-1", NEW, [waiting("ImagePullBackOff", "not found")])
    done = Run((0.1, lists(old_pod, status={"availableReplicas": 0})), (1.0, [changed(PODS, bad)]))
    assert done.took == pytest.approx(1.0)
    assert done.message == (
        "ImagePullBackOff: image lab/apps:1.0: not found "
        f"(Deployment {NS}/talker, pod talker-new-1, container ros-app)\n"
        f"  1 of 1 cannot be rolled out: Deployment {NS}/talker"
    )
    assert done.result["objects"][0]["verdict"] == "fail"


def test_unschedulable_fails_after_the_grace_without_any_further_news() -> None:
    stuck = unscheduled("talker-new-1", NEW, "0/3 nodes are available: 3 Insufficient memory.")
    done = Run((0.5, lists(stuck, status={"availableReplicas": 0})), grace=5.0)
    assert done.took == pytest.approx(5.5)
    assert "Insufficient memory" in done.message


NONE_YET = {"status": {"availableReplicas": 0, "updatedReplicas": 0, "replicas": 0}}


@pytest.mark.parametrize(("ends", "took"), [(43.0, 43.0), (46.9, 46.9), (None, 65.0)])
def test_the_time_that_an_old_pod_has_for_its_end_is_not_the_new_ones(ends: float | None, took: float) -> None:
    """It was told to end at 2 s, and has 45: the 20 s of the rollout are those before and after."""
    gone = [(ends, [changed(PODS, old_pod, "gone")])] if ends else []
    done = Run((0.0, lists(new_pod, old_pod)), (2.0, [changed(PODS, gone_soon(old_pod, 45))]), *gone, timeout=20)
    assert (done.error is None, done.took) == (bool(ends), pytest.approx(took))
    assert ends or "old pod talker-old-1 is terminating" in done.message


@pytest.mark.parametrize(("ready", "took"), [(55.0, 55.0), (None, 60.0)])
def test_what_comes_after_an_old_pod_has_its_whole_time(ready: float | None, took: float) -> None:
    starting = pod("talker-new-1", NEW, [container(ready=False)])
    steps = [(40.0, [changed(PODS, old_pod, "gone"), changed(PODS, starting)])]
    steps += [(ready, [changed(PODS, new_pod), changed(DEPLOYMENTS, deployment())])] if ready else []
    done = Run((0.0, lists(gone_soon(old_pod, 45), **NONE_YET)), *steps, timeout=20)
    assert (done.error is None, done.took) == (bool(ready), pytest.approx(took))


def test_a_wait_for_an_end_does_not_turn_round_and_round() -> None:
    """The time was nearly over when it began."""
    done = Run(
        (0.0, lists(new_pod, old_pod)),
        (19.999, [changed(PODS, gone_soon(old_pod, 45))]),
        (60.0, [changed(PODS, old_pod, "gone")]),
        timeout=20,
    )
    assert done.error is None
    assert done.script.waits < 20


def test_time_out_names_everything_that_is_open_and_its_last_reason() -> None:
    refs = [DEPLOYMENT, ref("Deployment", "listener"), ref("ConfigMap", "params")]
    done = Run((0.1, lists(new_pod, old_pod)), refs=refs, timeout=25)
    assert done.took == pytest.approx(25.1)
    assert done.message == (
        f"old pod talker-old-1 still runs on robot1 (Deployment {NS}/talker)\n"
        f"is not there yet (Deployment {NS}/listener)\n"
        f"  2 of 3 are not rolled out after 25 s: Deployment {NS}/talker, Deployment {NS}/listener"
    )
    assert [row["verdict"] for row in done.result["objects"]] == ["wait", "wait", "pass"]
    assert done.result["elapsed"] == 25.1


def test_says_every_ten_seconds_what_is_open() -> None:
    done = Run((0.1, lists(new_pod, old_pod)), timeout=25)
    assert done.said == [
        f"rollout: 1 of 1 still open after {seconds} s\n"
        f"  Deployment {NS}/talker: old pod talker-old-1 still runs on robot1"
        for seconds in (10, 20)
    ]


def test_a_progress_message_stays_short() -> None:
    refs = [ref("Deployment", f"app{index}") for index in range(20)]
    done = Run((0.1, [listed(DEPLOYMENTS), listed(SETS), listed(PODS)]), refs=refs, timeout=12)
    assert done.said[0].splitlines()[-1] == "  and 8 more"


def test_a_timeout_of_zero_looks_once() -> None:
    assert Run((0.1, lists(new_pod)), timeout=0).error is None
    assert "0 s" in Run((0.1, lists(old_pod)), timeout=0).message


def test_nothing_to_wait_for() -> None:
    done = Run(refs=[ref("ConfigMap")])
    assert (done.took, done.script.followed) == (0, [])
    assert wait_for_rollout(FakeKube(), [], WaitOptions(watch=done.script))["objects"] == []


# --- the API is away ------------------------------------------------------------------------------------------------

REFUSED = ApiError("The Kubernetes API at https://edge1:6443 cannot be reached: connection refused.", transient=True)


def lost(target: Target) -> StreamEvent:
    return StreamEvent("lost", target, error=REFUSED)


def test_never_reached_fails_soon_with_the_cause() -> None:
    done = Run((0.0, [lost(DEPLOYMENTS)]), timeout=300)
    assert done.error is REFUSED
    assert done.took == pytest.approx(PATIENCE, abs=1)


def test_the_silence_of_the_api_is_none_of_the_objects_time() -> None:
    done = Run((0.0, [lost(DEPLOYMENTS)]), (20.0, lists(new_pod)), timeout=3)
    assert done.error is None
    done = Run((0.0, [lost(DEPLOYMENTS)]), (20.0, lists(old_pod)), timeout=3)
    assert "old pod talker-old-1" in done.message
    assert done.took == pytest.approx(23)
    done = Run((0.0, [lost(DEPLOYMENTS)]), timeout=3)
    assert done.error is REFUSED
    assert done.took == pytest.approx(PATIENCE, abs=1)


def test_away_later_is_waited_for_and_told() -> None:
    done = Run((0.1, lists(old_pod)), (5.0, [lost(PODS)]), timeout=25)
    assert "no news at the moment: The Kubernetes API at https://edge1:6443" in done.said[0]
    assert "The last news is old" in done.message
    back = Run((0.1, lists(new_pod, old_pod)), (5.0, [lost(PODS)]), (22.0, [listed(PODS, new_pod)]), timeout=60)
    assert back.error is None


# --- few permissions -------------------------------------------------------------------------------


@pytest.mark.parametrize(("target", "status"), [(DEPLOYMENTS, 401), (PODS, 403)])
def test_who_may_not_see_what_is_waited_for_waits_no_longer(target: Target, status: int) -> None:
    error = ApiError("no", status=status)
    assert Run((0.1, [StreamEvent("refused", target, error=error)])).error is error


def test_who_may_not_read_storage_classes_waits_for_a_claim_all_the_same() -> None:
    claims, classes = Target("PersistentVolumeClaim", NS), Target("StorageClass")
    forbidden = StreamEvent("refused", classes, error=ApiError("403", status=403))
    bound = obj("PersistentVolumeClaim", "logs-pvc", status={"phase": "Bound"})
    done = Run((0.1, [forbidden, listed(claims, bound)]), refs=[ref("PersistentVolumeClaim", "logs-pvc")])
    assert done.error is None


# --- what explains a failure ----------------------------------------------------------------------------------------


def warning(name: str, message: str, second: int, reason: str = "FailedMount", kind: str = "Pod") -> Object:
    return {
        "involvedObject": {"kind": kind, "name": name, "uid": f"uid-{name}"},
        "reason": reason,
        "message": message,
        "lastTimestamp": f"2026-01-01T12:00:0{second}Z",
    }


def test_a_time_out_quotes_the_newest_warning_of_each_object() -> None:
    starting = pod("talker-new-1", NEW, [waiting("ContainerCreating")])
    other = {**warning("talker-new-1", "of an earlier pod of that name", 7)}
    other["involvedObject"] = {**other["involvedObject"], "uid": "uid-earlier"}
    events = [
        warning("talker-new-1", "second", 2),
        warning("talker-new-1", "first", 1),
        warning("talker-new-1", "known", 3, reason="BackOff"),
        warning("talker-new-1", "Error: ContainerCreating", 4),
        warning("talker-old-1", "on its way out", 5),
        warning("talker-gone-1", "gone", 5),
        warning("other-1", "not ours", 6),
        other,
        warning("talker", "of the Deployment itself", 1, "Odd", "Deployment"),
        warning("talker-new", "of the replica set", 1, "FailedCreate", "ReplicaSet"),
    ]
    steps = (0.1, lists(starting, gone_soon(old_pod), status={"availableReplicas": 0}))
    done = Run(steps, kube=FakeKube({"Event": events}), timeout=5)
    assert done.message.splitlines()[1:-1] == [
        "  event of Pod talker-new-1: FailedMount: second",
        "  event of Deployment talker: Odd: of the Deployment itself",
    ]


def test_a_crash_loop_quotes_the_log_if_the_container_left_no_message() -> None:
    crash = waiting("CrashLoopBackOff", restartCount=2, lastState={"terminated": {"exitCode": 1}})
    steps = (0.1, lists(pod("talker-new-1", NEW, [crash]), status={"availableReplicas": 0}))
    done = Run(steps, kube=FakeKube(log="Traceback\nImportError: rospy"))
    assert done.message.splitlines()[-2] == "  log of pod talker-new-1, container ros-app: ImportError: rospy"


def test_of_a_log_the_lines_that_tell_are_chosen() -> None:
    """roslaunch ends its nodes after the error that it ends for."""
    log = [
        "started core service [/rosout]",
        "\x1b[31mERROR: cannot launch node of type [topic_tools/relay]: topic_tools\x1b[0m",
        *(f"[{node}-{number}] killing on exit" for number, node in enumerate(("estop", "imu", "base", "arm", "map"))),
        "shutting down processing monitor...",
        "... shutting down processing monitor complete",
    ]
    found = telling("\n".join(log))
    assert found[0] == "started core service [/rosout]" or len(found) == 5
    assert "ERROR: cannot launch node of type [topic_tools/relay]: topic_tools" in found
    assert sum("killing on exit" in line for line in found) == 1
    assert telling("one\n\ntwo") == ["one", "two"]
    assert telling("\n".join(f"Error of {word}" for word in "abcdefgh")) == [f"Error of {word}" for word in "defgh"]


def test_what_a_node_said_that_ended_is_told_of_a_container_that_runs_on() -> None:
    line = "Startup probe failed: cannot become ready: node /imu: ended with exit code 1, and is not started again"
    kube = FakeKube({"Event": [unhealthy(line, 1)]}, log="[imu-1] started\nKeyError: 'port'")
    done = Run((0.1, lists(pod("talker-new-1", NEW, [app()]), old_pod)), kube=kube)
    assert done.message.splitlines()[0].startswith("node /imu: ended with exit code 1")
    assert "  log of pod talker-new-1, container ros-app: KeyError: 'port'" in done.message.splitlines()


# --- an end with an error, at once -----------------------------------------------------------------------------------

CRASHED = {"terminated": {"exitCode": 3, "reason": "Error"}}


def app(**more: Any) -> Object:
    return {**container(running={}), **more}


def restarted(count: int, **more: Any) -> Object:
    """A pod that is Ready, and was begun anew so often."""
    made = pod("talker-new-1", NEW)
    made["status"]["containerStatuses"] = [app(ready=True, restartCount=count, lastState=CRASHED, **more)]
    return made


def test_an_end_with_an_error_fails_at_once_with_exit_code_and_log() -> None:
    dead = pod("talker-new-1", NEW, [app(state=CRASHED)])
    kube = FakeKube(log="Traceback\nImportError: rospy")
    kube.no_previous = True
    steps = [(0.1, lists(pod("talker-new-1", NEW, [app()]), old_pod)), (1.0, [changed(PODS, dead)])]
    done = Run(*steps, kube=kube, fail_on_restart=True)
    assert done.took == pytest.approx(1.0)
    assert done.message.splitlines()[:-1] == [
        f"ended with exit code 3 (Error) (Deployment {NS}/talker, pod talker-new-1, container ros-app)",
        "  log of pod talker-new-1, container ros-app: Traceback",
        "  log of pod talker-new-1, container ros-app: ImportError: rospy",
    ]
    assert Run(*steps, timeout=5).took == pytest.approx(5.1)  # without the option it may come back


def test_an_end_that_was_missed_is_seen_by_the_restart_even_if_the_pod_is_ready_again() -> None:
    starting = pod("talker-new-1", NEW, [app()])
    steps = [(0.1, lists(starting, old_pod)), (2.0, [changed(PODS, restarted(1)), changed(PODS, old_pod, "gone")])]
    done = Run(*steps, fail_on_restart=True, kube=FakeKube(log="last words"))
    assert "exit code 3 (Error) (1 restart)" in done.message
    assert done.message.splitlines()[-2].endswith("container ros-app: last words")
    assert Run(*steps).error is None


def test_restarts_of_an_earlier_life_and_clean_ends_are_no_failure() -> None:
    survivor = restarted(2)
    assert Run((0.1, lists(survivor)), fail_on_restart=True).error is None
    again = pod("talker-new-1", NEW, [app(restartCount=3, lastState=CRASHED)])
    later = [(0.1, lists(survivor, old_pod)), (1.0, [changed(PODS, again)])]
    assert "3 restarts" in Run(*later, fail_on_restart=True).message
    clean = restarted(1)
    clean["status"]["containerStatuses"][0]["lastState"] = {"terminated": {"exitCode": 0, "reason": "Completed"}}
    steps = [(0.1, lists(pod("talker-new-1", NEW, [app()]), old_pod)), (1.0, [changed(PODS, clean)])]
    assert Run(*steps, (2.0, [changed(PODS, old_pod, "gone")]), fail_on_restart=True).took == pytest.approx(2.0)


def test_a_crash_before_the_first_look_counts_for_a_pod_that_is_not_ready() -> None:
    crashed = pod("talker-new-1", NEW, [app(restartCount=1, lastState=CRASHED)])
    assert "exit code 3" in Run((0.1, lists(crashed, old_pod)), fail_on_restart=True).message


def test_an_old_pods_crash_is_not_this_rollouts() -> None:
    crashed = pod("talker-old-1", OLD, [app(restartCount=1, lastState=CRASHED)])
    done = Run((0.1, lists(new_pod, crashed)), (1.0, [changed(PODS, crashed, "gone")]), fail_on_restart=True)
    assert done.error is None


def test_what_has_to_stay_is_watched_for_as_long_and_an_end_by_an_error_ends_it() -> None:
    runs = (0.1, lists(new_pod))
    assert Run(runs, watched=9.0).took == pytest.approx(9.1)
    assert Run(runs, watched=9.0, timeout=5.0).error is None  # the time is for coming up
    crashed = pod("talker-new-1", NEW, [app(restartCount=1, lastState=CRASHED)])
    done = Run(runs, (4.0, [changed(PODS, crashed)]), watched=9.0, fail_on_restart=True)
    assert ("exit code 3" in done.message, done.took) == (True, pytest.approx(4.0))
    unready = pod("talker-new-1", NEW, [app()])
    away = [changed(PODS, unready), changed(DEPLOYMENTS, deployment(status={"availableReplicas": 0}))]
    steps = [runs, (4.0, away), (6.0, [changed(PODS, new_pod), changed(DEPLOYMENTS, deployment())])]
    assert Run(*steps, watched=9.0).took == pytest.approx(15.0)
    late = Run(runs, (4.0, [changed(PODS, unready)]), watched=9.0)  # its Deployment does not say so yet
    assert (late.took, late.script.waits < 20) == (pytest.approx(9.1), True)


def test_a_restart_between_two_waits_of_one_run_is_seen() -> None:
    known: dict[str, dict[str, int]] = {}
    first = Run(
        (0.1, lists(pod("talker-new-1", NEW, [app()]))),
        (1.0, [changed(PODS, new_pod)]),
        fail_on_restart=True,
        before=known,
    )
    assert first.error is None
    assert "exit code 3" in Run((0.1, lists(restarted(1))), fail_on_restart=True, before=known).message
    assert Run((0.1, lists(restarted(1))), fail_on_restart=True).error is None  # else it was an earlier life's


# --- who is beside the old pod ---------------------------------------------------------------------------------------


NEW_RUNS = pod("talker-new-1", NEW, [app()])
NO_ROOM = unscheduled("talker-new-1", NEW, "0/1 nodes are available: 1 node(s) didn't have free ports")
QUOTA = {"type": "ReplicaFailure", "status": "True", "reason": "FailedCreate", "message": "exceeded quota"}


@pytest.mark.parametrize(
    ("state", "steps", "took"),
    [
        ({}, [(0.5, waiting("ContainerCreating")), (2.0, app())], 2.0 + BEGUN_SECONDS),
        # to be Ready for a while before the old one goes: it has begun when it is
        ({"minReadySeconds": 299}, [(0.5, app()), (9.0, None)], 9.0),
        # there is no place for it before the old one has gone
        ({}, [(0.5, NO_ROOM)], 0.5),
        ({"status": {"updatedReplicas": 0, "conditions": [QUOTA]}}, [], 0.1),
    ],
)
def test_a_new_pod_has_begun_beside_the_old_one(state: Any, steps: list[Any], took: float) -> None:
    made = [
        (at, [changed(PODS, one if one and "spec" in one else pod("talker-new-1", NEW, one and [one]))])
        for at, one in steps
    ]
    done = Run((0.1, lists(old_pod, **state)), *made, begun=True)
    assert (done.error, done.took) == (None, pytest.approx(took))


def test_one_that_ends_at_once_has_not_begun() -> None:
    ended = pod("talker-new-1", NEW, [app(state=CRASHED)])
    steps = [(0.1, lists(old_pod)), (0.5, [changed(PODS, NEW_RUNS)]), (1.2, [changed(PODS, ended)])]
    assert "exit code 3" in Run(*steps, begun=True, fail_on_restart=True).message


def test_an_old_pod_that_runs_is_none_that_has_begun() -> None:
    starting = pod("talker-old-1", OLD, [app()])
    assert Run((0.1, lists(starting)), begun=True, timeout=5).took == pytest.approx(5.1)


# --- what probes say -------------------------------------------------------------------------------------------------


def unhealthy(message: str, second: int, name: str = "talker-new-1", uid: str = "") -> Object:
    event = warning(name, message, second, reason="Unhealthy")
    return {**event, "involvedObject": {**event["involvedObject"], "uid": uid or f"uid-{name}"}}


def test_a_probe_without_hope_fails_at_once_with_its_line() -> None:
    line = "Startup probe failed: cannot become ready: /talker_new has /temperature at 250 Hz of 500\n"
    kube = FakeKube({"Event": [unhealthy("Startup probe failed: not ready: not registered yet", 1)]})
    calm = Run((0.1, lists(NEW_RUNS, old_pod)), kube=kube, timeout=15)
    assert calm.message.splitlines()[0] == f"not registered yet (Deployment {NS}/talker, pod talker-new-1)"
    assert len(calm.message.splitlines()) == 2  # and not once more as an event
    assert "not registered yet" in calm.said[0]
    kube.lists["Event"].append(unhealthy(line, 2))
    done = Run((0.1, lists(NEW_RUNS, old_pod)), kube=kube)
    assert done.took == pytest.approx(0.1)
    assert done.message == (
        f"/talker_new has /temperature at 250 Hz of 500 (Deployment {NS}/talker, pod talker-new-1)\n"
        f"  1 of 1 cannot be rolled out: Deployment {NS}/talker"
    )


def test_events_are_listed_once_a_second_and_only_while_a_pod_is_up_and_not_ready() -> None:
    starting = pod("talker-new-1", NEW, [app()])
    pulling = pod("talker-new-1", NEW, [waiting("ContainerCreating")])
    kube = FakeKube()
    done = Run(
        (0.1, lists(pulling, old_pod)),
        (5.0, [changed(PODS, starting)]),
        *((5.0 + step / 10, [changed(PODS, starting)]) for step in range(30)),
        (10.0, [changed(PODS, new_pod)]),
        (20.0, [changed(PODS, old_pod, "gone")]),
        kube=kube,
    )
    assert done.error is None
    assert 4 <= len(kube.asked) <= 6
    assert set(kube.asked) == {("Event", NS, "reason=Unhealthy,involvedObject.kind=Pod")}


def test_a_sidecar_says_in_its_log_why_the_app_is_not_ready() -> None:
    """Of a probe by HTTP the kubelet tells the status alone."""
    status = "Startup probe failed: HTTP probe failed with statuscode: 503"
    starting = pod("talker-new-1", NEW, [app()])
    starting["spec"]["initContainers"] = [{"name": "hooks", "restartPolicy": "Always"}]
    kube = FakeKube({"Event": [unhealthy(status, 1)]}, log="not ready: not registered yet")
    calm = Run((0.1, lists(starting, old_pod)), kube=kube, timeout=15)
    assert calm.message.splitlines()[0] == f"not registered yet (Deployment {NS}/talker, pod talker-new-1)"
    kube.log = "cannot become ready: never"
    assert Run((0.1, lists(starting, old_pod)), kube=kube).took == pytest.approx(0.1)
    kube.log = ""
    assert "talker-new-1:" not in Run((0.1, lists(starting, old_pod)), kube=kube, timeout=3).message.splitlines()[0]


def test_events_of_other_pods_say_nothing_here() -> None:
    hopeless = "Startup probe failed: cannot become ready: never"
    events = [
        unhealthy(hopeless, 1, "talker-old-1"),
        unhealthy(hopeless, 1, uid="uid-of-an-earlier-pod"),
        {**unhealthy(hopeless, 1), "reason": "Killing"},
    ]
    starting = pod("talker-new-1", NEW, [app()])
    unready_old = pod("talker-old-1", OLD, [app()])
    done = Run((0.1, lists(starting, unready_old)), kube=FakeKube({"Event": events}), timeout=3)
    assert done.took == pytest.approx(3.1)
    assert "never" not in done.message.splitlines()[0]


def test_events_that_may_not_be_read_are_asked_for_once() -> None:
    kube = FakeKube(refuse=403)
    done = Run((0.1, lists(pod("talker-new-1", NEW, [app()]), old_pod)), kube=kube, timeout=20)
    assert done.took == pytest.approx(20.1)
    assert len(kube.asked) == 2  # and once for the message
    assert len(done.message.splitlines()) == 2


@pytest.mark.parametrize(
    ("message", "line"),
    [
        ("Startup probe failed: not ready: x\n", "Startup probe failed: not ready: x"),
        ("(combined from similar events): Startup probe failed: not ready: y", "Startup probe failed: not ready: y"),
        ("Startup probe failed: Traceback:\n  File\nOSError: z\n", "Startup probe failed: OSError: z"),
        ("Startup probe failed: cannot become ready: a\nwarning: b", "Startup probe failed: cannot become ready: a"),
        ('Startup probe errored: command "x" timed out', 'Startup probe errored: command "x" timed out'),
        ("Startup probe failed: ", "Startup probe failed:"),
        ("", ""),
    ],
)
def test_a_probes_line(message: str, line: str) -> None:
    assert probe_line(message) == line


def test_the_newest_line_counts() -> None:
    old = {**unhealthy("Startup probe failed: cannot become ready: a", 1), "lastTimestamp": "2026-01-01T11:00:00Z"}
    by_series = {**unhealthy("Startup probe failed: b", 1), "series": {"lastObservedTime": "2026-01-01T12:30:00.123Z"}}
    assert latest([by_series, old, unhealthy("Startup probe failed: c", 5)])["uid-talker-new-1"].endswith("b")
    same = [unhealthy("Startup probe failed: cannot become ready: d", 5), unhealthy("Startup probe failed: e", 5)]
    assert HOPELESS in latest(same)["uid-talker-new-1"]


# --- check mode -----------------------------------------------------------------------------------------


def test_check_mode_looks_once_and_never_fails() -> None:
    shown = {"Deployment": [deployment()], "ReplicaSet": [replica_set("talker-new", "2")], "Pod": [new_pod]}
    result = look_once(FakeKube(shown), [DEPLOYMENT, Ref("Node", "robot1")])
    assert [row["verdict"] for row in result["objects"]] == ["pass", "wait"]
    assert look_once(FakeKube(refuse=403), [DEPLOYMENT])["objects"][0]["verdict"] == "wait"
