# SPDX-License-Identifier: GPL-3.0-or-later
"""The action: a robot's variables in, the engine on its cluster and its host, and the outcome."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock, Mock, call

import pytest
from ansible_collections.rosops.fleet.plugins.action import _robot_update
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import NotReadyError
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.host import RobotHost
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.access import Identity
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.ledger import Ledger
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import RobotOutcome, StepResult
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import run
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server
from ansible_collections.rosops.fleet.tests.unit.robots import fleet_of, robot

SECRET = {"name": "pull", "registry": "r.example", "username": "u", "password": "hunter2"}
APP = {"name": "talker", "image": "apps:1.0", "pattern": "pubsub"}
ROBOT = robot(APP, volumes=[{"name": "data"}], pull_secrets=[SECRET], quota={"pods": 9})
VARIABLES: dict[str, Any] = {
    **fleet_of(ROBOT),
    "robot_namespace_pull_secrets": [SECRET],
    "groups": {"edge": []},
    "hostvars": {},
    "ansible_play_batch": ["robot1"],
    "ansible_play_hosts_all": ["robot1"],
}
NAMESPACE = "/api/v1/namespaces/robot-robot1"
CLAIMS = f"{NAMESPACE}/persistentvolumeclaims"
NOWHERE = {"kubeconfig": "/nowhere/edge.yaml"}


@pytest.fixture(autouse=True)
def _there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RobotHost, "there", lambda _self: None)


def update(args: dict[str, Any], *parts: str, check_mode: bool = False, **more: Any) -> dict[str, Any]:
    return run(_robot_update, args, {**VARIABLES, "update_parts": list(parts), **more}, check_mode)


def outcome(result: dict[str, Any]) -> dict[str, Any]:
    return dict(result["outcome"])


# --- a robot's parts ------------------------------------------------------------------------------------------------


def test_what_stands_under_the_pods(server: Server, api: dict[str, Any]) -> None:
    for part in ("namespace", "storage"):
        result = update(api, part, update_strict=True)
        assert (result["changed"], outcome(result)["outcome"]) == (True, "updated"), result
        assert not update(api, part)["changed"]
    assert server.find(f"{NAMESPACE}/secrets/pull")
    assert server.find(f"{CLAIMS}/data-pvc")
    assert not server.find("/apis/apps/v1/namespaces/robot-robot1/deployments/talker")


def test_claims_go_when_that_is_confirmed(server: Server, api: dict[str, Any]) -> None:
    update(api, "namespace")
    server.put(f"{CLAIMS}/old-pvc", {"metadata": {}})
    refused = update(api, "storage", storage_remove_claims=["old"], update_strict=True)
    assert refused["failed"]
    assert "would delete the data of old on robot1" in refused["msg"]
    assert not server.find(f"{CLAIMS}/data-pvc")  # refused before anything is written
    assert update(api, "storage", storage_remove_claims=["old"], storage_remove_confirm=True)["changed"]
    assert not server.find(f"{CLAIMS}/old-pvc")
    assert server.find(f"{CLAIMS}/data-pvc")


# --- who reaches its pods -------------------------------------------------------------------------------------------

POLICIES = "/apis/networking.k8s.io/v1/namespaces/robot-robot1/networkpolicies"
NODES = "/api/v1/nodes"


def node(server: Server, name: str, address: str, pods: str) -> None:
    status = {"addresses": [{"type": "InternalIP", "address": address}]}
    server.put(f"{NODES}/{name}", {"metadata": {}, "spec": {"podCIDRs": [pods]}, "status": status})


def sources(server: Server, name: str) -> list[str]:
    [rule] = server.find(f"{POLICIES}/{name}")["spec"]["ingress"]
    return [one["ipBlock"]["cidr"] for one in rule["from"] if "ipBlock" in one]


def times_asked(server: Server) -> int:
    """Not how often it was looked which labels nodes have."""
    asked = [server.requests.get()[:2] for _request in range(server.requests.qsize())]
    return sum(path == NODES and "labelSelector" not in query for path, query in asked)


def test_from_where_hosts_send_is_asked_for_once(server: Server, api: dict[str, Any]) -> None:
    """And again where a node has joined since; of the robot's own host, and of servers at the keeper's door."""
    node(server, "edge1", "192.0.2.1", "10.42.0.0/24")
    node(server, "robot1", "192.0.2.11", "10.42.1.0/24")
    assert outcome(update(api, "namespace"))["outcome"] == "updated"
    assert sources(server, "robot") == ["192.0.2.11/32", "10.42.1.0/24"]
    assert sources(server, "ros-keeper") == ["192.0.2.1/32", "10.42.0.0/32", "10.42.0.1/32"]
    again = update(api, "namespace")
    assert (again["changed"], times_asked(server)) == (False, 1)
    node(server, "robot2", "192.0.2.12", "10.42.2.0/24")
    other = fleet_of(ROBOT, robot(APP, name="robot2"))
    update(api, "namespace", **other, inventory_hostname="robot2")
    assert times_asked(server) == 1
    update(api, "namespace", **other, inventory_hostname="robot2")
    assert times_asked(server) == 0


def test_what_runs_on_the_network_of_edge_hosts_reaches_its_robot(server: Server, api: dict[str, Any]) -> None:
    node(server, "edge1", "192.0.2.1", "10.42.0.0/24")
    node(server, "robot1", "192.0.2.11", "10.42.1.0/24")
    update(api, "namespace", **fleet_of(robot({**APP, "host_network": True})))
    edge = ["192.0.2.1/32", "10.42.0.0/32", "10.42.0.1/32"]
    assert sources(server, "robot") == ["192.0.2.11/32", "10.42.1.0/24", *edge]


def test_of_a_standalone_robot_nobody_has_to_know_it(server: Server, api: dict[str, Any]) -> None:
    """What comes from a pod's own node reaches it anyway."""
    made = fleet_of(robot(APP, mode="standalone"))
    name = made["fleet"]["hosts"]["robot1"]["cluster"]
    server.put("/api/v1/namespaces/kube-system/configmaps/rosops-fleet", Identity("production", name).as_object())
    assert outcome(update(api, "namespace", **made))["outcome"] == "updated"
    assert times_asked(server) == 0


