# SPDX-License-Identifier: GPL-3.0-or-later
"""The playbook revoke asks the robot's cluster and nobody else, says what is left, and does all of it once."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.revocation import refusal_of
from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import Control
from ansible_collections.rosops.fleet.tests.unit.playbooks.robot_runs import Run
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server

NODE, SYSTEM, SPACE = "/api/v1/nodes/robot2", "/api/v1/namespaces/kube-system", "/api/v1/namespaces/robot-robot2"


@pytest.fixture
def stolen(control: Control, server: Server, monkeypatch: pytest.MonkeyPatch) -> Control:
    """Robot2, whose kubelet is refused once its policy is there."""
    for path in (SYSTEM, SPACE, NODE):
        server.put(path, {"metadata": {}})
    server.put(
        f"{SPACE}/secrets/cloud", {"metadata": {"namespace": "robot-robot2"}, "data": {"key": "dmVyeS1zZWNyZXQ="}}
    )
    real = server.write

    def write(method: str, path: str, query: dict[str, str], body: Any, content: str) -> tuple[int, Any]:
        if (method, path) == ("PATCH", NODE):
            return 403, f"denied request: {refusal_of('robot2')}"
        return real(method, path, query, body, content)

    monkeypatch.setattr(server, "write", write)
    return control


def revoke(control: Control, *arguments: str, **said: str) -> Run:
    return Run(control, "all", *arguments, playbook="revoke", **said)


def test_a_robot_is_named_and_not_asked(stolen: Control, server: Server) -> None:
    for unnamed in (revoke(stolen), Run(stolen, "edge1", playbook="revoke", robot="robot2")):
        assert unnamed.status == 2
        assert "Name one robot of the inventory, and none that --limit leaves out: -e robot=robot2" in unnamed.output
    assert not stolen.asked
    looked = revoke(stolen, "--check", robot="robot2")
    assert looked.status == 0
    assert "Secret robot-robot2/cloud" in looked.output
    assert server.find(NODE)
    done = revoke(stolen, "--diff", robot="robot2")
    assert (done.status, server.find(NODE)) == (0, None)
    assert "very-secret" not in done.output
    assert "dmVyeS1zZWNyZXQ=" not in done.output
    assert {one for one in stolen.asked if one.startswith("192.0.2.1")} <= {"192.0.2.1"}  # edge1, which is off
    assert (done.outcome("robot2")[0], done.outcome("robot1")[0]) == ("updated", "unchanged")
    assert "Secret robot-robot2/cloud" in done.outcome("robot2")[1]
    again = revoke(stolen, robot="robot2", k3s_enrol="robot3,robot4")
    assert again.status == 0
    assert "changed=0" in again.output.rpartition("PLAY RECAP")[2].partition("robot2")[2]
