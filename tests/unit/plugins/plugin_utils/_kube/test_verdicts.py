# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rollout verdicts, row by row: a view of the cluster, the verdict, words of the reason, what has to last."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import Object
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


@dataclass
class Case:
    name: str
    ref: Ref
    view: View
    verdict: str
    words: str = ""
    suspect: str = ""
    refs: tuple[Ref, ...] = ()


def check(case: Case) -> None:
    verdict = judge(case.ref, case.view, case.refs or (case.ref,))
    assert verdict.verdict == case.verdict, verdict
    assert case.words in verdict.reason, verdict
    assert verdict.suspect == case.suspect, verdict


DEPLOYMENT, DAEMON = ref("Deployment"), ref("DaemonSet")
new_pod, old_pod = pod("talker-new-1", NEW), pod("talker-old-1", OLD)
starting = pod("talker-new-1", NEW, [waiting("ContainerCreating")])
gated = pod(
    "talker-new-1",
    NEW,
    [container(ready=True, running={})],
    spec={"readinessGates": [{"conditionType": "ros/graph"}]},
)

# The states that kubernetes.core's waiters misjudge (measured with its 6.2.0 and 6.6.0), one row each.
OTHERS_FAIL = [
    Case(
        "0 of 1 updated: not ready",
        DEPLOYMENT,
        rolled(old_pod, status={"updatedReplicas": 0, "unavailableReplicas": 0}),
        "wait",
        "0 of 1 pods updated",
    ),
    Case(
        "1 of 3 updated: not ready",
        DEPLOYMENT,
        rolled(
            new_pod,
            pod("talker-old-1", OLD),
            pod("talker-old-2", OLD),
            replicas=3,
            status={"updatedReplicas": 1, "unavailableReplicas": 0},
        ),
        "wait",
        "1 of 3 pods updated",
    ),
    Case(
        "paused, new template: not ready",
        DEPLOYMENT,
        rolled(old_pod, paused=True, status={"updatedReplicas": 0}),
        "wait",
        "paused",
        "Paused",
    ),
    Case(
        "readinessGate False: not ready",
        DEPLOYMENT,
        rolled(gated, status={"availableReplicas": 0, "unavailableReplicas": 1}),
        "wait",
        "readiness gate ros/graph is not True",
    ),
    Case(
        "DaemonSet, one unavailable: not ready",
        DAEMON,
        View(
            [
                daemon_set(status={"numberAvailable": 1, "numberUnavailable": 1}),
                *REVISIONS,
                set_pod("talker-a", "new"),
                set_pod("talker-b", "new", [waiting("ContainerCreating")]),
            ]
        ),
        "wait",
        "1 of 2 pods available: pod talker-b, container ros-app: ContainerCreating",
    ),
    Case(
        "DaemonSet OnDelete: ready",
        DAEMON,
        View(
            [
                daemon_set(status={"updatedNumberScheduled": 0}, updateStrategy={"type": "OnDelete"}),
                *REVISIONS,
                set_pod("talker-a", "old"),
                set_pod("talker-b", "old"),
            ]
        ),
        "pass",
        "2 left at an older revision (OnDelete)",
    ),
    *(
        Case(f"{kind} missing: waited for", ref(kind), View(), "wait", "is not there yet")
        for kind in ("Deployment", "DaemonSet", "Node", "PersistentVolumeClaim")
    ),
]


@pytest.mark.parametrize("case", OTHERS_FAIL, ids=lambda case: case.name)
def test_states_that_other_waiters_misjudge(case: Case) -> None:
    check(case)


def exceeded(when: str) -> Object:
    progressing = {
        "type": "Progressing",
        "status": "False",
        "reason": "ProgressDeadlineExceeded",
        "message": 'ReplicaSet "talker-new" has timed out progressing.',
        "lastTransitionTime": when,
    }
    return {"updatedReplicas": 1, "replicas": 2, "conditions": [progressing]}


