# SPDX-License-Identifier: GPL-3.0-or-later
"""The action: what a robot holds is worth nothing, in an order that leaves no gap, and what is left is named."""

from __future__ import annotations

from base64 import b64encode
from functools import partial
from itertools import count
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.action import _revoke
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.revocation import policy_name, refusal_of
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import k3s_of, run
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server
from ansible_collections.rosops.fleet.tests.unit.robots import fleet_of, robot

POLICIES = "/apis/admissionregistration.k8s.io/v1/validatingadmissionpolicies"
POLICY, BINDING = (f"{POLICIES}/{policy_name('robot2')}", f"{POLICIES[:-3]}ybindings/{policy_name('robot2')}")
NODE, SPACE, SYSTEM = "/api/v1/nodes/robot2", "/api/v1/namespaces/robot-robot2", "/api/v1/namespaces/kube-system"
TOKEN, OTHERS = f"{SYSTEM}/secrets/bootstrap-token-aaaaaa", f"{SYSTEM}/secrets/bootstrap-token-bbbbbb"
LEASE = "/apis/coordination.k8s.io/v1/namespaces/robot-robot2/leases/robot-update"
SHIPPER = "/api/v1/namespaces/observability/pods/log-shipper-1"
KEEPER = f"{SPACE}/pods/ros-keeper-1"
VARIABLES: dict[str, Any] = {
    **fleet_of(robot(), robot(name="robot2"), robot(name="robot3", mode="standalone")),
    **k3s_of("robot2", "edge1"),
    "k3s_registries": {"configs": {"registry.lan": {"auth": {"password": "secret!"}}}},
    "k3s_config": {"vpn-auth": "name=tailscale,joinKey=secret!"},
}  # fmt: skip


def secret(description: str) -> dict[str, Any]:
    return {"metadata": {}, "data": {"description": b64encode(description.encode()).decode()}}


@pytest.fixture
def cluster(server: Server, monkeypatch: pytest.MonkeyPatch) -> Server:
    """With a robot that was stolen; its policy comes into force with the second look, and its pods are on its node."""
    for path in (SYSTEM, SPACE, "/api/v1/namespaces/observability"):
        server.put(path, {"metadata": {}})
    server.put(NODE, {"metadata": {}})
    server.put(TOKEN, secret("rosops.fleet: robot2"))
    server.put(OTHERS, secret("rosops.fleet: robot21"))
    server.put(LEASE, {"metadata": {}, "spec": {"holderIdentity": "keeper ros-keeper-1"}})
    server.put(f"{SPACE}/secrets/cloud", {"metadata": {"namespace": "robot-robot2"}, "data": {"key": "c2VjcmV0IQ=="}})
    pods: list[dict[str, Any]] = []
    for path, account in ((KEEPER, "ros-keeper"), (SHIPPER, "log-shipper")):
        body = {"metadata": {"namespace": path.split("/")[4]}, "spec": {"serviceAccountName": account}}
        pods.append(server.put(path, body))
    server.lists["/api/v1/pods"] = pods
    real, looks = server.write, iter((False, *[True] * 99))

    def write(method: str, path: str, query: dict[str, str], body: Any, content: str) -> tuple[int, Any]:
        if (method, path) == ("PATCH", NODE) and "dryRun" in query and server.find(BINDING) and next(looks):
            return 403, f"nodes is forbidden: ValidatingAdmissionPolicy ... denied request: {refusal_of('robot2')}"
        if method == "DELETE" and "/pods/" in path and "dryRun" not in body:
            assert body["gracePeriodSeconds"] == 0
            left = [one for one in server.lists["/api/v1/pods"] if not path.endswith(f"/{one['metadata']['name']}")]
            server.lists["/api/v1/pods"] = left
        return real(method, path, query, body, content)

    monkeypatch.setattr(server, "write", write)
    at_once = partial(_revoke.poll, now=count().__next__, sleep=lambda _seconds: None)
    monkeypatch.setattr(_revoke, "poll", at_once)
    return server


def test_nothing_is_left_of_its_rights(
    cluster: Server, api: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    for check in (True, False):
        result = run(_revoke, api, VARIABLES, check_mode=check)
        assert (result["changed"], result["outcome"]["outcome"]) == (True, "updated")
        assert bool(cluster.find(NODE)) is check
    assert cluster.find(POLICY)["spec"]["validations"][0]["expression"] == "false"
    assert [bool(cluster.find(path)) for path in (TOKEN, OTHERS, KEEPER, SHIPPER)] == [False, True, False, False]
    assert cluster.find(LEASE)["spec"]["holderIdentity"] == "rosops.fleet.revoke"
    assert "observability/log-shipper, robot-robot2/ros-keeper" in result["gone"][2]
    said = capsys.readouterr().out
    for named in (
        "Secret robot-robot2/cloud",
        "login for registry.lan (k3s_registries)",
        "k3s_config says as vpn-auth",
    ):
        assert any(named in one for one in result["left"])
        assert named in said
        assert named in result["outcome"]["reason"]
    assert "secret!" not in f"{result}{said}"


def test_the_policy_is_in_force_before_anything_goes(cluster: Server, api: dict[str, Any]) -> None:
    """A kubelet whose Node is deleted brings it again, and k3s then knows it."""
    run(_revoke, api, VARIABLES)
    tried = [number for number, write in enumerate(cluster.writes) if write == f"PATCH {NODE}"]
    gone = [number for number, write in enumerate(cluster.writes) if write.startswith("DELETE")]
    assert len(tried) == 2
    assert max(tried) < min(gone)
    seen = [cluster.requests.get() for _request in range(cluster.requests.qsize())]
    names = {tuple(headers.get(f"impersonate-{key}") for key in ("user", "group")) for _path, _query, headers in seen}
    assert names == {("system:node:robot2", "system:nodes"), (None, None)}


def test_a_second_run_changes_nothing_and_says_the_same(cluster: Server, api: dict[str, Any]) -> None:
    first, written = run(_revoke, api, VARIABLES), cluster.version
    for check in (False, True):
        again = run(_revoke, api, VARIABLES, check_mode=check)
        assert (again["changed"], again["outcome"]["outcome"]) == (False, "unchanged")
        assert again["left"] == first["left"]
    assert cluster.version == written


def test_where_the_policy_has_no_force_nothing_is_taken(
    cluster: Server, api: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_revoke, "refusal_of", lambda _node: "other words")
    result = run(_revoke, api, VARIABLES)
    assert result["failed"]
    assert cluster.find(NODE)
    assert cluster.find(TOKEN)


def test_a_standalone_robot_is_not_asked(server: Server, api: dict[str, Any]) -> None:
    result = run(_revoke, api, {**VARIABLES, "inventory_hostname": "robot3"})
    assert (result["changed"], result["gone"]) == (
        False, ["nothing: it was a cluster of its own, and no other one has given it any rights"],
    )  # fmt: skip
    assert any("registry.lan" in one for one in result["left"])
    assert not any("6443" in one for one in result["left"])
    assert server.requests.empty()
