# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The action: rolled out first, then the graph on the robot's host."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.action import _robot_ready
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import run
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server
from ansible_collections.rosops.fleet.tests.unit.robots import fleet_of, robot

EXTERNAL = fleet_of(robot(master={"mode": "external", "uri": "http://192.0.2.1:11311"}))
GRAPH = {"verdict": "pass", "ready": True, "changed": False}


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Mapping[str, Any]]:
    """What ros_ready is called with; the rollout takes no time."""
    calls: list[Mapping[str, Any]] = []

    class Host:
        def __init__(self, *_unused: object) -> None:
            pass

        def module(self, name: str, args: Mapping[str, Any]) -> dict[str, Any]:
            calls.append({"module": name, **args})
            return dict(GRAPH)

    monkeypatch.setattr(_robot_ready, "ActionHost", Host)
    monkeypatch.setattr(
        _robot_ready, "wait_for_rollout", lambda _kube, refs, _settings: {"objects": list(map(str, refs))}
    )
    return calls


def test_a_master_of_its_own(server: Server, api: dict[str, Any], asked: list[Mapping[str, Any]]) -> None:
    spec = {"clusterIP": "10.43.0.7", "ports": [{"port": 11311}]}
    server.put("/api/v1/namespaces/robot-robot1/services/ros-master", {"metadata": {}, "spec": spec})
    app = {"name": "talker", "image": "a:1", "pattern": "service", "readiness": {"timeout": 7, "services": ["/s"]}}
    result = run(_robot_ready, api, fleet_of(robot(app)))
    assert {"verdict": "pass", "changed": False}.items() <= result.items()
    assert {"Deployment robot-robot1/ros-master", "Deployment robot-robot1/talker"} <= set(result["rollout"]["objects"])
    [call] = asked
    assert (call["module"], call["master_uri"]) == ("rosops.fleet.ros_ready", "http://10.43.0.7:11311")
    assert (call["timeout"], call["services"]) == (7, [{"name": "/s"}])


def test_an_external_master(api: dict[str, Any], asked: list[Mapping[str, Any]]) -> None:
    result = run(_robot_ready, api, EXTERNAL)
    assert result["rollout"]["objects"] == []
    assert asked[0]["master_uri"] == "http://192.0.2.1:11311"


def test_a_master_that_was_never_applied(api: dict[str, Any], asked: list[Mapping[str, Any]]) -> None:
    result = run(_robot_ready, api, fleet_of(robot()))
    assert result["failed"]
    assert "Run the stage master" in result["msg"]
    assert not asked


@pytest.mark.parametrize("access", ["there", "nowhere"])
def test_check_mode_waits_for_nothing(api: dict[str, Any], asked: list[Mapping[str, Any]], access: str) -> None:
    args = api if access == "there" else {"kubeconfig": "/nowhere/edge.yaml"}
    result = run(_robot_ready, args, {}, check_mode=True)
    assert (result["changed"], result["skipped"]) == (False, True)
    assert not asked
