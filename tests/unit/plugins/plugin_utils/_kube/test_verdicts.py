# SPDX-License-Identifier: GPL-3.0-or-later
"""Rollout verdicts, a row for each state: a view of the cluster, the verdict, words of the reason, what has to last."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import Object, name_of
from ansible_collections.rosops.fleet.plugins.module_utils._step.words import READINESS
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import Ref, View, parse_refs, targets_for
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.pods import Verdict
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.verdicts import Tracker, judge, present_pods
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_objects import (
    LATER,
    NEW,
    NOON,
    NS,
    OLD,
    REVISIONS,
    conditions,
    container,
    controller_revision,
    daemon_set,
    deployment,
    gone_soon,
    obj,
    owner,
    pod,
    ref,
    replica_set,
    rolled,
    set_pod,
    unscheduled,
    waiting,
)

DEPLOYMENT, DAEMON, NODE = ref("Deployment"), ref("DaemonSet"), ref("Node", "robot1")
PVC = ref("PersistentVolumeClaim", "logs-pvc")
Row = tuple[Any, ...]  # a view, the verdict, words of the reason (all of it for a pass), the suspect, all references


def check(of: Ref, row: Row) -> None:
    view, wanted, words, suspect, refs = (*row, *(None, "", "", ())[len(row) - 1 :])
    verdict = judge(of, view, refs or (of,))
    assert (verdict.verdict, verdict.suspect) == (wanted, suspect), verdict
    assert (words in verdict.reason) if wanted != "pass" else words in ("", verdict.reason), verdict


def rows(table: dict[str, Row]) -> Any:
    return pytest.mark.parametrize("row", table.values(), ids=table)


new_pod, old_pod = pod("talker-new-1", NEW), pod("talker-old-1", OLD)
creating = waiting("ContainerCreating")
running = container(running={})
OPEN = {"updatedReplicas": 1, "availableReplicas": 0, "unavailableReplicas": 1}


def gated(says: str | None, kind: str = READINESS) -> Object:
    """A pod that waits for its gate, which is the keeper's or another one."""
    gates = {"readinessGates": [{"conditionType": kind}]}
    made = pod("talker-new-1", NEW, [container(ready=True, running={})], spec=gates)
    made["status"]["conditions"] += [] if says is None else [{"type": kind, "status": "False", "message": says}]
    return made


refused = {"type": "ReplicaFailure", "status": "True", "reason": "FailedCreate", "message": "exceeded quota: robot"}
EXCEEDED = "ProgressDeadlineExceeded"
starting = pod("talker-new-1", NEW, [running])
newer = pod("talker-new-1", NEW, [creating], metadata={"creationTimestamp": LATER})


def exceeded(when: str) -> Object:
    message = 'ReplicaSet "talker-new" has timed out progressing.'
    said = {"type": "Progressing", "status": "False", "reason": EXCEEDED, "message": message}
    return {**said, "lastTransitionTime": when}


def after(*seen: Object, **status: Any) -> View:
    """The controller has said this; one new pod counts."""
    return rolled(*seen, status={"updatedReplicas": 1, "replicas": 2, **status})


def left_of(replicas: str) -> Object:
    return gone_soon(pod(f"{replicas}-x", owner("ReplicaSet", replicas)))


DONE = "1 of 1 pods updated and available"
SETS = replica_set("talker-old", "1"), replica_set("talker-new", "2")