def test_policies_that_nobody_wants_go(server: Server, api: dict[str, Any]) -> None:
    web = {**APP, "ports": [{"name": "web", "port": 80}]}
    update(api, "namespace", **fleet_of(robot(web)))
    told = update(api, "namespace", check_mode=True, **fleet_of(robot(APP)))
    gone = [entry["before_header"] for entry in told["diff"] if "NetworkPolicy" in entry["before_header"]]
    assert gone == [f"NetworkPolicy robot-robot1/{APP['name']}.ports"]
    assert server.find(f"{POLICIES}/{APP['name']}.ports")
    assert gone[0] in outcome(update(api, "namespace", **fleet_of(robot(APP))))["reason"]
    assert not server.find(f"{POLICIES}/{APP['name']}.ports")


# --- what cannot go well --------------------------------------------------------------------------------------------


def test_check_mode_on_bare_hosts() -> None:
    result = update(NOWHERE, "namespace", "apps", check_mode=True)
    assert result["changed"]
    assert "there is no cluster yet; would create Namespace robot-robot1" in result["msg"]
    assert outcome(result) == {"outcome": "updated", "reason": result["msg"], "steps": []}
    assert "hunter2" not in str(result)


def test_without_a_cluster_a_run_says_so() -> None:
    result = update(NOWHERE, "apps")
    assert not result.get("failed")
    assert outcome(result)["outcome"] == "failed"
    assert "nothing was touched: There is no kubeconfig /nowhere/edge.yaml" in outcome(result)["reason"]
    assert update(NOWHERE, "apps", update_strict=True)["msg"] == f"failed: {outcome(result)['reason']}"