refused = {
    "type": "ReplicaFailure",
    "status": "True",
    "reason": "FailedCreate",
    "message": "exceeded quota: robot",
}
DEPLOYMENTS = [
    Case("rolled out", DEPLOYMENT, rolled(new_pod), "pass", "1 of 1 pods"),
    Case("generation unseen", DEPLOYMENT, rolled(new_pod, status={"observedGeneration": 1}), "wait", "generation 2"),
    Case("no status yet", DEPLOYMENT, View([obj("Deployment", "talker", generation=1)]), "wait", "generation 1"),
    Case("being deleted", DEPLOYMENT, View([gone_soon(deployment())]), "wait", "being deleted"),
    Case("replica set unseen", DEPLOYMENT, View([deployment(), new_pod]), "wait", "0 pods seen, 1 wanted"),
    Case(
        "only the old replica set seen",
        DEPLOYMENT,
        View([deployment(), replica_set("talker-old", "1"), old_pod]),
        "wait",
        "0 pods seen",
    ),
    Case(
        "old pod terminates", DEPLOYMENT, rolled(new_pod, gone_soon(old_pod)), "wait", "talker-old-1 is terminating on"
    ),
    Case("old pod still there", DEPLOYMENT, rolled(new_pod, old_pod), "wait", "talker-old-1 still runs on robot1"),
    Case("own pod terminates", DEPLOYMENT, rolled(new_pod, gone_soon(pod("talker-new-0", NEW))), "wait", "terminating"),
    Case(
        "old pod of a deleted replica set",
        DEPLOYMENT,
        rolled(new_pod, gone_soon(pod("talker-4f5-x", owner("ReplicaSet", "talker-4f5")))),
        "wait",
        "talker-4f5-x is terminating",
    ),
    Case(
        "another app's pod does not count",
        DEPLOYMENT,
        rolled(new_pod, gone_soon(pod("talker-b-4f5-x", owner("ReplicaSet", "talker-b-4f5")))),
        "pass",
    ),
    Case("old pods by number only", DEPLOYMENT, rolled(new_pod, status={"replicas": 2}), "wait", "1 old pods left"),
    Case(
        "unavailable",
        DEPLOYMENT,
        rolled(starting, status={"availableReplicas": 0, "unavailableReplicas": 1}),
        "wait",
        "0 of 1 pods available: pod talker-new-1, container ros-app: ContainerCreating",
    ),
    Case(
        "readiness probe not passed",
        DEPLOYMENT,
        rolled(pod("talker-new-1", NEW, [container(running={})]), status={"availableReplicas": 0}),
        "wait",
        "container ros-app: not ready yet",
    ),
    Case("scaled to nothing", DEPLOYMENT, rolled(replicas=0), "pass", "0 of 0"),
    Case("scaled to nothing, pod left", DEPLOYMENT, rolled(new_pod, replicas=0), "wait", "1 pods seen, 0 wanted"),
    Case("paused but done", DEPLOYMENT, rolled(new_pod, paused=True), "pass", "paused"),
    Case(
        "paused half way",
        DEPLOYMENT,
        rolled(new_pod, old_pod, paused=True, replicas=2, status={"updatedReplicas": 1}),
        "wait",
        "resume it",
        "Paused",
    ),
    Case(
        "deadline exceeded",
        DEPLOYMENT,
        rolled(pod("talker-new-1", NEW, [container(running={})]), old_pod, status=exceeded(LATER)),
        "fail",
        "ProgressDeadlineExceeded: ReplicaSet",
    ),
    Case(
        "deadline exceeded by the template before this one",
        DEPLOYMENT,
        rolled(
            pod("talker-new-1", NEW, [waiting("ContainerCreating")], metadata={"creationTimestamp": LATER}),
            old_pod,
            status=exceeded(NOON),
        ),
        "wait",
        "ProgressDeadlineExceeded",
        "ProgressDeadlineExceeded",
    ),
    Case(
        "pods refused",
        DEPLOYMENT,
        rolled(status={"updatedReplicas": 0, "replicas": 0, "conditions": [refused]}),
        "wait",
        "exceeded quota",
        "ReplicaFailure",
    ),
    Case(
        "pods refused, and the deadline has passed over it",
        DEPLOYMENT,
        rolled(old_pod, status={"updatedReplicas": 0, "conditions": [refused, *exceeded(NOON)["conditions"]]}),
        "wait",
        "exceeded quota",
        "ReplicaFailure",
    ),
    Case(
        "pods refused while an old one still takes the quota",
        DEPLOYMENT,
        rolled(gone_soon(old_pod), status={"updatedReplicas": 0, "conditions": [refused]}),
        "wait",
        "exceeded quota",
    ),
    Case(
        "the old pod's crash loop is no failure of the new one",
        DEPLOYMENT,
        rolled(new_pod, pod("talker-old-1", OLD, [waiting("CrashLoopBackOff", restartCount=2)])),
        "wait",
        "old pod talker-old-1",
    ),
]


