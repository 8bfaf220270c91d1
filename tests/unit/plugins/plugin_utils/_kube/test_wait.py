# SPDX-License-Identifier: GPL-3.0-or-later
"""The wait, with a cluster, a clock and a stream that the test holds in its hands."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import nullcontext
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import NotReadyError
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import Object
from ansible_collections.rosops.fleet.plugins.module_utils._step.words import HOPELESS
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import Ref
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.connection import PATIENCE, ApiError
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.message import latest, probe_line, telling
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
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Clock

DEPLOYMENT = ref("Deployment")
DEPLOYMENTS, SETS, PODS = Ref("Deployment", "", NS), Ref("ReplicaSet", "", NS), Ref("Pod", "", NS)
TALKER = {"kind": "Deployment", "name": "talker", "namespace": NS}
new_pod, old_pod = pod("talker-new-1", NEW), pod("talker-old-1", OLD)


class Script:
    """Plays changes at set times; the clock moves only while the wait waits."""

    def __init__(self, clock: Clock, steps: Iterable[tuple[float, list[StreamEvent]]]) -> None:
        self.clock = clock
        self.steps = sorted(steps, key=lambda step: step[0])
        self.followed: list[Ref] = []
        self.waits = 0

    def __call__(self, _kube: Any, targets: Iterable[Ref]) -> Any:
        self.followed += targets
        return nullcontext(self)

    def changes(self, timeout: float) -> list[StreamEvent]:
        self.waits += 1
        until = self.clock.time + timeout
        if self.steps and self.steps[0][0] <= until:
            at, found = self.steps.pop(0)
            self.clock.time = max(self.clock.time, at)
            return found
        self.clock.time = until
        return []


class FakeKube:
    def __init__(self, lists: dict[str, list[Object]] | None = None, log: str = "", refuse: int = 0) -> None:
        self.lists, self.log, self.refuse = lists or {}, log, refuse
        self.previous = False
        self.asked: list[tuple[str, ...]] = []

    def objects(self, kind: str, *where: str, **which: str) -> list[Object]:
        self.asked.append((kind, *where, *which.values()))
        if self.refuse:
            raise ApiError("no", status=self.refuse)
        return self.lists.get(kind, [])

    def log_tail(self, *_whose: Any, previous: bool = True) -> str:
        if previous != self.previous:
            raise ApiError("previous terminated container not found", status=400)
        return self.log


def listed(target: Ref, *objects: Object) -> StreamEvent:
    return StreamEvent("listed", target, list(objects))


def changed(target: Ref, obj: Object, what: str = "set") -> StreamEvent:
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
        options = WaitOptions(say=self.said.append, now=self.clock.now, watch=self.script, **more)
        self.error: Exception | None = None
        self.result: dict[str, Any] = {}
        try:
            self.result = wait_for_rollout(kube or FakeKube(), refs or [DEPLOYMENT], options)
        except (NotReadyError, ApiError) as exc:
            self.error = exc
            self.result = dict(exc.details)
        self.took = self.clock.time

    @property
    def message(self) -> str:
        return str(self.error)


CRASHED = {"terminated": {"exitCode": 3, "reason": "Error"}}
REFUSED = ApiError("The Kubernetes API at https://edge1:6443 cannot be reached: connection refused.", transient=True)


def app(**more: Any) -> Object:
    return {**container(running={}), **more}


def restarted(count: int, ready: bool = True, **how: Any) -> Object:
    """A pod that was begun anew so often."""
    made = pod("talker-new-1", NEW, None if ready else [])
    made["status"]["containerStatuses"] = [app(ready=ready, restartCount=count, lastState=how or CRASHED)]
    return made


def lost(target: Ref) -> StreamEvent:
    return StreamEvent("lost", target, error=REFUSED)


GOING, GONE, HERE = [changed(PODS, gone_soon(old_pod, 45))], [changed(PODS, old_pod, "gone")], [changed(PODS, new_pod)]
RUNS, DEAD = pod("talker-new-1", NEW, [app()]), pod("talker-new-1", NEW, [app(state=CRASHED)])
FETCHES = pod("talker-new-1", NEW, [waiting("ContainerCreating")])
NO_IMAGE = pod("talker-new-1", NEW, [waiting("ImagePullBackOff", "gone")])
NO_ROOM = unscheduled("talker-new-1", NEW, "0/1 nodes are available: 1 node(s) didn't have free ports")
NO_QUOTA = {"type": "ReplicaFailure", "status": "True", "reason": "FailedCreate", "message": "exceeded quota"}
NONE_YET = {"status": {"availableReplicas": 0, "updatedReplicas": 0, "replicas": 0}}
UNREADY = [changed(PODS, RUNS), changed(DEPLOYMENTS, deployment(status={"availableReplicas": 0}))]
READY = [*HERE, changed(DEPLOYMENTS, deployment())]
STARTS = [changed(PODS, pod("talker-new-1", NEW, [container(ready=False)]))]
BOTH = (0.1, lists(RUNS, old_pod))
ONCE: dict[str, Any] = {"fail_on_restart": True}
FIRST, SECOND, THIRD = lists(new_pod, gone_soon(old_pod))

# When what happens; options; words of the failure, or none; how long it took
TIMES: dict[str, tuple[list[Any], dict[str, Any], str, float]] = {
    "ready with the change that makes it so": ([(0.1, lists(new_pod, old_pod)), (2, GOING), (4.5, GONE)], {}, "", 4.5),
    "nothing passes before every stream has listed": ([(0.1, [FIRST, SECOND]), (3, [THIRD]), (4, GONE)], {}, "", 4),
    "a suspicion lasts, without further news": (
        [(0.5, lists(NO_ROOM, status={"availableReplicas": 0}))], {"grace": 5.0}, "free ports", 5.5,
    ),
    "a time-out of zero looks once": ([(0.1, lists(old_pod))], {"timeout": 0}, "after 0 s", 0.1),
    # the old one was told to end at 2 s, and has 45: the 20 s of the rollout are those before and after
    "an old pod ends late": ([(0, lists(new_pod, old_pod)), (2, GOING), (46.9, GONE)], {"timeout": 20}, "", 46.9),
    "never": ([(0, lists(new_pod, old_pod)), (2, GOING)], {"timeout": 20}, "old pod talker-old-1 is terminating", 65),
    "its time is nearly over": ([(0, lists(new_pod, old_pod)), (19.999, GOING), (60, GONE)], {"timeout": 20}, "", 60),
    "what comes after an old pod has its whole time": (
        [(0, lists(gone_soon(old_pod, 45), **NONE_YET)), (40, [*GONE, *STARTS]), (55, READY)],
        {"timeout": 20}, "", 55,
    ),
    "and no more": (
        [(0, lists(gone_soon(old_pod, 45), **NONE_YET)), (40, [*GONE, *STARTS])],
        {"timeout": 20}, "not ready", 60,
    ),
    # the silence of the API is none of the objects' time
    "the API is silent, and then it is not ready": (
        [(0, [lost(DEPLOYMENTS)]), (20, lists(old_pod))], {"timeout": 3}, "old pod talker-old-1", 23,
    ),
    "the API is away later": (
        [(0.1, lists(new_pod, old_pod)), (5, [lost(PODS)]), (22, [listed(PODS, new_pod)])], {}, "", 22,
    ),
    "no image": (
        [(0.1, lists(old_pod)), (1, [changed(PODS, NO_IMAGE)])], {}, "ImagePullBackOff: image lab/apps:1.0: gone (", 1,
    ),
    # an end with an error, at once
    "an end": ([BOTH, (1, [changed(PODS, DEAD)])], ONCE, "exit code 3", 1),
    "an end that may be mended": ([BOTH, (1, [changed(PODS, DEAD)])], {"timeout": 5}, "rolled out after 5 s", 5.1),
    "an end that was missed": ([BOTH, (2, [changed(PODS, restarted(1)), *GONE])], ONCE, "(Error) (1 restart)", 2),
    "an end that was mended": ([BOTH, (2, [changed(PODS, restarted(1)), *GONE])], {}, "", 2),
    "restarts of an earlier life": ([(0.1, lists(restarted(2)))], ONCE, "", 0.1),
    "and one more": (
        [(0.1, lists(restarted(2), old_pod)), (1, [changed(PODS, restarted(3, False))])], ONCE, "3 restarts", 1,
    ),
    "a clean end": (
        [BOTH, (1, [changed(PODS, restarted(1, terminated={"exitCode": 0}))]), (2, GONE)], ONCE, "", 2,
    ),
    "a crash before the first look": ([(0.1, lists(restarted(1, False), old_pod))], ONCE, "exit code 3", 0.1),
    "the old pod's crash": (
        [(0.1, lists(new_pod, pod("talker-old-1", OLD, [app(state=CRASHED)]))), (1, GONE)], ONCE, "", 1,
    ),
    # it has to stay
    "it stays": ([(0.1, lists(new_pod))], {"watched": 9.0, "timeout": 5.0}, "", 9.1),
    "it ends meanwhile": ([(0.1, lists(new_pod)), (4, [changed(PODS, DEAD)])], {"watched": 9, **ONCE}, "code 3", 4),
    "it is away meanwhile": ([(0.1, lists(new_pod)), (4, UNREADY), (6, READY)], {"watched": 9}, "", 15),
    "its Deployment does not say so yet": ([(0.1, lists(new_pod)), (4, UNREADY[:1])], {"watched": 9}, "", 9.1),
    # beside the old one
    "it has begun": (
        [(0.1, lists(old_pod)), (0.5, [changed(PODS, FETCHES)]), (2, [changed(PODS, RUNS)])],
        {"begun": True}, "", 2 + BEGUN_SECONDS,
    ),
    "it has begun when it is Ready": (
        [(0.1, lists(old_pod, minReadySeconds=299)), (0.5, [changed(PODS, RUNS)]), (9, HERE)], {"begun": True}, "", 9,
    ),
    "it has no place yet": ([(0.1, lists(old_pod)), (0.5, [changed(PODS, NO_ROOM)])], {"begun": True}, "", 0.5),
    "it has no place in the quota": (
        [(0.1, lists(old_pod, status={"updatedReplicas": 0, "conditions": [NO_QUOTA]}))], {"begun": True}, "", 0.1,
    ),
    "it has not begun": (
        [(0.1, lists(old_pod)), (0.5, [changed(PODS, RUNS)]), (1.2, [changed(PODS, DEAD)])],
        {"begun": True, **ONCE}, "exit code 3", 1.2,
    ),
    "the old one is none that has begun": (
        [(0.1, lists(pod("talker-old-1", OLD, [app()])))], {"begun": True, "timeout": 5}, "old-1 still runs", 5.1,
    ),
}  # fmt: skip


@pytest.mark.parametrize(("steps", "options", "words", "took"), TIMES.values(), ids=TIMES)
def test_when_it_ends(steps: list[Any], options: dict[str, Any], words: str, took: float) -> None:
    done = Run(*steps, **options)
    assert (words in done.message) if words else not done.error, done.message
    assert done.took == pytest.approx(took)
    assert done.script.waits < 25  # it does not turn round and round


def test_what_is_returned() -> None:
    assert Run((0.1, lists(new_pod))).result == {
        "objects": [{**TALKER, "verdict": "pass", "reason": "1 of 1 pods updated and available"}],
        "elapsed": 0.1,
    }
    done = Run(refs=[ref("ConfigMap")])
    assert (done.took, done.script.followed) == (0, [])


def test_time_out_names_everything_that_is_open_and_says_so_every_ten_seconds() -> None:
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
    assert done.said == [
        f"rollout: 2 of 3 still open after {seconds} s\n"
        f"  Deployment {NS}/talker: old pod talker-old-1 still runs on robot1\n"
        f"  Deployment {NS}/listener: is not there yet"
        for seconds in (10, 20)
    ]


def test_a_progress_message_stays_short() -> None:
    refs = [ref("Deployment", f"app{index}") for index in range(20)]
    done = Run((0.1, [listed(DEPLOYMENTS), listed(SETS), listed(PODS)]), refs=refs, timeout=12)
    assert done.said[0].splitlines()[-1] == "  and 8 more"


def test_an_api_that_was_never_reached_is_the_cause() -> None:
    done = Run((0.0, [lost(DEPLOYMENTS)]), timeout=300)
    assert done.error is REFUSED
    assert done.took == pytest.approx(PATIENCE, abs=1)


def test_an_api_that_is_away_is_told() -> None:
    done = Run((0.1, lists(old_pod)), (5.0, [lost(PODS)]), timeout=25)
    assert "no news at the moment: The Kubernetes API at https://edge1:6443" in done.said[0]
    assert "The last news is old" in done.message
    done = Run((0.1, lists(old_pod)), (5.0, [lost(PODS)]), (6.0, [listed(PODS, old_pod)]), timeout=25)
    assert "news" not in done.message + done.said[0]


@pytest.mark.parametrize(("target", "status"), [(DEPLOYMENTS, 401), (PODS, 403)])
def test_who_may_not_see_what_is_waited_for_waits_no_longer(target: Ref, status: int) -> None:
    error = ApiError("no", status=status)
    assert Run((0.1, [StreamEvent("refused", target, error=error)])).error is error


def test_who_may_not_read_storage_classes_waits_for_a_claim_all_the_same() -> None:
    claims, classes = Ref("PersistentVolumeClaim", "", NS), Ref("StorageClass", "")
    forbidden = StreamEvent("refused", classes, error=ApiError("403", status=403))
    bound = obj("PersistentVolumeClaim", "logs-pvc", status={"phase": "Bound"})
    done = Run((0.1, [forbidden, listed(claims, bound)]), refs=[ref("PersistentVolumeClaim", "logs-pvc")])
    assert done.error is None


def test_a_restart_between_two_waits_of_one_run_is_seen() -> None:
    known: dict[str, dict[str, int]] = {}
    assert Run((0.1, lists(RUNS)), (1.0, HERE), before=known, **ONCE).error is None
    assert "exit code 3" in Run((0.1, lists(restarted(1))), before=known, **ONCE).message


# --- what explains a failure ----------------------------------------------------------------------------------------


def warning(name: str, message: str, second: int, reason: str = "FailedMount", kind: str = "Pod") -> Object:
    return {
        "involvedObject": {"kind": kind, "name": name, "uid": f"uid-{name}"},
        "reason": reason,
        "message": message,
        "lastTimestamp": f"2026-01-01T12:00:0{second}Z",
    }


def test_a_time_out_quotes_the_newest_warning_of_each_object() -> None:
    other = {**warning("talker-new-1", "of an earlier pod of that name", 7)}
    other["involvedObject"] = {**other["involvedObject"], "uid": "uid-earlier"}
    events = [
        warning("talker-new-1", "second", 2), warning("talker-new-1", "first", 1),
        warning("talker-new-1", "known", 3, reason="BackOff"), warning("talker-new-1", "Error: ContainerCreating", 4),
        warning("talker-old-1", "on its way out", 5), warning("talker-gone-1", "gone", 5),
        warning("other-1", "not ours", 6), other,
        warning("talker", "of the Deployment itself", 1, "Odd", "Deployment"),
        warning("talker-new", "of the replica set", 1, "FailedCreate", "ReplicaSet"),
    ]  # fmt: skip
    steps = (0.1, lists(FETCHES, gone_soon(old_pod), status={"availableReplicas": 0}))
    done = Run(steps, kube=FakeKube({"Event": events}), timeout=5)
    assert done.message.splitlines()[1:-1] == [
        "  event of Pod talker-new-1: FailedMount: second",
        "  event of Deployment talker: Odd: of the Deployment itself",
    ]


def refused(*_whose: Any, **_which: Any) -> str:
    raise ApiError("no", status=403)


def test_a_crash_loop_quotes_the_log_if_the_container_left_no_message() -> None:
    crash = waiting("CrashLoopBackOff", restartCount=2, lastState={"terminated": {"exitCode": 1}})
    steps = (0.1, lists(pod("talker-new-1", NEW, [crash]), status={"availableReplicas": 0}))
    kube = FakeKube(log="Traceback\nImportError: rospy")
    kube.previous = True
    done = Run(steps, kube=kube)
    assert done.message.splitlines()[-2] == "  log of pod talker-new-1, container ros-app: ImportError: rospy"
    no_log = FakeKube({"Event": [warning("talker-new-1", "no disk", 1)]})  # it may not be read, or its host is off
    no_log.log_tail = refused  # type: ignore[method-assign] # as any server may
    assert "  event of Pod talker-new-1: FailedMount: no disk" in Run(steps, kube=no_log).message.splitlines()


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
    assert len(found) == 5
    assert "ERROR: cannot launch node of type [topic_tools/relay]: topic_tools" in found
    assert sum("killing on exit" in line for line in found) == 1
    assert telling("one\n\ntwo") == ["one", "two"]
    assert telling("\n".join(f"Error of {word}" for word in "abcdefgh")) == [f"Error of {word}" for word in "defgh"]


def test_an_end_quotes_the_log_of_the_container_that_ended() -> None:
    kube = FakeKube(log="Traceback\nImportError: rospy")
    assert Run(BOTH, (1.0, [changed(PODS, DEAD)]), kube=kube, **ONCE).message.splitlines()[:-1] == [
        f"ended with exit code 3 (Error) (Deployment {NS}/talker, pod talker-new-1, container ros-app)",
        "  log of pod talker-new-1, container ros-app: Traceback",
        "  log of pod talker-new-1, container ros-app: ImportError: rospy",
    ]


def test_what_a_node_said_that_ended_is_told_of_a_container_that_runs_on() -> None:
    line = "Startup probe failed: cannot become ready: node /imu: ended with exit code 1, and is not started again"
    kube = FakeKube({"Event": [unhealthy(line, 1)]}, log="[imu-1] started\nKeyError: 'port'")
    done = Run((0.1, lists(RUNS, old_pod)), kube=kube)
    assert done.message.splitlines()[0].startswith("node /imu: ended with exit code 1")
    assert "  log of pod talker-new-1, container ros-app: KeyError: 'port'" in done.message.splitlines()


# --- what probes say -------------------------------------------------------------------------------------------------


def unhealthy(message: str, second: int, name: str = "talker-new-1", uid: str = "") -> Object:
    event = warning(name, message, second, reason="Unhealthy")
    return {**event, "involvedObject": {**event["involvedObject"], "uid": uid or f"uid-{name}"}}


def test_a_probe_without_hope_fails_at_once_with_its_line() -> None:
    line = "Startup probe failed: cannot become ready: /talker_new has /temperature at 250 Hz of 500\n"
    kube = FakeKube({"Event": [unhealthy("Startup probe failed: not ready: not registered yet", 1)]})
    calm = Run((0.1, lists(RUNS, old_pod)), kube=kube, timeout=15)
    assert calm.message.splitlines()[0] == f"not registered yet (Deployment {NS}/talker, pod talker-new-1)"
    assert len(calm.message.splitlines()) == 2  # and not once more as an event
    assert "not registered yet" in calm.said[0]
    kube.lists["Event"].append(unhealthy(line, 2))
    done = Run((0.1, lists(RUNS, old_pod)), kube=kube)
    assert done.took == pytest.approx(0.1)
    assert done.message == (
        f"/talker_new has /temperature at 250 Hz of 500 (Deployment {NS}/talker, pod talker-new-1)\n"
        f"  1 of 1 cannot be rolled out: Deployment {NS}/talker"
    )


def test_events_are_listed_once_a_second_and_only_while_a_pod_is_up_and_not_ready() -> None:
    kube = FakeKube()
    done = Run(
        (0.1, lists(FETCHES, old_pod)),
        (5.0, [changed(PODS, RUNS)]),
        *((5.0 + step / 10, [changed(PODS, RUNS)]) for step in range(30)),
        (10.0, [changed(PODS, new_pod)]),
        (20.0, [changed(PODS, old_pod, "gone")]),
        kube=kube,
    )
    assert done.error is None
    assert 4 <= len(kube.asked) <= 6
    assert set(kube.asked) == {("Event", NS, "reason=Unhealthy,involvedObject.kind=Pod")}


@pytest.mark.parametrize("steps", [
    [*lists(RUNS, old_pod), lost(PODS)],
    # a readiness gate's condition says why
    lists(pod("talker-new-1", NEW, [app(ready=True)]), status={"availableReplicas": 0}),
])  # fmt: skip
def test_no_events_are_listed_where_no_probe_can_say_something_new(steps: list[StreamEvent]) -> None:
    kube = FakeKube()
    assert "rolled out after 9 s" in Run((0.1, steps), kube=kube, timeout=9).message
    assert len(kube.asked) == (steps[-1].what == "listed")  # for the message


def test_a_sidecar_says_in_its_log_why_the_app_is_not_ready() -> None:
    """Of a probe by HTTP the kubelet tells the status alone."""
    status = "Startup probe failed: HTTP probe failed with statuscode: 503"
    starting = pod("talker-new-1", NEW, [app(ready=True)], status={"initContainerStatuses": [app(name="hooks")]})
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
    unready_old = pod("talker-old-1", OLD, [app()])
    done = Run((0.1, lists(RUNS, unready_old)), kube=FakeKube({"Event": events}), timeout=3)
    assert done.took == pytest.approx(3.1)
    assert "never" not in done.message.splitlines()[0]


def test_events_that_may_not_be_read_are_asked_for_once() -> None:
    kube = FakeKube(refuse=403)
    done = Run((0.1, lists(RUNS, old_pod)), kube=kube, timeout=20)
    assert done.took == pytest.approx(20.1)
    assert len(kube.asked) == 2  # and once for the message
    assert len(done.message.splitlines()) == 2


@pytest.mark.parametrize(
    ("message", "line"),
    [
        ("(combined from similar events): Startup probe failed: not ready: y", "Startup probe failed: not ready: y"),
        ("Startup probe failed: Traceback:\n  File\nOSError: z\n", "Startup probe failed: OSError: z"),
        ("Startup probe failed: cannot become ready: a\nwarning: b", "Startup probe failed: cannot become ready: a"),
        ('Startup probe errored: command "x" timed out', 'Startup probe errored: command "x" timed out'),
        ("Startup probe failed: ", "Startup probe failed: its command says nothing"),
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