def test_steps_that_ended_before_the_robot_was_waited_for_are_told_whatever_comes_then(tmp_path: Path) -> None:
    step = StepResult("x", "camera", ("camera",), outcome="updated").as_dict()
    Ledger(tmp_path, "robot1", "robot").note("robot1", "waiting", reason="busy", steps=[step], since={})
    found = outcome(update(NOWHERE, "apps"))
    assert (found["outcome"], found["steps"]) == ("failed", [step])
    assert found["reason"].startswith("There is no kubeconfig")


class Turns:
    """The action of several robots of one run, each with the word that its engine comes to."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **words: str) -> None:
        self.words, self.turns = words, list[tuple[str, bool]]()
        monkeypatch.setattr(
            _robot_update.ActionModule, "_update", lambda module, params, _result: self.turn(module, params)
        )
        self.masters: dict[str, Any] = {"mode": "shared"}
        self.talkers: tuple[str, ...] = ()  # robots with an app of the fleet

    def turn(self, module: Any, params: dict[str, Any]) -> RobotOutcome:
        self.turns.append((module._host, params["own"]))
        return RobotOutcome(self.words[module._host] if not params["own"] else "updated", "why")

    def take(self, name: str, own: bool) -> dict[str, Any]:
        apps = [{**APP, "scope": "fleet"}] if name in self.talkers else []
        known = {**fleet_of(robot(*apps, name=name, master=self.masters)), "ansible_play_batch": [name]}
        known |= {"ansible_play_hosts_all": ["robot1", "robot2", "robot3"], "inventory_hostname": name}
        return run(_robot_update, {}, {**known, "update_own": own})


def test_the_first_robot_that_can_changes_what_is_the_whole_fleets(monkeypatch: pytest.MonkeyPatch) -> None:
    """Once in a run: the one that is off leaves it to the next. A fleet without anything shared has no such turn."""
    alone = Turns(monkeypatch)
    alone.masters = {}
    alone.take("robot1", own=False)
    assert alone.turns == []
    robots = Turns(monkeypatch, robot1="deferred-offline", robot2="updated", robot3="updated")
    for name in ("robot1", "robot2", "robot3"):
        robots.take(name, own=False)
    assert robots.turns == [("robot1", False), ("robot2", False)]
    assert robots.take("robot1", own=True)["outcome"]["outcome"] == "updated"


@pytest.mark.parametrize("word", ["updated", "failed"])
def test_what_of_the_fleets_a_later_robot_alone_has_is_changed_in_its_turn(
    word: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the turn before went well."""
    robots = Turns(monkeypatch, robot1=word, robot2="updated", robot3="updated")
    robots.talkers = ("robot2", "robot3")
    for name in ("robot1", "robot2", "robot3"):
        robots.take(name, own=False)
    assert [name for name, _own in robots.turns] == ["robot1", "robot2"][: 2 if word == "updated" else 1]


def test_a_robot_that_was_put_off_in_the_fleets_turn_comes_back_to_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """As by a rate that could not be told; nobody else takes the turn meanwhile."""
    for name in ("_since", "_begun"):
        monkeypatch.setattr(_robot_update.ActionModule, name, {}, raising=False)
    robots = Turns(monkeypatch, robot1="waiting", robot2="updated")
    assert robots.take("robot1", own=False)["waiting"]
    robots.take("robot2", own=False)
    robots.words["robot1"] = "updated"
    assert robots.take("robot1", own=False)["outcome"]["outcome"] == "updated"
    assert robots.turns == [("robot1", False), ("robot1", False)]


def test_whoever_could_not_change_what_is_the_fleets_goes_no_further(monkeypatch: pytest.MonkeyPatch) -> None:
    robots = Turns(monkeypatch, robot1="rolled-back")
    robots.take("robot1", own=False)
    robots.take("robot2", own=False)
    stays = robots.take("robot1", own=True)["outcome"]
    assert stays == {"outcome": "rolled-back", "reason": "why", "steps": []}
    told = robots.take("robot2", own=True)["outcome"]
    assert told["reason"] == "not begun: robot1 failed, which is more than update_failure_budget allows"