@pytest.mark.parametrize("case", DEPLOYMENTS, ids=lambda case: case.name)
def test_deployment(case: Case) -> None:
    check(case)


crashed = waiting(
    "CrashLoopBackOff",
    "back-off 20s restarting failed container",
    restartCount=3,
    lastState={"terminated": {"exitCode": 1, "reason": "Error", "message": "ImportError: rospy"}},
)
NO_PYTHON = 'error during container init: exec: "python3": executable file not found in $PATH: unknown'
unbound = "0/3 nodes are available: pod has unbound immediate PersistentVolumeClaims."
no_room = "0/3 nodes are available: 3 Insufficient memory."
OPEN = {"updatedReplicas": 1, "availableReplicas": 0, "unavailableReplicas": 1}


def new_container(state: Object) -> View:
    return rolled(pod("talker-new-1", NEW, [state]), status=OPEN)


PODS = [
    *(
        Case(
            reason,
            DEPLOYMENT,
            new_container(waiting(reason, "not found")),
            "fail",
            f"{reason}: image lab/apps:1.0: not",
        )
        for reason in ("ErrImagePull", "ImagePullBackOff", "InvalidImageName", "ErrImageNeverPull")
    ),
    Case(
        "crash loop",
        DEPLOYMENT,
        new_container(crashed),
        "fail",
        "container ros-app: CrashLoopBackOff: 3 restarts, last exit code 1 (Error): ImportError",
    ),
    Case(
        "an image without Python",
        DEPLOYMENT,
        new_container({**crashed, "lastState": {"terminated": {"exitCode": 128, "message": NO_PYTHON}}}),
        "fail",
        'exec: "python3": executable file not found in $PATH (the image has no Python 3.8 for our code in the pod: '
        "write hooks: sidecar, with host_network hooks: none): unknown",
    ),
    Case(
        "an image without Python, before its first start",
        DEPLOYMENT,
        new_container(waiting("RunContainerError", NO_PYTHON)),
        "wait",
        "executable file not found in $PATH (the image has no Python 3.8 for our code in the pod: write hooks: sidecar",
        "RunContainerError",
    ),
    Case(
        "a first crash is not a loop",
        DEPLOYMENT,
        new_container(container(terminated={"exitCode": 1, "reason": "Error"})),
        "wait",
        "ended with exit code 1 (Error)",
    ),
    Case(
        "a back-off before any restart is not a loop yet",
        DEPLOYMENT,
        new_container(waiting("CrashLoopBackOff")),
        "wait",
        "0 restarts",
        "CrashLoopBackOff",
    ),
    Case(
        "restarted once and running",
        DEPLOYMENT,
        new_container({**container(running={}), "restartCount": 1, "lastState": {"terminated": {"exitCode": 1}}}),
        "wait",
        "not ready yet",
    ),
    Case(
        "missing configuration",
        DEPLOYMENT,
        new_container(waiting("CreateContainerConfigError", 'configmap "params" not found')),
        "fail",
        'CreateContainerConfigError: configmap "params" not found',
    ),
    Case(
        "configuration not synced yet",
        DEPLOYMENT,
        new_container(waiting("CreateContainerConfigError", "failed to sync configmap cache: timed out")),
        "wait",
        suspect="CreateContainerConfigError",
    ),
    Case(
        "no such command",
        DEPLOYMENT,
        new_container(waiting("RunContainerError", 'exec: "talkerr": not found')),
        "wait",
        "talkerr",
        "RunContainerError",
    ),
    Case(
        "init container's image",
        DEPLOYMENT,
        rolled(
            pod("talker-new-1", NEW, [], status={"initContainerStatuses": [waiting("ImagePullBackOff", name="setup")]}),
            status=OPEN,
        ),
        "fail",
        "container setup: ImagePullBackOff",
    ),
    Case(
        "unschedulable",
        DEPLOYMENT,
        rolled(unscheduled("talker-new-1", NEW, no_room), status=OPEN),
        "wait",
        "Insufficient memory",
        "Unschedulable",
    ),
    Case(
        "unschedulable while another pod makes room",
        DEPLOYMENT,
        rolled(unscheduled("talker-new-1", NEW, no_room), gone_soon(old_pod), status=OPEN),
        "wait",
    ),
    Case(
        "its volume is being made",
        DEPLOYMENT,
        rolled(unscheduled("talker-new-1", NEW, unbound), status=OPEN),
        "wait",
        "unbound immediate",
    ),
    Case(
        "not scheduled yet",
        DEPLOYMENT,
        rolled(pod("talker-new-1", NEW, [], spec={"nodeName": None}, status={"conditions": []}), status=OPEN),
        "wait",
        "not scheduled yet",
    ),
    Case(
        "a pod on its way out has no trouble",
        DEPLOYMENT,
        rolled(gone_soon(pod("talker-new-0", NEW, [crashed])), new_pod),
        "wait",
        "is terminating",
    ),
]