@rows(
    {
        "rolled out": (rolled(new_pod), "pass", DONE),
        "one replica is the default": (View([{**deployment(), "spec": {}}, *SETS, new_pod]), "pass", DONE),
        "generation unseen": (rolled(new_pod, status={"observedGeneration": 1}), "wait", "generation 2"),
        "no status yet": (View([obj("Deployment", "talker", generation=1)]), "wait", "generation 1"),
        "being deleted": (View([gone_soon(deployment())]), "wait", "being deleted"),
        "only the old one seen": (View([deployment(), replica_set("talker-old", "1"), old_pod]), "wait", "0 pods seen"),
        "replica set unseen, no pod wanted": (View([deployment(0)]), "wait", "its replica set has not been seen"),
        # those that kubernetes.core's waiters misjudge (measured with its 6.2.0 and 6.6.0), and the like
        "1 of 3 updated": (
            rolled(new_pod, old_pod, replicas=3, status={"updatedReplicas": 1, "unavailableReplicas": 0}),
            "wait",
            "1 of 3 pods updated",
        ),
        "paused, new template": (
            rolled(old_pod, paused=True, status={"updatedReplicas": 0}), "wait", "resume it", "Paused",
        ),
        "paused but done": (rolled(new_pod, paused=True), "pass", f"{DONE}, paused"),
        "readiness gate": (rolled(gated(None, "a/b"), status=OPEN), "wait", "readiness gate a/b is not True"),
        "our gate, and nobody looked": (rolled(gated(None), status=OPEN), "wait", "nobody has looked at it yet"),
        "our gate says why not": (rolled(gated("not ready: /t"), status=OPEN), "wait", "talker-new-1: not ready: /t"),
        "our gate will never open": (
            after(gated("cannot become ready: topic /t"), old_pod), "fail", "pod talker-new-1: cannot become ready: to",
        ),
        "not ready": (
            rolled(starting, status=OPEN), "wait", "0 of 1 pods available: pod talker-new-1, container ros-app: not r",
        ),
        "unavailable by number": (rolled(new_pod, status={"unavailableReplicas": 1}), "wait", "1 of 1 pods available"),
        "old pod terminates": (rolled(new_pod, gone_soon(old_pod)), "wait", "talker-old-1 is terminating on"),
        "old pod still there": (rolled(new_pod, old_pod), "wait", "talker-old-1 still runs on robot1"),
        "own pod terminates": (rolled(new_pod, gone_soon(pod("talker-new-0", NEW))), "wait", "terminating"),
        "old pod of a deleted replica set": (rolled(new_pod, left_of("talker-4f5")), "wait", "talker-4f5-x is term"),
        "another app's pod": (rolled(new_pod, left_of("talker-b-4f5")), "pass", DONE),
        "old pods by number only": (rolled(new_pod, status={"replicas": 2}), "wait", "1 old pods left"),
        "the old pod crashes": (
            rolled(new_pod, pod("talker-old-1", OLD, [waiting("CrashLoopBackOff", restartCount=2)])),
            "wait",
            "old pod talker-old-1",
        ),
        "scaled to nothing": (rolled(replicas=0), "pass", "0 of 0 pods updated and available"),
        "scaled to nothing, pod left": (rolled(new_pod, replicas=0), "wait", "1 pods seen, 0 wanted"),
        "deadline exceeded": (after(starting, old_pod, conditions=[exceeded(LATER)]), "fail", f"{EXCEEDED}: Replica"),
        "deadline exceeded by the template before this one": (
            after(newer, old_pod, conditions=[exceeded(NOON)]), "wait", EXCEEDED, EXCEEDED,
        ),
        "pods refused, and the deadline has passed over it": (
            after(old_pod, updatedReplicas=0, conditions=[refused, exceeded(NOON)]),
            "wait",
            "exceeded quota",
            "ReplicaFailure",
        ),
        "pods refused while an old one still takes the quota": (
            after(gone_soon(old_pod), updatedReplicas=0, conditions=[refused]), "wait", "exceeded quota",
        ),
        "and the deadline has passed over that": (
            after(gone_soon(old_pod), updatedReplicas=0, conditions=[refused, exceeded(NOON)]),
            "wait",
            EXCEEDED,
            EXCEEDED,
        ),
    }
)  # fmt: skip
def test_deployment(row: Row) -> None:
    check(DEPLOYMENT, row)


crashed = waiting(
    "CrashLoopBackOff",
    "back-off 20s restarting failed container",
    restartCount=3,
    lastState={"terminated": {"exitCode": 1, "reason": "Error", "message": "ImportError: rospy"}},
)
NO_PYTHON = 'error during container init: exec: "python3": executable file not found in $PATH: unknown'
HINT = "executable file not found in $PATH (the image has no Python 3.8 for our code in the pod: write hooks: sidecar"
unbound = "0/3 nodes are available: pod has unbound immediate PersistentVolumeClaims."
no_room = unscheduled("talker-new-1", NEW, "0/3 nodes are available: 3 Insufficient memory.")
ended = container(terminated={"exitCode": 1, "reason": "Error"})
once = {"restartCount": 1, "lastState": ended["state"]}
setup = {"initContainerStatuses": [waiting("ImagePullBackOff", name="setup")]}
NOWHERE = {"spec": {"nodeName": None}, "status": {"conditions": []}}


