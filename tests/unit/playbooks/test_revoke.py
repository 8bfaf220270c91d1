# SPDX-License-Identifier: GPL-3.0-or-later
"""The playbook revoke asks the robot's cluster and nobody else, says what is left, and does all of it once."""

from __future__ import annotations

import json
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.revocation import refusal_of
from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import Control
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
    control.plays("revoke")
    return control


def test_a_robot_is_named_and_not_asked(stolen: Control, server: Server) -> None:
    unnamed = stolen.run()
    assert unnamed.returncode == 2
    assert "Name one robot of the inventory: -e robot=robot2" in unnamed.stdout
    assert not stolen.asked
    looked = stolen.run("-e", "robot=robot2", "--check")
    assert looked.returncode == 0
    assert "Secret robot-robot2/cloud" in looked.stdout
    assert server.find(NODE)
    done = stolen.run("-e", "robot=robot2", "--diff")
    assert (done.returncode, server.find(NODE)) == (0, None)
    assert "very-secret" not in done.stdout
    assert "dmVyeS1zZWNyZXQ=" not in done.stdout
    assert {one for one in stolen.asked if one.startswith("192.0.2.1")} <= {"192.0.2.1"}  # edge1, which is off
    told = {one["host"]: one for one in json.loads((stolen.folder / "report.json").read_text())["hosts"]}
    assert (told["robot2"]["outcome"], told["robot1"]["outcome"]) == ("updated", "unchanged")
    assert "Secret robot-robot2/cloud" in told["robot2"]["reason"]
    again = stolen.run("-e", "robot=robot2", "-e", "k3s_enrol=robot3,robot4")
    assert again.returncode == 0
    assert "changed=0" in again.stdout.rpartition("PLAY RECAP")[2].partition("robot2")[2]