@pytest.mark.parametrize("case", PODS, ids=lambda case: case.name)
def test_pods(case: Case) -> None:
    check(case)


def two(first: str, second: str, containers: list[Object] | None = None) -> list[Object]:
    return [set_pod("talker-0", first), set_pod("talker-1", second, containers)]


OF_OTHER = {"name": "talker-new", "namespace": NS, "ownerReferences": owner("DaemonSet", "talker", "uid-other")}
LABELLED = {"controller-revision-hash": "new"}


SETS = [
    Case("rolled out", DAEMON, View([daemon_set(), *REVISIONS, *two("new", "new")]), "pass", "2 of 2"),
    Case("generation unseen", DAEMON, View([daemon_set(status={"observedGeneration": 1})]), "wait", "generation"),
    Case(
        "OnDelete, one deleted",
        DAEMON,
        View(
            [
                daemon_set(updateStrategy={"type": "OnDelete"}),
                *REVISIONS,
                set_pod("talker-a", "old"),
                gone_soon(set_pod("talker-b", "old")),
            ]
        ),
        "wait",
        "talker-b is terminating",
    ),
    Case(
        "pods of a deleted namesake",
        DAEMON,
        View(
            [
                {**daemon_set(), "metadata": {**daemon_set()["metadata"], "uid": "uid-other"}},
                {**controller_revision("new", 2), "metadata": {**OF_OTHER, "labels": LABELLED}},
                *two("new", "new"),
            ]
        ),
        "wait",
        "still runs",
    ),
    Case("revision unseen", DAEMON, View([daemon_set(), *two("new", "new")]), "wait", "revision has not"),
    Case("one old pod", DAEMON, View([daemon_set(), *REVISIONS, *two("old", "new")]), "wait", "old pod"),
    Case("no node wants it", DAEMON, View([daemon_set(0), *REVISIONS]), "pass", "no node wants it"),
    Case(
        "kept on a node that is no longer chosen",
        DAEMON,
        View([daemon_set(1), *REVISIONS, *two("new", "new")]),
        "pass",
    ),
    Case(
        "back to an earlier template",
        DAEMON,
        View(
            [
                daemon_set(),
                controller_revision("new", 3),
                controller_revision("bad", 2),
                *two("new", "new"),
            ]
        ),
        "pass",
    ),
    Case(
        "bad image",
        DAEMON,
        View([daemon_set(), *REVISIONS, *two("old", "new", containers=[waiting("ImagePullBackOff")])]),
        "fail",
        "ImagePullBackOff",
    ),
]


