# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot that somebody opened: root on robot1 tries all that it has. It reaches nothing but itself."""

from __future__ import annotations

import contextlib
import http.client
import json
import shlex
import ssl
import subprocess
import sys
from collections.abc import Iterator

import pytest
from cluster import KEEPER
from fleet import Fleet
from kubernetes import client
from runs import wait_until

THIEF, VICTIM, EDGE = "robot1", "robot2", "edge1"
AGENT = "/var/lib/rancher/k3s/agent"
KUBECTL, CA = f"k3s kubectl --kubeconfig {AGENT}/kubelet.kubeconfig", f"{AGENT}/server-ca.crt"
BY_CERTIFICATE = f"--client-certificate {AGENT}/client-kubelet.crt --client-key {AGENT}/client-kubelet.key"
LOCK = f"-n robot-{VICTIM}"
RESTRICTED = "node-restriction.kubernetes.io/rosops-"
SECONDS = 3.0  # for an answer; who is admitted has it at once

CONNECT = """
import concurrent.futures, json, socket, sys
def opens(address):
    try:
        socket.create_connection(tuple(address), SECONDS).close()
        return True
    except OSError:
        return False
addresses = json.loads(sys.argv[1])
with concurrent.futures.ThreadPoolExecutor(64) as pool:
    print(json.dumps([address for address, found in zip(addresses, pool.map(opens, addresses)) if found]))
""".replace("SECONDS", str(SECONDS))

MIRROR = json.dumps({
    "apiVersion": "v1",
    "kind": "Pod",
    "metadata": {
        "name": f"master-{THIEF}",
        "namespace": f"robot-{VICTIM}",
        "labels": {"rosops.fleet/app": "ros-master"},
        "annotations": {"kubernetes.io/config.mirror": "x"},
        "ownerReferences": [{"apiVersion": "v1", "kind": "Node", "name": THIEF, "uid": "UID", "controller": True}],
    },
    "spec": {"nodeName": THIEF, "containers": [{"name": "master", "image": "docker.io/lab/apps:1.0"}]},
})  # fmt: skip

# what a kubelet's certificate is tried for -> whose words refuse it
OF_KUBELET = {
    f"label node {THIEF} --overwrite {RESTRICTED}placement=remote": "is not allowed to modify labels",
    f"label node {THIEF} --overwrite {RESTRICTED}robot={VICTIM}": "is not allowed to modify labels",
    f"label node {VICTIM} --overwrite mine=yes": "only its own Node object",
    f"label node {EDGE} --overwrite mine=yes": "only its own Node object",
    f"delete node {VICTIM}": "forbidden",
    "get secrets -A": "forbidden",
    f"get secrets {LOCK}": "forbidden",
    f"get configmaps {LOCK}": "forbidden",
    f"get configmap rosops-code {LOCK}": "no relationship found",
    f"get lease robot-update {LOCK}": "forbidden",
    f"create token ros-keeper {LOCK}": "no relationship found",
    "create token default -n kube-system": "no relationship found",
    f"delete pod {LOCK} -l rosops.fleet/app=ros-master": "forbidden",
    f"patch deployment temperature {LOCK} -p '{{}}'": "forbidden",
    f"create deployment mine -n robot-{THIEF} --image=mine": "forbidden",
    "get clusterrolebindings": "forbidden",
    f"create -f - <<< {shlex.quote(MIRROR)}": "a node makes no pods here",
}
# the same for the token of its keeper
OF_KEEPER = {
    f"patch deployment temperature {LOCK} -p '{{}}'": "forbidden",
    f"get pods {LOCK}": "forbidden",
    f"get lease robot-update {LOCK}": "forbidden",
    f"get secrets -n robot-{THIEF}": "forbidden",
    f"create deployment mine -n robot-{THIEF} --image=mine": "forbidden",
    f"exec -n robot-{THIEF} deployment/temperature -- id": "forbidden",
    f"create token ros-keeper -n robot-{THIEF}": "forbidden",
    f"set image deployment/temperature *=mine -n robot-{THIEF}": "denied",
    "get nodes": "forbidden",
}


# what anybody asks: host, port, path
OF_NOBODY = [
    *((EDGE, 6443, path) for path in ("/api/v1/secrets", "/api/v1/pods", "/apis/apps/v1/deployments")),
    *((host, 10250, path) for host in (EDGE, THIEF, VICTIM) for path in ("/pods", "/logs/", "/exec/a/b/c?command=id")),
]
OPENED = {"metadata": {"name": "by-the-test"}, "spec": {"podSelector": {}, "policyTypes": ["Ingress"], "ingress": [{}]}}


def listening(fleet: Fleet, robot: str) -> list[list[object]]:
    """Addresses at which a robot's pods are reached: each port on which they listen, and the Services."""
    core, namespace, found = client.CoreV1Api(), f"robot-{robot}", list[list[object]]()
    for pod in core.list_namespaced_pod(namespace, _request_timeout=20).items:
        process = fleet.hosts.network(pod.spec.node_name, pod.metadata.uid)
        said = fleet.hosts.ssh(pod.spec.node_name, f"nsenter -t {process} -n ss -Hltn")
        ports = {int(line.split()[3].rsplit(":", 1)[1]) for line in said.splitlines() if "127.0.0.1:" not in line}
        found += [[pod.status.pod_ip, port] for port in sorted(ports)]
    for service in core.list_namespaced_service(namespace, _request_timeout=20).items:
        found += [[service.spec.cluster_ip, port.port] for port in service.spec.ports or ()]
    return [one for one in found if one[0] != "None"]


