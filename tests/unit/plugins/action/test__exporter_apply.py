# SPDX-License-Identifier: GPL-3.0-or-later
"""The action: the exporter beside a robot's master."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.action import _exporter_apply
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import run
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server
from ansible_collections.rosops.fleet.tests.unit.robots import fleet_of, robot

VARIABLES: dict[str, Any] = fleet_of(robot())
DEPLOYMENT = "/apis/apps/v1/namespaces/robot-robot1/deployments/ros-exporter"


def test_it_is_applied_once(server: Server, api: dict[str, Any]) -> None:
    server.put("/api/v1/namespaces/robot-robot1", {"metadata": {}})
    result = run(_exporter_apply, api, VARIABLES)
    assert [f"{one['kind']} {one['name']}" for one in result["results"]] == [
        "ConfigMap ros-exporter",
        "Deployment ros-exporter",
    ]
    assert not run(_exporter_apply, api, VARIABLES)["changed"]


@pytest.mark.parametrize(("level", "sees"), [("", True), ("privileged", True), ("baseline", False)])
def test_it_sees_what_claims_hold_unless_the_namespace_forbids_it(
    server: Server, api: dict[str, Any], level: str, sees: bool
) -> None:
    server.put("/api/v1/namespaces/robot-robot1", {"metadata": {}})
    run(_exporter_apply, api, fleet_of(robot(volumes=[{"name": "logs"}], pod_security=level)))
    assert ("/var/lib/rancher/k3s/storage" in str(server.find(DEPLOYMENT))) is sees


def test_check_mode_on_bare_hosts() -> None:
    result = run(_exporter_apply, {"kubeconfig": "/nowhere/edge.yaml"}, VARIABLES, check_mode=True)
    assert result["changed"]
    assert "there is no cluster yet; would create" in result["msg"]
