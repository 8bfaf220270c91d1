# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The action: a host's variables in, one part of its robot in the cluster."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.action import _robot_apply
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import run
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server
from ansible_collections.rosops.fleet.tests.unit.robots import fleet_of, robot

SECRET = {"name": "pull", "registry": "r.example", "username": "u", "password": "hunter2"}
ROBOT = robot(
    {"name": "talker", "image": "apps:1.0", "pattern": "pubsub"}, volumes=[{"name": "data"}], pull_secrets=[SECRET]
)
VARIABLES: dict[str, Any] = {**fleet_of(ROBOT), "robot_namespace_pull_secrets": [SECRET]}
CLAIMS = "/api/v1/namespaces/robot-robot1/persistentvolumeclaims"


def apply(api: dict[str, Any], part: str, check_mode: bool = False, **options: Any) -> dict[str, Any]:
    return run(_robot_apply, {**api, "part": part, **options}, VARIABLES, check_mode)


def named(result: dict[str, Any]) -> list[str]:
    return [f"{one['kind']} {one['name']}" for one in result["results"]]


def test_part_by_part(api: dict[str, Any]) -> None:
    parts = {part: apply(api, part) for part in ("namespace", "storage", "master", "apps")}
    rights = [f"{kind} ros-keeper" for kind in ("ServiceAccount", "Role", "RoleBinding")]
    assert named(parts["namespace"]) == ["Namespace robot-robot1", *rights, "Secret pull"]
    assert named(parts["storage"]) == ["PersistentVolumeClaim data-pvc"]
    assert {"ConfigMap rosops-code", "Deployment ros-master", "Service ros-master"} <= set(named(parts["master"]))
    assert named(parts["apps"]) == ["ConfigMap rosops-code", "Deployment talker"]
    assert all(result["changed"] for result in parts.values())
    assert not any(apply(api, part)["changed"] for part in parts)


def test_what_is_in_a_secret_is_seen_nowhere(server: Server, api: dict[str, Any]) -> None:
    result = apply(api, "namespace")
    stored = server.find("/api/v1/namespaces/robot-robot1/secrets/pull")["data"][".dockerconfigjson"]
    assert stored not in str(result)
    assert "hunter2" not in str(result)


def test_claims_go_when_that_is_confirmed(server: Server, api: dict[str, Any]) -> None:
    apply(api, "namespace")
    server.put(f"{CLAIMS}/old-pvc", {"metadata": {}})
    refused = apply(api, "storage", remove_claims=["old"])
    assert refused["failed"]
    assert "would delete the data of old on robot1" in refused["msg"]
    assert apply(api, "storage", remove_claims=["data"], remove_confirm=True)["failed"]  # the inventory has it
    assert not server.find(f"{CLAIMS}/data-pvc")  # refused before anything is written
    assert apply(api, "storage", remove_claims=["old"], remove_confirm=True)["changed"]
    assert not server.find(f"{CLAIMS}/old-pvc")
    assert server.find(f"{CLAIMS}/data-pvc")


@pytest.mark.parametrize("part", ["namespace", "apps"])
def test_check_mode_on_bare_hosts(part: str) -> None:
    result = apply({"kubeconfig": "/nowhere/edge.yaml"}, part, check_mode=True)
    assert result["changed"]
    assert "there is no cluster yet; would create" in result["msg"]


def test_the_exporter_is_a_part_too(server: Server, api: dict[str, Any]) -> None:
    apply(api, "namespace")
    assert named(apply(api, "exporter", statistics=True)) == ["ConfigMap ros-exporter", "Deployment ros-exporter"]
    assert "statistics" in str(server.find("/apis/apps/v1/namespaces/robot-robot1/deployments/ros-exporter"))


def test_before_the_validation_it_says_so(api: dict[str, Any]) -> None:
    failed = run(_robot_apply, {**api, "part": "apps"}, {})
    assert failed["failed"]
    assert "import the playbook rosops.fleet.validate" in failed["msg"]


def test_a_kubeconfig_that_was_given_and_is_not_there() -> None:
    failed = apply({"kubeconfig": "/nowhere/edge.yaml"}, "apps")
    assert failed["failed"]
    assert "There is no kubeconfig /nowhere/edge.yaml" in failed["msg"]


def test_a_refusal_names_what_was_written_before(server: Server, api: dict[str, Any]) -> None:
    apply(api, "namespace")
    server.write_refusals += [(422, "no")]
    failed = apply(api, "apps")
    assert (failed["failed"], failed["applied"]) == (True, [])


def test_check_mode_writes_nothing(server: Server, api: dict[str, Any]) -> None:
    result = apply(api, "namespace", check_mode=True)
    assert [one["before_header"] for one in result["diff"]] == [
        "Namespace robot-robot1",
        *(f"{kind} robot-robot1/ros-keeper" for kind in ("ServiceAccount", "Role", "RoleBinding")),
        "Secret robot-robot1/pull",
    ]
    assert not server.find("/api/v1/namespaces/robot-robot1")