def opened(fleet: Fleet, host: str, addresses: list[list[object]], app: str = "") -> list[list[object]]:
    """Those that somebody reaches from the host, or from a pod of an app on it."""
    inside = ""
    if app:
        (pod,) = fleet.pods()[host][app]
        inside = f"nsenter -t {fleet.hosts.network(host, pod.uid)} -n "
    words = f"{inside}python3 -c {shlex.quote(CONNECT)} {shlex.quote(json.dumps(addresses))}"
    found: list[list[object]] = json.loads(fleet.hosts.ssh(host, words))
    return found


@pytest.mark.promise("root on a robot reaches no pod of another robot, from a pod or from its host")
def test_the_network_of_another_robot(fleet: Fleet) -> None:
    others, own = listening(fleet, VICTIM), listening(fleet, THIEF)
    assert len(others) > 10, others
    assert opened(fleet, VICTIM, others, "temperature") == others  # all of them are there
    assert opened(fleet, THIEF, own, "temperature") == own
    assert opened(fleet, THIEF, others, "temperature") == []
    assert opened(fleet, THIEF, others) == []
    fleet.figures.append(f"{2 * len(others)} ways to {VICTIM}'s pods from {THIEF}: none open")


@pytest.mark.promise("what lies on a robot's disk is good for that robot alone")
def test_the_certificate_and_the_token_on_its_disk(fleet: Fleet) -> None:
    server = fleet.hosts.ssh(THIEF, f"{KUBECTL} config view -o jsonpath='{{.clusters[0].cluster.server}}'").strip()
    (keeper,) = fleet.pods()[THIEF][KEEPER]
    (token,) = fleet.hosts.ssh(THIEF, f"find /var/lib/kubelet/pods/{keeper.uid} -name token -type l").split()
    by_token = f"k3s kubectl --server {server} --certificate-authority {CA} --token $(cat {token})"
    uid = fleet.hosts.ssh(THIEF, f"{KUBECTL} get node {THIEF} -o jsonpath='{{.metadata.uid}}'")
    tried = [(KUBECTL, what, words) for what, words in OF_KUBELET.items()]
    tried += [(by_token, what, words) for what, words in OF_KEEPER.items()]
    for node in client.CoreV1Api().list_node(_request_timeout=20).items:
        if node.metadata.name != THIEF:  # another host's kubelet
            (address,) = (one.address for one in node.status.addresses if one.type == "InternalIP")
            its = f"k3s kubectl --server https://{address}:10250 --insecure-skip-tls-verify {BY_CERTIFICATE}"
            tried += [(its, f"get --raw {path}", "orbidden") for path in ("/pods", "/logs/", "/exec/a/b/c?command=id")]
    wrong = []
    for kubectl, what, words in tried:
        line = f"{kubectl} {what}".replace("UID", uid)
        said = fleet.hosts.ssh(THIEF, f"bash -c {shlex.quote(line)} 2>&1; echo exit $?")
        if words not in said or said.rstrip().endswith("exit 0"):
            wrong.append(f"{what}: {said[:400]}")
    assert not wrong, "\n".join(wrong)
    fleet.figures.append(f"{len(tried)} things tried with what lies on {THIEF}: none was done")


@contextlib.contextmanager
def way_to(fleet: Fleet, host: str, addresses: list[list[object]]) -> Iterator[None]:
    """As anybody in the hosts' network may have it: the host is asked to hand packets on to its pods."""
    there = sorted({f"{address}/32" for address, _port in addresses})
    for address in there:
        subprocess.run(["ip", "route", "replace", address, "via", fleet.hosts.address(host)], check=True)  # noqa: S603, S607 - by PATH
    try:
        yield
    finally:
        for address in there:
            subprocess.run(["ip", "route", "delete", address], check=True)  # noqa: S603, S607 - by PATH


def reached(addresses: list[list[object]]) -> list[list[object]]:
    """Those that this machine reaches, which is no host of the cluster."""
    words = [sys.executable, "-c", CONNECT, json.dumps(addresses)]
    found: list[list[object]] = json.loads(subprocess.run(words, capture_output=True, check=True).stdout)  # noqa: S603
    return found


def status(address: str, port: int, path: str) -> int:
    """What a server says to who shows nothing."""
    anybody = ssl._create_unverified_context()  # noqa: S323 - whoever it is, nothing is told to it
    connection = http.client.HTTPSConnection(address, port, timeout=10, context=anybody)
    with contextlib.closing(connection):
        connection.request("GET", path)
        return connection.getresponse().status


@pytest.mark.promise("a laptop in the hosts' network reaches no pod of a robot, and no API without a credential")
def test_a_laptop_in_the_network_of_the_hosts(fleet: Fleet) -> None:
    others, network = listening(fleet, VICTIM), client.NetworkingV1Api()
    with way_to(fleet, VICTIM, others):
        assert reached(others) == []
        network.create_namespaced_network_policy(f"robot-{VICTIM}", OPENED, _request_timeout=20)
        try:  # the way is there: it is the policies that close it
            wait_until(lambda: reached(others), lambda found: found == others, 30, "all of them")
        finally:
            network.delete_namespaced_network_policy("by-the-test", f"robot-{VICTIM}", _request_timeout=20)
        wait_until(lambda: reached(others), lambda found: not found, 30, "none of them")
    said = {one: status(fleet.hosts.address(one[0]), *one[1:]) for one in OF_NOBODY}
    assert set(said.values()) == {401}, said
    fleet.figures.append(f"{len(others)} ways to {VICTIM}'s pods from a laptop: none open; {len(said)} questions: 401")
