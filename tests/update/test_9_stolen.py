# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot that was stolen: what lies on its disk is worth nothing once it is revoked, and no other robot notices."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from cluster import CODE, KEEPER, ask, bearer
from fleet import Fleet
from kubernetes import client
from runs import wait_until

EDGE, THIEF, NAMESPACE, LOOT = "edge1", "robot2", "robot-robot2", "loot"
HERE = ("--limit", f"{THIEF},{EDGE}")
AGENT, TOKEN = "/var/lib/rancher/k3s/agent", "/etc/rancher/k3s/agent-token"
BOOTSTRAP = re.compile(r"K10[0-9a-f]{64}::([a-z0-9]{6}\.[a-z0-9]{16})")
CORE, APPS, LEASES = "/api/v1", "/apis/apps/v1", "/apis/coordination.k8s.io/v1"
REVOKED = "the node robot2 is revoked"


@dataclass(frozen=True)
class Loot:
    """What a thief finds on the robot's disk."""

    certificate: tuple[str, str]
    keeper: str
    token: str
    password: str

    @classmethod
    def of(cls, fleet: Fleet, folder: Path) -> Loot:
        """As root on the robot reads it."""
        for name in ("client-kubelet.crt", "client-kubelet.key"):
            (folder / name).write_text(fleet.hosts.ssh(THIEF, f"cat {AGENT}/{name}"))
        (keeper,) = fleet.pods()[THIEF][KEEPER]
        account = f"/var/lib/kubelet/pods/{keeper.uid}/volumes/kubernetes.io~projected/*/token"
        return cls(
            (str(folder / "client-kubelet.crt"), str(folder / "client-kubelet.key")),
            fleet.hosts.ssh(THIEF, f"cat {account}").strip(),
            fleet.hosts.ssh(THIEF, f"cat {TOKEN}").strip(),
            fleet.hosts.ssh(THIEF, "cat /etc/rancher/node/password").strip(),
        )

    def by_certificate(self, method: str, path: str, body: Any = None, **headers: str) -> tuple[int, str]:
        return ask(method, path, body, headers, self.certificate)

    def certificate_again(self) -> tuple[int, str]:
        """What an agent asks k3s for when it starts; the request itself is no good, which is looked at last."""
        named = {"K3s-Node-Name": THIEF, "K3s-Node-Password": self.password}
        return self.by_certificate("POST", "/v1-k3s/client-kubelet.crt", **named)


def bootstrap_of(token: str) -> str:
    """The part by which a node joins."""
    found = BOOTSTRAP.fullmatch(token)
    assert found, "no token of its own"
    return found[1]


@pytest.fixture
def taken_in_again(fleet: Fleet) -> Iterator[None]:
    """The robot as it was: its disk is not believed, so that k3s comes anew, and its name is said."""
    yield
    fleet.playbooks.run("reset", {**fleet.variables, "reset_confirm": True}, "--limit", THIEF).must(0)
    said = {**fleet.variables, "k3s_enrol": THIEF}
    back = fleet.playbooks.run("site", said, *HERE, "--tags", "preflight,k3s,images,node")
    assert back.status == 0, back
    # its apps at the edge are registered nowhere: what knew of them was on the robot
    client.CoreV1Api().delete_collection_namespaced_pod(NAMESPACE)
    fleet.wait_settled(300)


@pytest.fixture
def secret() -> Iterator[str]:
    """One that a pod of the robot has, and so its kubelet."""
    core = client.CoreV1Api()
    core.create_namespaced_secret(NAMESPACE, {"metadata": {"name": LOOT}, "stringData": {"key": "of the cloud"}})
    spec = {
        "nodeName": THIEF,
        "containers": [{"name": "a", "image": "docker.io/lab/apps:1.0", "command": ["sleep", "infinity"]}],
        "volumes": [{"name": "cloud", "secret": {"secretName": LOOT}}],
    }
    core.create_namespaced_pod(NAMESPACE, {"metadata": {"name": LOOT}, "spec": spec})
    yield LOOT
    core.delete_collection_namespaced_pod(NAMESPACE, field_selector=f"metadata.name={LOOT}", grace_period_seconds=0)
    core.delete_namespaced_secret(LOOT, NAMESPACE)