def with_pod(*pods: Object) -> View:
    return rolled(*pods, status=OPEN)


def with_container(state: Object) -> View:
    return with_pod(pod("talker-new-1", NEW, [state]))


@rows(
    {
        **{
            reason: (with_container(waiting(reason, "not found")), "fail", f"{reason}: image lab/apps:1.0: not")
            for reason in ("ErrImagePull", "ImagePullBackOff", "InvalidImageName", "ErrImageNeverPull")
        },
        "crash loop": (with_container(crashed), "fail", "ros-app: CrashLoopBackOff: 3 restarts, last exit code 1"),
        "an image without Python": (
            with_container({**crashed, "lastState": {"terminated": {"exitCode": 128, "message": NO_PYTHON}}}),
            "fail",
            f"{HINT}, with host_network hooks: none): unknown",
        ),
        "an image without Python, before its first start": (
            with_container(waiting("RunContainerError", NO_PYTHON)), "wait", HINT, "RunContainerError",
        ),
        "a first crash is not a loop": (with_container(ended), "wait", "ended with exit code 1 (Error)"),
        "a back-off before any restart": (
            with_container(waiting("CrashLoopBackOff")), "wait", "0 restarts", "CrashLoopBackOff",
        ),
        "restarted and running": (with_container({**running, **once}), "wait", "not ready"),
        "missing configuration": (
            with_container(waiting("CreateContainerConfigError", 'configmap "params" not found')),
            "fail",
            'CreateContainerConfigError: configmap "params" not found',
        ),
        "configuration not synced yet": (
            with_container(waiting("CreateContainerConfigError", "failed to sync configmap cache: timed out")),
            "wait",
            "",
            "CreateContainerConfigError",
        ),
        "init container's image": (
            with_pod(pod("talker-new-1", NEW, [], status=setup)), "fail", "container setup: ImagePullBackOff",
        ),
        "unschedulable": (with_pod(no_room), "wait", "Insufficient memory", "Unschedulable"),
        "unschedulable while another pod makes room": (with_pod(no_room, gone_soon(old_pod)), "wait"),
        "its volume is being made": (with_pod(unscheduled("talker-new-1", NEW, unbound)), "wait", "unbound immediate"),
        "not scheduled yet": (with_pod(pod("talker-new-1", NEW, [], **NOWHERE)), "wait", "not scheduled yet"),
        "a pod on its way out": (rolled(gone_soon(pod("talker-0", NEW, [crashed])), new_pod), "wait", "is terminating"),
    }
)  # fmt: skip
def test_pods(row: Row) -> None:
    check(DEPLOYMENT, row)


def two(first: str, second: str, containers: list[Object] | None = None) -> list[Object]:
    return [set_pod("talker-0", first), set_pod("talker-1", second, containers)]


def daemon(*objects: Object, desired: int = 2, **more: Any) -> View:
    return View([daemon_set(desired, **more), *REVISIONS, *objects])


of_namesake = pod("talker-2", owner("DaemonSet", "talker", "uid-of-one-that-is-deleted"))
of_namesake["metadata"]["labels"] = {"controller-revision-hash": "new"}
BY_HAND = {"updateStrategy": {"type": "OnDelete"}}


