# SPDX-License-Identifier: GPL-3.0-or-later
"""Every action on a cluster is on the inventory's, by an access of its own or one that is given."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from ansible import constants as C  # noqa: N812 - its customary name
from ansible_collections.rosops.fleet.plugins.action import (
    _fleet_info,
    _node_apply,
    _observability_stack,
    _robot_update,
    rollout_ready,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._action import cluster
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.host import RobotHost
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.access import Identity
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import run
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_objects import conditions, obj
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server
from ansible_collections.rosops.fleet.tests.unit.robots import fleet

IDENTITY = "/api/v1/namespaces/kube-system/configmaps/rosops-fleet"
GROUPS = {"edge": ["edge1", "edge2", "edge3"], "robots": ["robot1", "robot2"]}
APP = {"name": "talker", "image": "i:1"}
PLACE = {"name": "robot1", "placement": "local", "robot": "robot1"}


@pytest.fixture
def server(server: Server) -> Server:
    server.put("/api/v1/namespaces/kube-system", {"metadata": {"name": "kube-system"}})
    server.put("/api/v1/nodes/robot1", obj("Node", "robot1", status={"conditions": conditions(Ready="True")}))
    return server


@pytest.fixture(autouse=True)
def local_tmp(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(os, "environ", {key: value for key, value in os.environ.items() if "K8S_AUTH" not in key})
    monkeypatch.setattr(C, "DEFAULT_LOCAL_TMP", str(tmp_path))
    monkeypatch.setattr(RobotHost, "there", lambda _self: None)
    return tmp_path


def inventory(name: str = "production", own: str = "robot1", **variables: Any) -> dict[str, Any]:
    """The variables of a task of one of its robots. `robot2` is a cluster of its own."""
    hostvars = {host: {"ansible_host": "127.0.0.1", "usage": {}} for hosts in GROUPS.values() for host in hosts}
    said = {"robot1": {"ros_apps": [APP]}, "robot2": {"ros_apps": [APP], "robot_mode": "standalone"}}
    return {
        "fleet": {**fleet(GROUPS, said).as_dict(), "name": name},
        "hostvars": {host: {**item, **variables} for host, item in hostvars.items()},
        "inventory_hostname": own,
        "ansible_play_hosts_all": ["edge1", "robot1"],
        "ansible_play_batch": ["robot1"],
        "groups": GROUPS,
        **variables,
    }


def part(name: str) -> dict[str, Any]:
    """What a role of one part of a robot asks for."""
    return {"update_parts": [name], "update_strict": True}


def made_by(server: Server, fleet: str, name: str = "edge") -> None:
    server.put(IDENTITY, Identity(fleet, name).as_object())


def asked(server: Server) -> list[str]:
    return [server.requests.get()[0] for _request in range(server.requests.qsize())]


def serve(monkeypatch: pytest.MonkeyPatch, answer: Callable[[str], dict[str, Any]]) -> list[str]:
    """What a server says when its kubeconfig is read over SSH; returns the list of the servers that were asked."""
    servers: list[str] = []

    def run_task(_plugin: Any, _known: Any, task: dict[str, Any]) -> dict[str, Any]:
        command = "echo rosops-fleet-begin; env LC_ALL=C cat /etc/rancher/k3s/k3s.yaml; echo rosops-fleet-end"
        assert task == {**task, "ansible.builtin.raw": command, "become": True, "no_log": True, "check_mode": False}
        servers.append(task["delegate_to"])
        return answer(servers[-1])

    monkeypatch.setattr(cluster.ansible_core, "run_task", run_task)
    return servers


def kubeconfig(server: Server, key: str = "t") -> dict[str, Any]:
    return {
        "apiVersion": "v1",
        "clusters": [{"name": "default", "cluster": {"server": server.url}}],
        "users": [{"name": "default", "user": {"token": key}}],
        "contexts": [{"name": "c", "context": {"cluster": "default", "user": "default"}}],
        "current-context": "c",
    }


def admin(server: Server, key: str = "t") -> dict[str, Any]:
    text = yaml.safe_dump(kubeconfig(server, key))
    noise = "bash: /opt/ros/noetic/setup.bash: No such file or directory"
    said = f"{noise}\nrosops-fleet-begin\n{text}rosops-fleet-end\n".replace("\n", "\r\n")
    return {"stdout": said, "stderr": "Shared connection to edge1 closed.\r\n", "rc": 0}


# --- another fleet's cluster ----------------------------------------------------------------------------------------

# With the task's options, and the variables.
ACTIONS: dict[str, tuple[Any, dict[str, Any], dict[str, Any]]] = {
    "node": (_node_apply, PLACE, {}),
    "robot": (_robot_update, {}, {"update_strict": True}),
    "rollout": (rollout_ready, {"objects": [{"kind": "Deployment", "name": "a", "namespace": "b"}]}, {}),
    "observability": (_observability_stack, {}, {}),
}


@pytest.mark.parametrize("action", [name for name in ACTIONS if name != "rollout"])
@pytest.mark.parametrize("fleet", [{}, {"fleet": {"failed": True}}, {"inventory_hostname": "localhost"}])
def test_without_a_validated_fleet_no_cluster_is_asked(server: Server, action: str, fleet: dict[str, Any]) -> None:
    """As with --skip-tags validate: nothing says then which cluster is the right one."""
    os.environ.update(K8S_AUTH_HOST=server.url, K8S_AUTH_API_KEY="t")
    known = {key: value for key, value in inventory().items() if fleet or key != "fleet"} | fleet
    module, args, variables = ACTIONS[action]
    result = run(module, args, {**known, **variables})
    assert result["failed"]
    words = "no host of this fleet" if "inventory_hostname" in fleet else "import the playbook rosops.fleet.validate"
    assert words in result["msg"] or "is no robot of this fleet" in result["msg"]
    assert asked(server) == []


def test_users_wait_for_rollouts_of_any_cluster(server: Server) -> None:
    module, args, _variables = ACTIONS["rollout"]
    found = run(module, {**args, "host": server.url, "api_key": "t", "timeout": 0}, {})
    assert "Deployment b/a" in found["msg"]
    assert asked(server)


OTHERS = {"fleet": Identity("staging", "edge"), "cluster": Identity("production", "robot2"), "none": None}
WAYS = ("options", "environment", "variable", "ssh")
# by SSH one without an identity is adopted, below
WRONG = [(name, way) for name in OTHERS for way in WAYS if (name, way) != ("none", "ssh")]
# one action in all ways, as all have the same way to a cluster
TRIED = [("node", *one) for one in WRONG] + [(action, "fleet", "environment") for action in ACTIONS if action != "node"]


@pytest.mark.parametrize(("action", "other", "way"), TRIED)
def test_no_action_touches_or_reads_a_cluster_that_is_not_the_inventorys(  # noqa: PLR0913
    server: Server, local_tmp: Path, monkeypatch: pytest.MonkeyPatch, action: str, other: str, way: str
) -> None:
    found = OTHERS[other]
    if found:
        made_by(server, found.fleet, found.cluster)
    known, access = inventory(), {"host": server.url, "api_key": "t"}
    if way == "environment":
        os.environ.update(K8S_AUTH_HOST=server.url, K8S_AUTH_API_KEY="t")
    if way == "variable":
        (local_tmp / "mine.yaml").write_text(yaml.safe_dump(kubeconfig(server)))
        known["k3s_kubeconfig_path"] = str(local_tmp / "mine.yaml")
    serve(monkeypatch, lambda _host: admin(server))
    module, args, variables = ACTIONS[action]
    result = run(module, {**args, **(access if way == "options" else {})}, {**known, **variables})
    assert result["failed"]
    assert "the inventory's is the cluster edge of the fleet production" in result["msg"]
    assert (str(found) if found else "carries no fleet's identity") in result["msg"]
    assert way != "ssh" or "delete the ConfigMap kube-system/rosops-fleet there" in result["msg"]
    assert (asked(server), server.writes) == ([IDENTITY], [])


def test_a_given_access_needs_a_fleet_with_a_name(server: Server) -> None:
    made_by(server, "fleet")
    result = run(_robot_update, {"host": server.url, "api_key": "t"}, inventory(name="", **part("namespace")))
    assert result["failed"]
    assert "Set fleet_name for all hosts" in result["msg"]


# --- its own --------------------------------------------------------------------------------------------------------


def test_the_right_one_by_a_given_access(server: Server) -> None:
    made_by(server, "production")
    os.environ.update(K8S_AUTH_HOST=server.url, K8S_AUTH_API_KEY="t")
    result = run(_robot_update, {}, inventory(**part("namespace")))
    assert result["changed"]
    assert result["apis"] == {"edge": {"host": server.url, "source": "K8S_AUTH_HOST of the environment"}}
    assert asked(server)[0] == IDENTITY


def test_a_standalone_robot_is_reached_by_its_own_access_whatever_the_environment_says(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    os.environ.update(K8S_AUTH_HOST="http://127.0.0.200:1", K8S_AUTH_API_KEY="t")  # nothing listens there
    servers = serve(monkeypatch, lambda _host: admin(server))
    assert run(_robot_update, {}, inventory(own="robot2", **part("namespace")))["changed"]
    assert servers == ["robot2"]


@pytest.mark.parametrize("before", [None, "fleet"])
def test_the_stage_node_adopts_a_cluster_that_has_no_identity(
    server: Server, monkeypatch: pytest.MonkeyPatch, before: str | None
) -> None:
    if before:
        made_by(server, before)
    serve(monkeypatch, lambda _host: admin(server))
    assert not run(_robot_update, {}, inventory(**part("storage"))).get("failed")  # and others go on without
    said: list[str] = []
    monkeypatch.setattr(_node_apply.ActionModule, "say", lambda *_: said.append)
    assert run(_node_apply, PLACE, inventory(), check_mode=True)["changed"]
    assert (server.find(IDENTITY) or {"data": {"fleet": before}})["data"].get("fleet") == before
    assert run(_node_apply, PLACE, inventory())["changed"]
    assert server.find(IDENTITY)["data"] == {"fleet": "production", "cluster": "edge"}
    assert said[-1] == (
        "the cluster carries no identity of a fleet yet; it becomes the cluster edge of the fleet production"
    )
    said.clear()
    assert not run(_node_apply, PLACE, inventory())["changed"]
    assert not said


def test_a_cluster_that_was_made_anew_since_is_asked_again(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    made_by(server, "production")
    tokens = iter(["old", "new", "newer"])
    servers = serve(monkeypatch, lambda _host: admin(server, next(tokens)))
    server.refusals += [(401, "Unauthorized")]
    assert run(_robot_update, {}, inventory(**part("namespace")))["changed"]
    assert servers == ["edge1", "edge1"]
    server.refusals += [(401, "Unauthorized")] * 2
    assert "refuses the credentials" in run(_robot_update, {}, inventory(**part("namespace")))["msg"]
    assert len(servers) == 3


# --- no access ------------------------------------------------------------------------------------------------------

AWAY = {"unreachable": True, "msg": "Failed to connect to the host via ssh: no route"}
NOT_YET = {"failed": True, "rc": 1, "stdout": "cat: /etc/rancher/k3s/k3s.yaml: No such file or directory"}


def test_servers_that_cannot_be_reached_defer_the_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    servers = serve(monkeypatch, lambda _host: AWAY)
    for _robot in range(2):
        outcome = run(_robot_update, {}, inventory())["outcome"]
        assert outcome["outcome"] == "deferred-offline"
        assert "No server of the cluster edge can be reached over SSH" in outcome["reason"]
    assert servers == ["edge1", "edge2", "edge3"] * 2  # not again by the next robot


def test_what_keeps_a_server_from_telling_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    noise = "bash: .profile: No such file or directory"  # another one than that which is looked for
    serve(monkeypatch, lambda _host: {"failed": True, "rc": 1, "msg": "Missing sudo password", "stderr": noise})
    failed = run(_robot_update, {}, inventory(**part("namespace")), check_mode=True)
    assert failed["failed"]
    assert "edge1: /etc/rancher/k3s/k3s.yaml cannot be read there: Missing sudo password" in failed["msg"]


def test_every_host_of_a_look_gets_its_access_or_leaves_it_to_the_look(monkeypatch: pytest.MonkeyPatch) -> None:
    servers = serve(monkeypatch, lambda _host: AWAY)
    assert not run(_fleet_info, {"access_only": True}, inventory(own="robot2")).get("failed")
    assert servers == ["robot2"] * 2
    found = run(_fleet_info, {"volumes": "usage"}, {**inventory(), "ansible_play_hosts_all": ["robot2"]})
    assert servers == ["robot2"] * 2
    assert "No server of the cluster robot2 can be reached over SSH" in found["status"]["problems"][0]["what"]


def test_status_asks_each_cluster_by_its_own_access(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    made_by(server, "production")
    servers = serve(monkeypatch, lambda host: admin(server) if host == "edge1" else NOT_YET)
    known = {**inventory(), "ansible_play_hosts_all": ["robot1", "robot2"]}
    found = run(_fleet_info, {"volumes": "usage"}, known)["status"]
    assert servers == ["edge1", "robot2"]
    assert [row["name"] for row in found["nodes"]] == ["robot1"]
    assert [one["where"] for one in found["problems"]] == ["cluster robot2"]
    assert "There is no cluster robot2 yet" in found["problems"][0]["what"]