def test_robots_have_tokens_of_their_own_and_start_without_them(fleet: Fleet) -> None:
    tokens = {robot: bootstrap_of(fleet.hosts.ssh(robot, f"cat {TOKEN}").strip()) for robot in fleet.robots}
    assert len({*tokens.values()}) == len(fleet.robots)
    pods = fleet.running()
    for listed in json.loads(fleet.hosts.ssh(EDGE, "k3s token list -o json")):
        fleet.hosts.ssh(EDGE, f"k3s token delete {listed['token']}")
    fleet.hosts.ssh(THIEF, "systemctl restart k3s-agent")  # which ends once the server has let it in
    assert fleet.hosts.ssh(THIEF, "systemctl is-active k3s-agent").strip() == "active"
    fleet.assert_still_running(pods)


def tries(loot: Loot) -> dict[str, tuple[Callable[[], tuple[int, str]], int, str]]:
    """What a thief tries: how, the status of the refusal, and its words."""
    bare, node = {"metadata": {"name": THIEF}}, f"{CORE}/nodes/{THIEF}"
    pod = {**bare, "spec": {"nodeName": THIEF, "containers": [{"name": "a", "image": "a"}]}}
    here, joins = f"{CORE}/namespaces/{NAMESPACE}", bootstrap_of(loot.token)
    deployments, lease = f"{APPS}/namespaces/{NAMESPACE}/deployments", f"{LEASES}/namespaces/kube-node-lease/leases"
    return {
        "its Node again": (lambda: loot.by_certificate("POST", f"{CORE}/nodes", bare), 403, REVOKED),
        "its node's Lease": (lambda: loot.by_certificate("POST", lease, bare), 403, REVOKED),
        "a Secret": (lambda: loot.by_certificate("GET", f"{here}/secrets/{LOOT}"), 403, ""),
        "the code of its pods": (lambda: loot.by_certificate("GET", f"{here}/configmaps/{CODE}"), 403, ""),
        "its Node": (lambda: loot.by_certificate("GET", node), 404, ""),
        "a certificate": (loot.certificate_again, 401, ""),
        "to join by its token": (lambda: ask("GET", "/v1-k3s/client-ca.crt", None, bearer(joins)), 401, ""),
        "its keeper's work": (lambda: ask("GET", deployments, None, bearer(loot.keeper)), 401, ""),
        # which no kubelet may
        "a pod": (lambda: loot.by_certificate("POST", f"{here}/pods", pod), 403, ""),
        "all Secrets": (lambda: loot.by_certificate("GET", f"{here}/secrets"), 403, ""),
    }


NEVER = {"a pod", "all Secrets"}


def possible(loot: Loot) -> dict[str, str]:
    """What of it is not refused, or not by those who should."""
    found = {}
    for what, (tried, status, words) in tries(loot).items():
        got, said = tried()
        if got != status or words not in said:
            found[what] = f"{got} {said[:300]}"
    return found


@pytest.mark.long
@pytest.mark.promise("what a stolen robot holds is worth nothing once it is revoked, and no other robot notices")
@pytest.mark.usefixtures("taken_in_again", "secret")
def test_a_stolen_robot_is_worth_nothing(fleet: Fleet, tmp_path: Path) -> None:
    # a token that has not ended, as just after the robot's join
    made = fleet.hosts.ssh(EDGE, f"k3s token create --ttl 1h --description 'rosops.fleet: {THIEF}'").strip()
    fleet.hosts.ssh(THIEF, f"printf '%s\\n' {made} >{TOKEN}")
    loot = Loot.of(fleet, tmp_path)
    everything = {*tries(loot)} - NEVER
    wait_until(lambda: {*possible(loot)}, lambda found: found == everything, 60, f"all but {NEVER}", pause=1)
    pods, watch, said = fleet.running(), fleet.watch(), {**fleet.variables, "robot": THIEF}
    looked = fleet.playbooks.run("revoke", said, "--check").must(0)
    assert looked.host(THIEF)["outcome"] == "updated", looked
    assert {*possible(loot)} == everything
    run = fleet.playbooks.run("revoke", said).must(0)
    assert f"Secret {NAMESPACE}/{LOOT}" in run.host(THIEF)["reason"], run
    # the API server believes a token for some seconds more
    wait_until(lambda: possible(loot), lambda found: not found, 30, "a refusal of all that a thief tries", pause=1)
    fleet.playbooks.run("revoke", said).must_change_nothing()
    fleet.hosts.ssh(THIEF, "systemctl restart --no-block k3s-agent")  # nor does its own k3s come in
    refused = fleet.playbooks.run("site", fleet.variables, *HERE, "--tags", "node")
    assert (refused.status, REVOKED in refused.host(THIEF)["reason"]) == (2, True), refused
    assert fleet.hosts.ssh(THIEF, "systemctl is-active k3s-agent || true").strip() == "activating"
    assert possible(loot) == {}
    fleet.assert_still_running(pods, "robot1")
    watch.assert_nothing_lost("robot1")