@pytest.mark.parametrize("case", SETS, ids=lambda case: f"{case.ref.kind}: {case.name}")
def test_sets(case: Case) -> None:
    check(case)


def claim(phase: str = "Pending", storage_class: str | None = "local-path") -> Object:
    return obj(
        "PersistentVolumeClaim", "logs-pvc", {"storageClassName": storage_class, "volumeName": "pv1"}, {"phase": phase}
    )


def user(kind: str = "Deployment", **spec: object) -> Object:
    volumes = [{"name": "logs", "persistentVolumeClaim": {"claimName": "logs-pvc"}}]
    return obj(kind, "talker", {"template": {"spec": {"volumes": volumes}}, **spec})


def storage_class(mode: str) -> Object:
    return {**obj("StorageClass", "local-path"), "volumeBindingMode": mode}


PVC, LAZY = ref("PersistentVolumeClaim", "logs-pvc"), storage_class("WaitForFirstConsumer")
unreadable = View([claim()])
unreadable.hidden.add("StorageClass")
CLAIMS = [
    Case("bound", PVC, View([claim("Bound"), LAZY]), "pass", "bound to pv1"),
    Case("lost", PVC, View([claim("Lost"), LAZY]), "fail", "Lost"),
    Case("no consumer given", PVC, View([claim(), LAZY, user()]), "pass", "first consumer"),
    Case(
        "a given consumer",
        PVC,
        View([claim(), LAZY, user()]),
        "wait",
        "the pod of Deployment talker",
        "",
        (PVC, DEPLOYMENT),
    ),
    Case(
        "a given consumer without pods", PVC, View([claim(), LAZY, user(replicas=0)]), "pass", "", "", (PVC, DEPLOYMENT)
    ),
    Case("immediate", PVC, View([claim(), storage_class("Immediate")]), "wait", "no volume is bound yet"),
    Case("no such class", PVC, View([claim()]), "wait", "storage class local-path does not exist"),
    Case("no class named", PVC, View([claim(storage_class=None)]), "wait", "none is the default"),
    Case("classes not readable", PVC, unreadable, "wait", "may not read storage classes"),
    Case("being deleted", PVC, View([gone_soon(claim("Bound"))]), "wait", "being deleted"),
]


def node(ready: str = "True", unschedulable: bool = False, **more: str) -> View:
    return View(
        [obj("Node", "robot1", {"unschedulable": unschedulable}, {"conditions": conditions(Ready=ready, **more)})]
    )


NODE = ref("Node", "robot1")
NODES = [
    Case("ready", NODE, node(), "pass", "Ready"),
    Case("not ready", NODE, node("False"), "wait", "NotReady"),
    Case("unknown", NODE, node("Unknown"), "wait", "NotReady"),
    Case("pressure", NODE, node(DiskPressure="True"), "wait", "DiskPressure"),
    Case("no network", NODE, node(NetworkUnavailable="True"), "wait", "NetworkUnavailable"),
    Case("cordoned", NODE, node(unschedulable=True), "pass", "cordoned"),
]
OTHER = [
    Case("no rollout", ref("ConfigMap"), View(), "pass", "has no rollout"),
    Case("a Job of another API", ref("Job", api_version="batch.volcano.sh/v1alpha1"), View(), "pass", "has no rollout"),
    Case("with its API version", ref("Deployment", api_version="apps/v1"), View(), "wait", "not there yet"),
]


@pytest.mark.parametrize("case", CLAIMS + NODES + OTHER, ids=lambda case: f"{case.ref.kind}: {case.name}")
def test_other_kinds(case: Case) -> None:
    check(case)