@rows(
    {
        "rolled out": (daemon(*two("new", "new")), "pass", "2 of 2 pods available"),
        "revision unseen": (View([daemon_set(), *two("new", "new")]), "wait", "its controller revision has not been"),
        "one unavailable": (
            daemon(*two("new", "new", [creating]), status={"numberAvailable": 1, "numberUnavailable": 1}),
            "wait",
            "1 of 2 pods available: pod talker-1, container ros-app: ContainerCreating",
        ),
        # numberAvailable may be that of the generation before
        "one unavailable by its number": (
            daemon(*two("new", "new"), status={"numberAvailable": 2, "numberUnavailable": 1}), "wait", "1 of 2 pods",
        ),
        "one old pod": (daemon(*two("old", "new")), "wait", "old pod"),
        "OnDelete": (
            daemon(*two("old", "old"), status={"updatedNumberScheduled": 0}, **BY_HAND),
            "pass",
            "2 of 2 pods available, 2 left at an older revision (OnDelete)",
        ),
        "OnDelete, one deleted": (
            daemon(set_pod("talker-a", "old"), gone_soon(set_pod("talker-b", "old")), **BY_HAND),
            "wait",
            "talker-b is terminating",
        ),
        "a pod of a deleted namesake": (daemon(*two("new", "new"), of_namesake), "wait", "old pod talker-2 still runs"),
        "no node wants it": (daemon(desired=0), "pass", "no node wants it"),
        "kept on a node that is no longer chosen": (daemon(*two("new", "new"), desired=1), "pass"),
        "back to an earlier template": (
            View([daemon_set(), controller_revision("new", 3), controller_revision("bad", 2), *two("new", "new")]),
            "pass",
        ),
        "bad image": (daemon(*two("old", "new", [waiting("ImagePullBackOff")])), "fail", "ImagePullBackOff"),
    }
)  # fmt: skip
def test_daemon_set(row: Row) -> None:
    check(DAEMON, row)


def claim(phase: str = "Pending", storage_class: str | None = "local-path") -> Object:
    spec = {"storageClassName": storage_class, "volumeName": "pv1"}
    return obj("PersistentVolumeClaim", "logs-pvc", spec, {"phase": phase})


def user(**spec: object) -> Object:
    volumes = [{"name": "logs", "persistentVolumeClaim": {"claimName": "logs-pvc"}}]
    return obj("Deployment", "talker", {"template": {"spec": {"volumes": volumes}}, **spec})


def storage_class(mode: str) -> Object:
    return {**obj("StorageClass", "local-path"), "volumeBindingMode": mode}


def elsewhere(made: Object) -> Object:
    return {**made, "metadata": {**made["metadata"], "namespace": "robot-other"}}


ELSEWHERE = Ref("Deployment", "talker", "robot-other")
LAZY, BOTH = storage_class("WaitForFirstConsumer"), (PVC, DEPLOYMENT)
FREE = "waits for its first consumer, and none of the given workloads is one"
unreadable = View([claim()])
unreadable.hidden.add("StorageClass")


@rows(
    {
        "bound": (View([claim("Bound"), LAZY]), "pass", "bound to pv1"),
        "lost": (View([claim("Lost"), LAZY]), "fail", "Lost"),
        "being deleted": (View([gone_soon(claim("Bound"))]), "wait", "being deleted"),
        "no consumer given": (View([claim(), LAZY, user()]), "pass", FREE),
        "a consumer": (View([claim(), LAZY, user()]), "wait", "the pod of Deployment talker", "", BOTH),
        "a consumer elsewhere": (View([claim(), LAZY, elsewhere(user())]), "pass", FREE, "", (PVC, ELSEWHERE)),
        "a consumer without pods": (View([claim(), LAZY, user(replicas=0)]), "pass", FREE, "", BOTH),
        "immediate": (View([claim(), storage_class("Immediate")]), "wait", "no volume is bound yet"),
        "no such class": (View([claim()]), "wait", "storage class local-path does not exist"),
        "no class named": (View([claim(storage_class=None)]), "wait", "none is the default"),
        "classes not readable": (unreadable, "wait", "may not read storage classes"),
    }
)
def test_claim(row: Row) -> None:
    check(PVC, row)


READY: Object = {"type": "Ready", "status": "True"}
not_ready: Object = {"type": "Ready", "status": "False", "reason": "KubeletNotReady", "message": "no network yet"}
full: Object = {"type": "DiskPressure", "status": "True", "message": "a full disk"}


def node(*said: Object, ready: Object = READY, unschedulable: bool = False) -> View:
    return View([obj("Node", "robot1", {"unschedulable": unschedulable}, {"conditions": [ready, *said]})])


