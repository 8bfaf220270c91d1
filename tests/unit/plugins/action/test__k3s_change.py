# SPDX-License-Identifier: GPL-3.0-or-later
"""A k3s that works is exchanged: what is asked of the host, and which steps are not taken."""

from __future__ import annotations

import contextlib
from itertools import count
from typing import Any
from unittest.mock import Mock

import pytest
from ansible.errors import AnsibleConnectionFailure
from ansible_collections.rosops.fleet.plugins.action import _k3s_change
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError
from ansible_collections.rosops.fleet.plugins.plugin_utils._action import gated
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.host import ActionHost, RobotHost
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import k3s_of, run

OLD, NEW = "v1.34.2+lab1", "v1.34.2+lab2"
PLAN: dict[str, Any] = {
    "binary": True, "write": ["/etc/rancher/k3s/config.yaml"], "remove": [], "restart": True, "works": True,
    "member": "", "etcd": True, "cgroup_refused": False, "version": OLD, "tokens": [], "rotate": "", "renews": False,
}  # fmt: skip

CERTIFICATE = "agent/client-kubelet.crt"
EARLY, LATE = "2027-03-01T08:00:00", "2027-11-26T08:00:00"

NO_ROBOTS: dict[str, Any] = {"robots": {}, "hosts": {}, "edge_nodes": [], "name": "lab"}


def node(name: str, version: str = OLD, ready: str = "True", server: bool = True) -> dict[str, Any]:
    labels = {"node-role.kubernetes.io/control-plane": "true"} if server else {}
    status = {"nodeInfo": {"kubeletVersion": version}, "conditions": [{"type": "Ready", "status": ready}]}
    return {"metadata": {"name": name, "labels": labels}, "status": status}


