# SPDX-License-Identifier: GPL-3.0-or-later
"""What the token of a robot's keeper is good for: its work, and nothing else. What a robot's kubelet and pods may.

All that is tried is a dry run, of which the API server decides as of the real thing: its roles, then its policy.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import pytest
from cluster import GATE, MASTER, ask, bearer
from fleet import LIMIT, Fleet
from kubernetes import client
from runs import wait_until

NAMESPACE, APP, SOAK = "robot-robot1", "temperature", 25
ADMISSION = "/apis/admissionregistration.k8s.io/v1/validatingadmissionpolicies"
CORE, APPS, LEASES = "/api/v1", "/apis/apps/v1", "/apis/coordination.k8s.io/v1"
DEPLOYMENTS = f"{APPS}/namespaces/{NAMESPACE}/deployments"
DEPLOYMENT = f"{DEPLOYMENTS}/{APP}"
GATED = "gated"
CHOOSES_ROBOT, CHOOSES_EDGE = (f"node-restriction.kubernetes.io/rosops-{word}" for word in ("robot", "placement"))
KUBELET = "/var/lib/rancher/k3s/agent/kubelet.kubeconfig"
STORAGE = "/var/lib/rancher/k3s/storage"
MARK, UPDATING, BACK_TO = "rosops.fleet/soaking", "rosops.fleet/updating", "rosops.fleet/back-to"
MERGE, STRATEGIC, APPLY = (f"application/{kind}" for kind in (
    "merge-patch+json", "strategic-merge-patch+json", "apply-patch+yaml",
))  # fmt: skip
# whose words they are, beside each thing that is tried
ROLE = "cannot "
STATUS = f"of a pod's status a keeper may set the condition {GATE} alone"
METADATA = "of a Deployment's metadata a keeper may change annotations alone"
MARKS = "is for runs"
AT_REST = "a keeper may change a Deployment only where a run has marked it"
BACK = f"{BACK_TO} alone; what is in neither: ... "
RECORDS = "of ConfigMaps a keeper may write the data of robot-updates and of those named APP-update alone"
HISTORY = "which versions an app may go back to (history.json) is for runs to write"
LEASE = "of Leases a keeper may write robot-update alone"


class Keeper:
    """The API by a token alone."""

    def __init__(self, token: str) -> None:
        self._token = bearer(token)

    def asks(self, method: str, path: str, body: Any = None, content: str = MERGE) -> tuple[int, str]:
        """Status and answer, as if it had been done."""
        query = "" if method == "GET" else "?dryRun=All"
        query += "&fieldManager=rosops.fleet&force=true" if content == APPLY else ""
        kind = {"Content-Type": content} if method == "PATCH" else {}
        return ask(method, f"{path}{query}", body, {**self._token, **kind})

    def does(self, method: str, path: str, body: Any = None, content: str = MERGE) -> Any:
        """The same, which is allowed; what there would be."""
        status, said = self.asks(method, path, body, content)
        assert status == 200, said
        return json.loads(said)


@dataclass(frozen=True)
class Try:
    what: str
    words: str  # of the refusal
    path: str
    body: Any = field(default_factory=dict)
    method: str = "PATCH"
    content: str = MERGE

    def fault(self, keeper: Keeper) -> str:
        """Nothing, where it is refused with these words."""
        status, said = keeper.asks(self.method, self.path, self.body, self.content)
        good = status == 403 and all(words in said for words in self.words.split(" ... "))
        return "" if good else f"{self.what}: {status} {said}, and no {self.words!r}"


def faults(keeper: Keeper, tries: list[Try]) -> list[str]:
    return [fault for one in tries if (fault := one.fault(keeper))]


def of_roles(pod: str) -> list[Try]:
    """What no role gives a keeper."""
    here, bare, other = f"{CORE}/namespaces/{NAMESPACE}", {"metadata": {"name": "mine"}}, "robot-robot2"
    return [
        Try("create a Deployment", ROLE, DEPLOYMENTS, bare, "POST"),
        Try("create a pod", ROLE, f"{here}/pods", bare, "POST"),
        Try("delete a pod", ROLE, f"{here}/pods/{pod}", method="DELETE"),
        Try("run a command in a pod", ROLE, f"{here}/pods/{pod}/exec?command=id&stdout=true", method="GET"),
        Try("read a Secret", ROLE, f"{here}/secrets/any", method="GET"),
        Try("read all Secrets", ROLE, f"{here}/secrets", method="GET"),
        Try("create a ConfigMap", ROLE, f"{here}/configmaps", bare, "POST"),
        Try("change another robot's app", ROLE, DEPLOYMENT.replace(NAMESPACE, other), {"spec": {"replicas": 0}}),
        Try("change another robot's pod", ROLE, f"{CORE}/namespaces/{other}/pods/{pod}/status", {"status": {}}),
        Try("change the policy", ROLE, f"{ADMISSION}/rosops-fleet-keeper"),
    ]  # fmt: skip


def of_pods(pod: str, gated: str) -> list[Try]:
    """What of a pod's status is not the keeper's; one of the pods has the gate."""

    def status(what: str, body: Any, name: str = gated, content: str = STRATEGIC) -> Try:
        return Try(what, STATUS, f"{CORE}/namespaces/{NAMESPACE}/pods/{name}/status", body, content=content)

    return [
        status("the phase of a pod", {"status": {"phase": "Failed"}}),
        status("its address", {"status": {"podIP": "10.0.0.9", "podIPs": [{"ip": "10.0.0.9"}]}}, content=MERGE),
        status("its labels", {"metadata": {"labels": {"rosops.fleet/app": "other"}}}),
        status("its annotations", {"metadata": {"annotations": {"mine": "yes"}}}),
        status("its finalizers", {"metadata": {"finalizers": ["example.org/mine"]}}),
        status("another condition", {"status": {"conditions": [{"type": "Ready", "status": "True"}]}}),
        status("all conditions", {"status": {"conditions": [condition()]}}, content=MERGE, name=pod),
        status("the condition of a pod without the gate", {"status": {"conditions": [condition()]}}, pod),
    ]


def condition(status: str = "True") -> dict[str, str]:
    return {"type": GATE, "status": status}


def of_objects() -> list[Try]:
    """ConfigMaps and Leases."""
    maps = f"{CORE}/namespaces/{NAMESPACE}/configmaps"
    return [
        Try("the code in the pods", RECORDS, f"{maps}/rosops-code", {"data": {"run.py": "import os"}}),
        Try("the labels of a record", RECORDS, f"{maps}/{APP}-update", {"metadata": {"labels": {"mine": "yes"}}}),
        Try("the versions before", HISTORY, f"{maps}/{APP}-update", {"data": {"history.json": "[]"}}),
        Try(
            "another Lease", LEASE, f"{LEASES}/namespaces/{NAMESPACE}/leases",
            {"metadata": {"name": "mine"}, "spec": {}}, "POST",
        ),
    ]  # fmt: skip


def of_rest(app: str) -> list[Try]:
    """A Deployment that nobody has marked stays as it is."""
    path = f"{DEPLOYMENTS}/{app}"
    mark = {UPDATING: "1 00000000", BACK_TO: "image ros-app image=evil:1"}
    return [
        Try("the replicas of an app at rest", AT_REST, path, {"spec": {"replicas": 0}}),
        Try("a mark", MARKS, path, {"metadata": {"annotations": mark}}),
        Try("another owner", METADATA, path, {"metadata": {"labels": {"rosops.fleet/robot": "robot2"}}}),
        Try("a finalizer", METADATA, path, {"metadata": {"finalizers": ["example.org/mine"]}}),
    ]


def of_marked() -> list[Try]:
    """One that may go back may go nowhere else."""

    def pod(what: str, word: str, spec: Mapping[str, Any]) -> Try:
        body = {"spec": {"template": {"spec": spec}}}
        return Try(what, f"{BACK}{word}", DEPLOYMENT, body, content=STRATEGIC)

    def app(what: str, word: str, **keys: Any) -> Try:
        return pod(what, word, {"containers": [{"name": "ros-app", **keys}]})

    volume = {"name": "mine", "hostPath": {"path": "/"}}
    code = {"name": "rosops-code", "projected": {"sources": [{"configMap": {"name": f"{APP}-update"}}]}}
    return [
        app("another image", "image", image="docker.io/library/evil:1"),
        app("another program", "run", command=["sh", "-c", "id"]),
        app("another program by a probe", "run", livenessProbe={"exec": {"command": ["id"]}, "httpGet": None}),
        app("another variable", "env", env=[{"name": "BASH_ENV", "value": "/mine"}]),
        app("a privileged container", "may", securityContext={"privileged": True, "allowPrivilegeEscalation": True}),
        app("a capability", "may", securityContext={"capabilities": {"add": ["SYS_ADMIN"]}}),
        app("a container more", "image", name="mine", image="docker.io/lab/apps:1.0"),
        pod("a directory of the host", "volume", {"volumes": [volume]}),
        pod("other code", "projected.sources", {"volumes": [code]}),
        pod("the host's network", "host", {"hostNetwork": True}),
        pod("another account", "account", {"serviceAccountName": "ros-keeper"}),
        pod("another node", "node", {"nodeSelector": {CHOOSES_ROBOT: "robot2"}}),
        pod("any node", "nodes", {"nodeSelector": None}),
        Try("more of it", f"{BACK}replicas", DEPLOYMENT, {"spec": {"replicas": 2}}),
        Try("its way back", MARKS, DEPLOYMENT, {"metadata": {"annotations": {BACK_TO: None}}}),
    ]


def way_back(keeper: Keeper) -> tuple[str, dict[str, Any]]:
    """What a keeper applies to take the app back, and where: the version before, as its record has it."""
    record = keeper.does("GET", f"{CORE}/namespaces/{NAMESPACE}/configmaps/{APP}-update")
    before = json.loads(record["data"]["history.json"])[0]["deployment"]
    note = {"rosops.fleet/went-back": json.dumps({"reason": "a test"})}
    metadata = before["metadata"]
    return DEPLOYMENT, {**before, "metadata": {**metadata, "annotations": {**metadata["annotations"], **note}}}


@contextmanager
def a_gated_pod(core: client.CoreV1Api) -> Iterator[str]:
    """A pod that waits for its gate, on no node."""
    spec = {
        "nodeSelector": {CHOOSES_ROBOT: "none"},
        "readinessGates": [{"conditionType": GATE}],
        "containers": [{"name": "ros-app", "image": "docker.io/lab/apps:1.0"}],
    }
    core.create_namespaced_pod(NAMESPACE, {"metadata": {"name": GATED}, "spec": spec})
    try:
        yield GATED
    finally:
        core.delete_namespaced_pod(GATED, NAMESPACE, grace_period_seconds=0)


def notes() -> dict[str, dict[str, str]]:
    """App -> its annotations."""
    found = client.AppsV1Api().list_namespaced_deployment(NAMESPACE, _request_timeout=20).items
    return {item.metadata.name: item.metadata.annotations for item in found}


@pytest.mark.promise("whoever has a keeper's token can do a keeper's work with it, and nothing else")
def test_a_keeper_s_token_is_good_for_its_work_alone(fleet: Fleet) -> None:
    token = fleet.hosts.ssh("edge1", f"k3s kubectl -n {NAMESPACE} create token ros-keeper").strip()
    keeper, pod = Keeper(token), fleet.pods()["robot1"][MASTER][0].name
    with a_gated_pod(client.CoreV1Api()) as gated:
        assert faults(keeper, [*of_roles(pod), *of_pods(pod, gated)]) == []
        status = f"{CORE}/namespaces/{NAMESPACE}/pods/{gated}/status"
        keeper.does("PATCH", status, {"status": {"conditions": [condition()]}}, STRATEGIC)
    (app, *_others) = wait_until(
        lambda: {*notes()} - fleet.cluster.on_trial("robot1"), bool, 180, "an app that no longer soaks", pause=5
    )
    assert faults(keeper, of_rest(app)) == []
    proven = f"{APP} was good for {SOAK} s: proven"

    def times() -> int:
        return fleet.cluster.keeper_log("robot1").count(proven)

    before = times()
    fleet.update(fleet.new_version("robot1", APP), *LIMIT, update_soak=SOAK).must(0, robot1="updated")
    assert faults(keeper, [*of_objects(), *of_marked()]) == []
    keeper.does("PATCH", *way_back(keeper), APPLY)
    # and the keeper itself says that the version is proven, which takes a record, and a mark off
    wait_until(times, lambda now: now > before, 4 * SOAK, proven, pause=5)
    assert not {MARK, BACK_TO} & {*notes()[APP]}


OWN, EDGE = {CHOOSES_ROBOT: "robot1"}, {CHOOSES_EDGE: "remote"}
PRIVILEGED = {"securityContext": {"privileged": True}}


def pod_of(selector: Mapping[str, str], container: Mapping[str, Any], **spec: Any) -> dict[str, Any]:
    """One that would run there."""
    made = {"name": "mine", "image": "docker.io/lab/apps:1.0", **container}
    return {"metadata": {"name": "mine"}, "spec": {"nodeSelector": {**selector}, "containers": [made], **spec}}


def of_hosts() -> list[tuple[str, str, dict[str, Any]]]:
    """Pods, and the words of the rule that refuses them in the robot's namespace; none where they are allowed."""
    root, claims = ({"name": "host", "hostPath": {"path": path}} for path in ("/", STORAGE))
    writes, reads = (
        {"volumeMounts": [{"name": "host", "mountPath": "/m", "readOnly": only}]} for only in (False, True)
    )
    adds = {"securityContext": {"capabilities": {"add": ["SYS_ADMIN"]}}}
    inside = [{"name": "first", "image": "docker.io/lab/apps:1.0", **PRIVILEGED}]
    return [
        ("privileged on the edge", "may be privileged", pod_of(EDGE, PRIVILEGED)),
        ("the same in an init container", "may be privileged", pod_of(EDGE, {}, initContainers=inside)),
        ("privileged on another robot", "may be privileged", pod_of({CHOOSES_ROBOT: "robot2"}, PRIVILEGED)),
        ("privileged anywhere", "may be privileged", pod_of({}, PRIVILEGED)),
        ("the edge's files", "may mount a path of its host", pod_of(EDGE, reads, volumes=[root])),
        ("to write into others' claims", "may mount a path of its host", pod_of(EDGE, writes, volumes=[claims])),
        ("the edge's network", "may have hostNetwork", pod_of(EDGE, {}, hostNetwork=True)),
        ("a capability", "may add capabilities", pod_of(EDGE, adds)),
        ("a container on the edge", "", pod_of(EDGE, {})),
        ("as a keeper on the edge", "", pod_of(EDGE, reads, volumes=[claims])),
        ("all of its own host", "", pod_of(OWN, {**PRIVILEGED, **writes}, volumes=[root], hostNetwork=True)),
        ("the same, placed as by 1.0", "", pod_of({"rosops.fleet/robot": "robot1"}, PRIVILEGED)),
    ]