def test_a_suspicion_fails_only_when_it_lasts() -> None:
    tracker, doubt = Tracker(grace=10), Verdict("wait", "no room", suspect="Unschedulable")
    assert tracker.settle(DEPLOYMENT, doubt, now=100).verdict == "wait"
    assert tracker.due() == 110
    other_words = Verdict("wait", "no room at all", suspect="Unschedulable")
    assert tracker.settle(DEPLOYMENT, other_words, now=109.9).verdict == "wait"
    assert tracker.settle(DEPLOYMENT, other_words, now=110).verdict == "fail"


@pytest.mark.parametrize("between", [Verdict("wait", "starting"), Verdict("wait", "quota", suspect="ReplicaFailure")])
def test_a_suspicion_that_went_away_starts_over(between: Verdict) -> None:
    tracker, doubt = Tracker(grace=10), Verdict("wait", "no room", suspect="Unschedulable")
    tracker.settle(DEPLOYMENT, doubt, now=100)
    tracker.settle(DEPLOYMENT, between, now=105)
    assert tracker.settle(DEPLOYMENT, doubt, now=111).verdict == "wait"
    assert tracker.due() == 121


def test_suspicions_of_different_objects_are_apart() -> None:
    tracker, doubt = Tracker(grace=10), Verdict("wait", "no room", suspect="Unschedulable")
    tracker.settle(DEPLOYMENT, doubt, now=100)
    tracker.settle(DAEMON, doubt, now=105)
    assert tracker.settle(DAEMON, doubt, now=110).verdict == "wait"
    assert tracker.settle(DEPLOYMENT, doubt, now=110).verdict == "fail"


def test_references_and_definitions_are_read_alike() -> None:
    full = {"apiVersion": "apps/v1", "kind": "Deployment", "metadata": {"name": "talker", "namespace": NS}, "spec": {}}
    short = {"kind": "Deployment", "name": "talker", "namespace": NS, "api_version": "apps/v1"}
    node_ref = {"kind": "Node", "name": "robot1", "namespace": "ignored"}
    assert parse_refs([full, short, node_ref]) == [Ref("Deployment", "talker", NS, "apps/v1"), Ref("Node", "robot1")]


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


def test_a_kind_of_that_name_in_another_api_is_not_refused() -> None:
    job = {"apiVersion": "batch.volcano.sh/v1alpha1", "kind": "Job", "metadata": {"name": "x"}}
    assert parse_refs([job]) == [Ref("Job", "x", "", "batch.volcano.sh/v1alpha1")]


def test_what_is_watched() -> None:
    found = targets_for([DEPLOYMENT, PVC, NODE, ref("Secret"), ref("Deployment", api_version="apps.example.org/v1")])
    assert {(one.kind, one.namespace) for one in found} == {
        *((kind, NS) for kind in ("Deployment", "ReplicaSet", "Pod", "PersistentVolumeClaim")),
        ("StorageClass", ""),
        ("Node", ""),
    }


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
    return [str(one["metadata"]["name"]) for one in present_pods(of, view)]


def test_present_pods_of_a_deployment_are_those_of_its_newest_replica_set() -> None:
    pods = (pod("new-1", NEW), pod("old-1", OLD), gone_soon(pod("new-2", NEW)), pod("other", owner("ReplicaSet", "x")))
    assert names(ref("Deployment"), rolled(*pods)) == ["new-1"]
    # the controller has not seen the new template: what is newest now is the old one
    assert names(ref("Deployment"), rolled(*pods, status={"observedGeneration": 1})) == []
    assert names(ref("Deployment"), rolled(*pods, revision="3")) == []


def test_present_pods_of_a_daemon_set_are_those_of_its_revision() -> None:
    pods = two("old", "new")
    foreign = set_pod("talker-2", "new")
    foreign["metadata"]["ownerReferences"][0]["uid"] = "uid-of-a-namesake"
    assert names(DAEMON, View([daemon_set(), *REVISIONS, *pods, foreign])) == ["talker-1"]
    assert names(DAEMON, View([daemon_set(), *pods])) == []


def test_what_has_no_pods() -> None:
    assert names(ref("ConfigMap"), View([pod("talker", [])])) == []
    assert names(NODE, node()) == []