class Host:
    """What the jobs are asked; `staged` is the version to come, `bad` one that never serves."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.asked: list[str] = []
        self.args: dict[str, Any] = {}  # of the last call with each state
        self.kept: list[tuple[Any, ...]] = []  # in the cluster, as soon as it is known
        self.staged, self.bad, self.unproven, self.away = NEW, False, False, False
        self.writes = ["/etc/rancher/k3s/config.yaml", "/usr/local/bin/k3s"]
        self.lives, self.renewed = [EARLY, EARLY], EARLY  # of a certificate before and now, and once k3s has started
        self.known_nodes, self.robots_on = [node("robot1")], Mock(return_value=[])
        self.cluster = Mock(**{"beat.side_effect": map(str, count())})  # whose kubelet is heard of each time
        monkeypatch.setattr(ActionHost, "module", lambda host, _name, args, *_more: self.module(args, host.check_mode))
        monkeypatch.setattr(RobotHost, "there", lambda _host: self.module({}))
        monkeypatch.setattr(_k3s_change.ActionModule, "cluster", lambda *_args: contextlib.nullcontext(self))
        monkeypatch.setattr(_k3s_change, "keep_early", lambda _kube, *told: self.kept.append(told))
        monkeypatch.setattr(gated, "KubeCluster", Mock(return_value=self.cluster))
        monkeypatch.setattr(gated, "robots_on", self.robots_on)
        self.rotate_token = Mock(side_effect=lambda *given: self.asked.append(f"token of {given[2]}"))
        monkeypatch.setattr(_k3s_change, "rotate_token", self.rotate_token)

    def objects(self, _kind: str) -> list[dict[str, Any]]:
        return self.known_nodes

    def module(self, args: dict[str, Any], check_mode: bool = False) -> dict[str, Any]:
        if self.away:
            raise AnsibleConnectionFailure("no route to host")
        if args.get("job") == "k3s_change":
            args = args["arguments"]
            self.asked.append(args["state"])
            self.bad = self.bad and args["state"] != "previous"
            if args["state"] == "next":
                assert args["write"] == self.writes
                self.lives[1] = self.renewed
            self.lives[1] = self.lives[0] if args["state"] == "previous" else self.lives[1]
            self.args[args["state"]] = args
            found = {"staged": "" if check_mode else self.staged, "version": OLD, "unproven": self.unproven}
            found["certificates"] = {CERTIFICATE: [*self.lives]}
            return {**found, "start": f"after {self.asked[-2:]}"}
        if args.get("job") == "k3s_ready":
            return {"failed": self.bad, "msg": "k3s will not become ready"}
        return {}

    def change(self, check_mode: bool = False, **more: Any) -> dict[str, Any]:
        plan = {**PLAN, **more.pop("plan", {})}
        known = {"k3s_cluster": "robot1", "k3s_install_source": "airgap", "k3s_start_timeout": 5, "fleet": NO_ROBOTS}
        return run(_k3s_change, {"plan": plan}, {**k3s_of("robot1", "robot1"), **known, **more}, check_mode)


@pytest.fixture
def host(monkeypatch: pytest.MonkeyPatch) -> Host:
    return Host(monkeypatch)


def test_what_was_staged_is_taken_and_proven(host: Host) -> None:
    found = host.change()
    assert found["changed"]
    assert found["outcome"]["outcome"] == "updated"
    assert found["msg"].startswith(f"k3s {OLD} -> {NEW} in ")
    assert host.asked == ["staged", "next", "staged", "proven"]
    assert host.args["proven"]["start"] == "after ['next', 'staged']"
    # no robot works here: only its node has to be well, within k3s_start_timeout
    [(objects, timeout)] = [one.args for one in host.cluster.wait.mock_calls]
    assert ([item["kind"] for item in objects], timeout <= 5) == (["Node"], True)
    assert host.kept == [("robot1", "updated", f"k3s: {found['msg']}", True)]


def test_what_does_not_serve_is_taken_back(host: Host) -> None:
    host.bad = True
    found = host.change()
    assert found["failed"]
    assert found["outcome"]["outcome"] == "rolled-back"
    assert "k3s will not become ready" in found["msg"]
    assert [told[1] for told in host.kept] == ["rolled-back"]
    assert host.asked == ["staged", "next", "previous", "staged", "proven"]


@pytest.mark.parametrize(
    ("unproven", "member", "etcd", "datastore"),
    [
        (False, "", True, True),
        (True, "", True, False),
        (False, "robot1", True, False),
        (False, "robot1", False, True),  # others are to join it, once its SQLite has become etcd
    ],
)
def test_the_datastore_of_just_before_goes_back_with_a_server_that_is_alone(
    host: Host, unproven: bool, member: str, etcd: bool, datastore: bool
) -> None:
    host.bad, host.unproven = True, unproven
    host.change(plan={"member": member, "etcd": etcd})
    assert host.args["previous"]["datastore"] is datastore


def test_what_nobody_has_proven_is_proven_without_a_restart(host: Host) -> None:
    host.unproven, host.staged = True, "v1.36.0+lab1"  # left over, and not asked for
    found = host.change(plan={"restart": False, "binary": False, "write": []})
    assert found["outcome"]["outcome"] == "updated"
    assert host.asked == ["staged", "staged", "proven"]


def test_what_an_unproven_change_came_from_is_no_step_back(host: Host) -> None:
    host.unproven, host.staged = True, OLD
    assert host.change(plan={"version": "v1.34.3+lab1"})["outcome"]["outcome"] == "updated"


def test_where_k3s_does_not_serve_only_its_own_word_counts(host: Host) -> None:
    host.known_nodes = []
    assert host.change(plan={"works": False})["outcome"]["outcome"] == "updated"
    host.cluster.beat.assert_not_called()


@pytest.mark.parametrize(
    ("staged", "nodes", "more", "words"),
    [
        ("v1.34.1+lab1", [], {}, "is older than v1.34.2+lab1"),
        ("v1.35.0+lab1", [], {"plan": {"cgroup_refused": True}}, "which has cgroup v1"),
        (NEW, [node("edge1")], {"k3s_role": "agent"}, "newer than its cluster's servers (v1.34.2+lab1)"),
        (NEW, [node("robot1"), node("edge2", ready="Unknown")], {}, "edge2 of its cluster is not Ready"),
        ("v1.30.0+lab1", [], {"plan": {"works": False}}, "is older than v1.34.2+lab1"),
    ],
)
def test_steps_that_are_not_taken(host: Host, staged: str, nodes: list[Any], more: dict[str, Any], words: str) -> None:
    host.staged, host.known_nodes = staged, nodes
    found = host.change(**more)
    assert found["failed"]
    assert found["outcome"]["outcome"] == "failed"
    assert "nothing was touched" in found["msg"]
    assert words in found["msg"]
    assert host.asked == ["staged"]


def test_another_robot_that_is_not_ready_is_no_server(host: Host) -> None:
    host.known_nodes = [node("robot1"), node("robot2", ready="False", server=False)]
    assert host.change()["outcome"]["outcome"] == "updated"


@pytest.mark.parametrize(("staged", "asked"), [(NEW, False), ("v1.35.0+lab1", True)])
def test_an_edge_hosts_robots_rest_where_their_pods_may_be_started_again(host: Host, staged: str, asked: bool) -> None:
    host.staged = staged
    host.change()
    assert host.robots_on.called is asked


def test_a_host_that_is_away_is_deferred(host: Host) -> None:
    host.away = True
    assert host.change()["outcome"]["outcome"] == "deferred-offline"


@pytest.mark.parametrize(("source", "comes"), [("release", "v1.34.3+k3s1"), ("airgap", "that of k3s_airgap_dir")])
def test_check_mode_says_what_would_come_and_asks_nothing(host: Host, source: str, comes: str) -> None:
    host.staged = "v1.34.1+k3s1"  # by a run for another version, which the robot put off
    found = host.change(check_mode=True, k3s_install_source=source, k3s_version="v1.34.3+k3s1")
    assert found["changed"]
    assert found["msg"].startswith(f"would change: k3s {OLD} -> {comes}")
    assert host.asked == ["staged"]


def test_after_a_server_of_the_shared_cluster_that_failed_none_is_changed(host: Host) -> None:
    """They hold one datastore; agents newer than they are refused then."""
    servers = {"k3s_cluster": "edge", "ansible_play_hosts_all": ["edge1", "edge2", "edge3"]}

    def change(name: str) -> dict[str, Any]:
        return host.change(inventory_hostname=name, ansible_play_batch=[name], **servers)

    assert change("edge1")["outcome"]["outcome"] == "updated"
    host.bad = True
    assert change("edge2")["outcome"]["outcome"] == "rolled-back"
    host.asked = []
    third = change("edge3")
    assert not third.get("failed")
    assert third["outcome"] == {
        "outcome": "unchanged", "reason": "not begun: another server of its cluster failed", "steps": [],
    }  # fmt: skip
    assert host.asked == []


# --- certificates and the servers' token are made anew ----------------------------------------------------------------

SAME: dict[str, Any] = {"binary": False, "write": []}
RENEWS: dict[str, Any] = {**SAME, "rotate": "certificates", "renews": True}
ROTATES: dict[str, Any] = {**SAME, "rotate": "token"}


def test_new_certificates_are_told_by_their_ends(host: Host) -> None:
    host.writes, host.renewed = [], LATE
    found = host.change(plan=RENEWS)
    assert found["outcome"]["outcome"] == "updated"
    assert found["msg"].endswith("; certificates until 2027-11-26 (before: 2027-03-01): agent/client-kubelet.crt")
    assert host.args["next"]["renew"] is True
    assert host.asked == ["staged", "next", "staged", "staged", "proven"]


def test_an_agents_token_to_join_comes_with_them_and_goes_with_them(host: Host) -> None:
    """k3s takes away by what it would be let in again."""
    host.writes, host.renewed, host.known_nodes = ["/etc/rancher/k3s/agent-token"], LATE, [node("edge1")]
    found = host.change(k3s_role="agent", plan={**RENEWS, "tokens": ["agent-token"]})
    assert found["outcome"]["outcome"] == "updated"


@pytest.mark.parametrize("ends", [EARLY, "2027-01-01T00:00:00"])
def test_certificates_that_are_no_others_are_taken_back(host: Host, ends: str) -> None:
    host.writes, host.renewed = [], ends
    found = host.change(plan=RENEWS)
    assert found["outcome"]["outcome"] == "rolled-back"
    assert "agent/client-kubelet.crt is no other one than before, or ends no later" in found["msg"]
    assert "until" not in found["msg"]
    assert host.asked[-3:] == ["previous", "staged", "proven"]


def test_those_of_a_run_that_was_cut_off_are_only_proven(host: Host) -> None:
    host.unproven, host.lives = True, [EARLY, LATE]
    found = host.change(plan={**RENEWS, "rotate": "", "restart": False})
    assert found["msg"].endswith("certificates until 2027-11-26 (before: 2027-03-01): agent/client-kubelet.crt")
    assert "next" not in host.asked


def test_check_mode_tells_when_certificates_end(host: Host) -> None:
    found = host.change(check_mode=True, plan=RENEWS)
    assert found["changed"]
    assert found["msg"].startswith("would change: ")
    assert found["msg"].endswith("; certificates until 2027-03-01: agent/client-kubelet.crt")
    assert host.asked == ["staged"]


@pytest.mark.parametrize("check_mode", [False, True])
def test_the_token_is_made_before_k3s_starts_with_it(host: Host, check_mode: bool) -> None:
    host.writes = []
    found = host.change(check_mode, plan=ROTATES)
    assert found["outcome"]["outcome"] == "updated"
    assert found["msg"].endswith("; another token of the servers")
    more = [] if check_mode else ["token of ['robot1']", "next", "staged", "proven"]
    assert host.asked == ["staged", *more]


def test_a_token_is_not_taken_back_and_that_is_told(host: Host) -> None:
    host.writes, host.bad = [], True
    found = host.change(plan=ROTATES)
    assert found["outcome"]["outcome"] == "rolled-back"
    assert found["msg"].endswith("k3s will not become ready; the servers' token is the new one")


def test_a_token_stays_wherever_its_rotation_ended(host: Host) -> None:
    host.rotate_token.side_effect = KubeError("edge2: no route")
    found = host.change(plan=ROTATES)
    assert found["outcome"]["outcome"] == "failed"
    assert "edge2: no route; k3s was not started again; the next rotation of the token goes on" in found["msg"]
    assert host.asked == ["staged"]