def test_a_robot_that_was_waited_for_has_begun(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Also where the first robot of it, by which it is known, has failed and left the play since (update_strict)."""
    wave = Ledger(tmp_path, "robot1", "robot")
    wave.note("robot2", "waiting", reason="busy", steps=[], since={})
    wave.note("robot1", "failed")
    assert Turns(monkeypatch, robot2="").take("robot2", own=True)["outcome"]["outcome"] == "updated"


@pytest.mark.parametrize(
    ("said", "to"),
    [
        ({}, ""),
        ({"update_back": True}, "previous"),
        ({"update_back": True, "update_to": 12345678}, "12345678"),
        ({"update_back": True, "update_to": 0o1234567}, "01234567"),
    ],
)
def test_what_is_asked_for_is_what_the_variables_say(
    monkeypatch: pytest.MonkeyPatch, said: dict[str, Any], to: str
) -> None:
    """As text, too, of a survey or of -e."""
    update = Mock(return_value=RobotOutcome("updated"))
    monkeypatch.setattr(_robot_update.ActionModule, "_update", update)
    run(_robot_update, {}, {**VARIABLES, "update_apps": "camera, lidar", "update_remove_apps": None, **said})
    asked, _result = update.call_args.args
    assert (asked["apps"], asked["remove_apps"], asked["to"]) == (["camera", "lidar"], [], to)


@pytest.mark.parametrize(("placement", "asked"), [("local", []), ("remote", ["edge1", "edge2"])])
def test_images_of_all_edge_hosts_are_known_from_one(
    monkeypatch: pytest.MonkeyPatch, api: dict[str, Any], placement: str, asked: list[str]
) -> None:
    told = {"edge1": {"present": {"docker.io/lab/apps:1.0": "sha256:1"}}, "edge3": {"unreachable": True}}
    hosts = {"edge1": {}, "edge2": {"edge_images": told}, "edge3": {"edge_images": told}}
    hostvars, settings = MagicMock(), list[Any]()
    hostvars.__getitem__.side_effect = hosts.__getitem__

    def engine(_robot: Any, given: Any, _cluster: Any, world: Any) -> SimpleNamespace:
        settings.append(given)

        def run() -> RobotOutcome:
            with pytest.raises(NotReadyError, match="b:1 is nowhere"):
                world.host.bring(["a:1"])
            return RobotOutcome("unchanged")

        verdict = {"verdict": "pass", "elapsed": 0.5}
        return SimpleNamespace(run=run, waiting={}, begun={}, graph_told=verdict, changes=[], left=False)

    bring = Mock(return_value={"failed": True, "msg": "b:1 is nowhere"})
    monkeypatch.setattr(_robot_update, "Engine", engine)
    monkeypatch.setattr(_robot_update.NodeImages, "bring", bring)
    known = {**VARIABLES, **fleet_of(robot({**APP, "placement": placement})), "hostvars": hostvars}
    brought = {"present": {"docker.io/library/redis:7": "sha256:7"}}
    known |= {"groups": {"edge": list(hosts)}, "images_brought": brought, "images_refs": ["always:1", "a:1"]}
    result = run(_robot_update, api, known)
    local = ["apps:1.0"] * (placement == "local")
    [(_archives, wanted, check, kept)] = [asked.args for asked in bring.mock_calls]
    assert ([*wanted], check) == (["always:1", "a:1"], False)
    assert set(local) <= {*kept}  # what stays pinned
    assert result["outcome"]["outcome"] == "unchanged"
    assert (result["verdict"], result["elapsed"]) == ("pass", 0.5)  # for the report
    assert hostvars.__getitem__.mock_calls == [call(name) for name in asked]
    assert settings[0].edge_images == ({"edge1": {"docker.io/lab/apps:1.0": "sha256:1"}} if asked else {})
    assert settings[0].known("edge1", "lab/apps:1.0") == ({"sha256:1"} if asked else ())
    assert settings[0].known("robot1", "redis:7") == {"sha256:7"}  # seen in this run
    assert not settings[0].known("robot1", "redis:8")