@rows(
    {
        "ready": (node(), "pass", "Ready"),
        "cordoned": (node(unschedulable=True), "pass", "Ready, cordoned"),
        "not ready": (node(ready=not_ready), "wait", "NotReady: KubeletNotReady: no network yet"),
        "nobody says why": (node(ready={"type": "Ready", "status": "Unknown"}), "wait", "NotReady"),
        "pressure": (node(full), "wait", "DiskPressure: a full disk"),
        "no network": (node(*conditions(NetworkUnavailable="True")), "wait", "NetworkUnavailable"),
    }
)
def test_node(row: Row) -> None:
    check(NODE, row)


def test_what_has_no_rollout() -> None:
    check(ref("ConfigMap"), (View(), "pass", "a ConfigMap has no rollout"))
    check(ref("Job", api_version="batch.volcano.sh/v1alpha1"), (View(), "pass", "a Job has no rollout"))
    check(ref("Deployment", api_version="apps/v1"), (View(), "wait", "not there yet"))


@pytest.mark.parametrize(
    ("of", "objects", "spoiling"),
    [
        (DEPLOYMENT, [deployment(), *SETS, new_pod], [replica_set("talker-x", "9"), pod("x", OLD)]),
        (DAEMON, [daemon_set(), *REVISIONS, *two("new", "new")], [controller_revision("z", 3), set_pod("x", "old")]),
    ],
)
def test_namesakes_in_another_namespace_do_not_count(of: Ref, objects: list[Object], spoiling: list[Object]) -> None:
    alone = judge(of, View(objects))
    assert alone.verdict == "pass"
    assert judge(of, View([*objects, *map(elsewhere, spoiling)])) == alone
    beside = View([*objects, *map(elsewhere, objects[1:])])
    assert present_pods(of, beside) == present_pods(of, View(objects))


@pytest.mark.parametrize(("old", "new", "end"), [
    (1, 0, "on robot1"), (2, 0, " and 1 more"), (3, 0, " and 2 more"),
    (0, 3, ": ContainerCreating"), (0, 4, "; and 1 more"), (0, 6, "; and 3 more"),
])  # fmt: skip
def test_pods_are_named_up_to_a_few_and_the_others_counted(old: int, new: int, end: str) -> None:
    pods = [pod(f"talker-old-{number}", OLD) for number in range(old)]
    pods += [pod(f"talker-new-{number}", NEW, [creating]) for number in range(new)]
    status = {"availableReplicas": 0, "unavailableReplicas": new} if new else {}
    words = judge(DEPLOYMENT, rolled(*pods, *([] if new else [new_pod]), replicas=new or 1, status=status)).reason
    assert words.count("pod talker-") == (3 if new else 1), words
    assert words.endswith(end), words


DOUBT = Verdict("wait", "no room", suspect="Unschedulable")


def test_a_suspicion_fails_only_when_it_lasts_and_each_object_has_its_own() -> None:
    tracker, other_words = Tracker(grace=10), Verdict("wait", "no room at all", suspect="Unschedulable")
    assert tracker.settle(DEPLOYMENT, DOUBT, now=100).verdict == "wait"
    assert tracker.due() == 110
    assert tracker.settle(DAEMON, DOUBT, now=105).verdict == "wait"
    assert tracker.settle(DEPLOYMENT, other_words, now=109.9).verdict == "wait"
    assert tracker.settle(DEPLOYMENT, other_words, now=110).verdict == "fail"
    assert tracker.settle(DAEMON, DOUBT, now=110).verdict == "wait"


@pytest.mark.parametrize("between", [Verdict("wait", "starting"), Verdict("wait", "quota", suspect="ReplicaFailure")])
def test_a_suspicion_that_went_away_starts_over(between: Verdict) -> None:
    tracker = Tracker(grace=10)
    tracker.settle(DEPLOYMENT, DOUBT, now=100)
    tracker.settle(DEPLOYMENT, between, now=105)
    assert tracker.settle(DEPLOYMENT, DOUBT, now=111).verdict == "wait"
    assert tracker.due() == 121


