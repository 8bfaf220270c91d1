# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Ports of an app, and the Service in front of them."""

from __future__ import annotations

from typing import Any

import kubernetes_validate
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import APPS, MASTER, ground_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.ports import port_services
from ansible_collections.rosops.fleet.tests.unit.robots import robot

BRIDGE = {"name": "bridge", "image": "example.org/bridge:1.0", "command": ["run"], "pattern": "pubsub", "hooks": "none"}


def made(*ports: dict[str, Any], **more: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """The Service and the Deployment."""
    one = robot({**BRIDGE, "ports": ports, **more}, master={"mode": "shared"})
    (service,), (deployment,) = port_services(one), app_objects(one)
    for item in (service, deployment):
        kubernetes_validate.validate(item, "1.34", strict=True)
    assert service in ground_objects(one, [APPS], (), {})
    assert service not in ground_objects(one, [MASTER], (), {})
    assert service["spec"]["selector"] == deployment["spec"]["selector"]["matchLabels"]
    assert all(service["metadata"][key] == deployment["metadata"][key] for key in ("namespace", "name"))
    return service, deployment


def test_a_port_of_all_hosts_overlaps_and_one_of_the_robot_s_does_not() -> None:
    service, deployment = made({"name": "web", "port": 9090, "node_port": 30090})
    assert (service["spec"]["type"], service["spec"]["ports"][0]["nodePort"]) == ("NodePort", 30090)
    assert deployment["spec"]["strategy"]["type"] == "RollingUpdate"
    _service, deployment = made({"name": "web", "port": 9090, "host_port": 80}, placement="local")
    assert deployment["spec"]["template"]["spec"]["containers"][0]["ports"][0]["hostPort"] == 80
    assert deployment["spec"]["strategy"]["type"] == "Recreate"


def test_what_is_the_fleet_s_is_no_robot_s() -> None:
    service, _deployment = made({"name": "web", "port": 9090}, scope="fleet")
    assert service["metadata"]["namespace"] == "fleet"
    assert "rosops.fleet/robot" not in service["metadata"]["labels"]
    assert port_services(robot(BRIDGE)) == []