def refusal(pod: Mapping[str, Any]) -> str:
    """What the API server says of it to an administrator; nothing where it would make it."""
    try:
        client.CoreV1Api().create_namespaced_pod(NAMESPACE, pod, dry_run="All", _request_timeout=20)
    except client.ApiException as error:
        assert error.status == 403, error
        return str(json.loads(error.body)["message"])
    return ""


@pytest.mark.promise("root on a robot gets no pod of the edge, and no pod in a robot's namespace gets another host")
def test_neither_a_robot_s_kubelet_nor_its_pods_get_another_host(fleet: Fleet) -> None:
    kubelet = f"k3s kubectl --kubeconfig {KUBELET} label node robot1 --overwrite --dry-run=server"
    for label in (f"{CHOOSES_EDGE}=remote", f"{CHOOSES_ROBOT}=robot2", f"{CHOOSES_EDGE}-"):
        said = fleet.hosts.ssh("robot1", f"{kubelet} {label} 2>&1 || true")
        assert "is not allowed to modify labels: node-restriction.kubernetes.io/" in said, said
    # which is about these labels, and about no other
    assert "robot1 labeled" in fleet.hosts.ssh("robot1", f"{kubelet} deploymentType=remote 2>&1 || true")
    for what, words, pod in of_hosts():
        said, rule = refusal(pod), f"only a pod on its robot's own node (nodeSelector {CHOOSES_ROBOT}"
        assert (rule in said) is bool(words), (what, said)
        assert words in said and bool(said) is bool(words), (what, said)