# --- references -----------------------------------------------------------------------------------------------------


def test_references_and_definitions_are_read_alike() -> None:
    full = {"apiVersion": "apps/v1", "kind": "Deployment", "metadata": {"name": "talker", "namespace": NS}, "spec": {}}
    short = {"kind": "Deployment", "name": "talker", "namespace": NS, "api_version": "apps/v1"}
    node_ref = {"kind": "Node", "name": "robot1", "namespace": "ignored"}
    job = {"apiVersion": "batch.volcano.sh/v1alpha1", "kind": "Job", "metadata": {"name": "x"}}  # of another API
    assert parse_refs([full, short, node_ref, job]) == [
        Ref("Deployment", "talker", NS, "apps/v1"),
        NODE,
        Ref("Job", "x", "", "batch.volcano.sh/v1alpha1"),
    ]


def test_all_errors_of_the_references_at_once() -> None:
    with pytest.raises(SpecError) as error:
        parse_refs([{"kind": "Deployment", "name": "talker"}, {"metadata": {"name": "x"}}, {"kind": "ConfigMap"}])
    assert str(error.value) == "objects[0].namespace: missing; objects[1].kind: missing; objects[2].name: missing"


@pytest.mark.parametrize("kind", ["StatefulSet", "ReplicaSet", "Job", "Pod", "ReplicationController"])
def test_kinds_whose_rollout_nobody_judges_are_refused(kind: str) -> None:
    with pytest.raises(SpecError) as error:
        parse_refs([{"kind": "ConfigMap", "name": "x"}, {"kind": kind, "name": "talker", "namespace": NS}])
    assert str(error.value) == (
        f"objects[1].kind: is {kind}, whose rollout is not judged here; "
        "allowed: Deployment, DaemonSet, PersistentVolumeClaim, Node, and kinds that have no rollout"
    )


def test_what_is_watched() -> None:
    found = targets_for([DEPLOYMENT, PVC, NODE, ref("Secret"), ref("Deployment", api_version="apps.example.org/v1")])
    assert {(one.kind, one.namespace) for one in found} == {
        *((kind, NS) for kind in ("Deployment", "ReplicaSet", "Pod", "PersistentVolumeClaim")),
        ("StorageClass", ""),
        ("Node", ""),
    }
    assert Ref("StorageClass", "").path == "/apis/storage.k8s.io/v1/storageclasses"
    assert Ref("NetworkPolicy", "", NS).path == f"/apis/networking.k8s.io/v1/namespaces/{NS}/networkpolicies"


def test_a_fresh_listing_replaces_what_was_known() -> None:
    view = rolled(new_pod, old_pod)
    view.replace("Pod", NS, [new_pod])
    assert judge(DEPLOYMENT, view).verdict == "pass"
    view.replace("Pod", "elsewhere", [])
    assert judge(DEPLOYMENT, view).verdict == "pass"
    view.drop("Pod", new_pod)
    assert judge(DEPLOYMENT, view).verdict == "wait"


# --- whose news count -----------------------------------------------------------------------------------------------


def names(of: Ref, view: View) -> list[str]:
    return [name_of(one) for one in present_pods(of, view)]


def test_present_pods_of_a_deployment_are_those_of_its_newest_replica_set() -> None:
    pods = (pod("new-1", NEW), pod("old-1", OLD), gone_soon(pod("new-2", NEW)), pod("other", owner("ReplicaSet", "x")))
    assert names(DEPLOYMENT, rolled(*pods)) == ["new-1"]
    # the controller has not seen the new template: what is newest now is the old one
    assert names(DEPLOYMENT, rolled(*pods, status={"observedGeneration": 1})) == []
    assert names(DEPLOYMENT, rolled(*pods, revision="3")) == []


def test_present_pods_of_a_daemon_set_are_those_of_its_revision() -> None:
    assert names(DAEMON, daemon(*two("old", "new"), of_namesake)) == ["talker-1"]
    assert names(DAEMON, View([daemon_set(), *two("old", "new")])) == []
    assert names(ref("ConfigMap"), View([pod("talker", [])])) == names(NODE, node()) == []
