# SPDX-License-Identifier: GPL-3.0-or-later
"""The stack of a cluster: what is applied in which order, what is taken away, and what is waited for."""

from __future__ import annotations

import base64
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.action import _observability_stack
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.role_specs import role_options
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import run
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server
from ansible_collections.rosops.fleet.tests.unit.robots import fleet_of, robot

READY = {"metadata": {"name": "edge1"}, "status": {"conditions": [{"type": "Ready", "status": "True"}]}}
OFF = {"metadata": {"name": "robot1"}, "status": {"conditions": [{"type": "Ready", "status": "Unknown"}]}}
OPTIONS = {name: option.get("default") for name, option in role_options("observability").items()}
DEFAULTS: dict[str, Any] = {**OPTIONS, **fleet_of(robot())}
CLAIMS = "/api/v1/namespaces/observability/persistentvolumeclaims"
SECRETS = "/api/v1/namespaces/observability/secrets"


Task = Callable[..., dict[str, Any]]


@pytest.fixture(name="stack")
def _stack(server: Server, api: dict[str, Any]) -> Task:
    """The task, with settings in place of the role's defaults."""
    server.lists["/api/v1/nodes"] = [READY]
    return lambda check=False, **given: run(_observability_stack, api, {**DEFAULTS, **given}, check)


@pytest.fixture(name="waited", autouse=True)
def _waited(monkeypatch: pytest.MonkeyPatch) -> list[set[str]]:
    """The kinds that each wait was for."""
    found: list[set[str]] = []

    def wait(_kube: Any, refs: Any, _settings: Any) -> None:
        found.append({ref.kind for ref in refs})

    monkeypatch.setattr(_observability_stack, "wait_for_rollout", wait)
    return found


def certificate(said: str) -> dict[str, Any]:
    texts = {"tls.crt": f"certificate {said}", "tls.key": f"key-of {said}", "ca.crt": "authority"}
    data = {name: base64.b64encode(text.encode()).decode() for name, text in texts.items()}
    return {"apiVersion": "v1", "kind": "Secret", "type": "kubernetes.io/tls", "metadata": {}, "data": data}


def test_all_of_it_is_applied_once_and_waited_for(server: Server, stack: Task, waited: list[set[str]]) -> None:
    first = stack(observability={"grafana": {"admin_password": "hush"}})
    assert first["changed"]
    assert server.writes[0].endswith("/namespaces/observability")
    assert server.writes[1].endswith("/secrets/grafana-admin")
    assert waited == [{"Deployment", "DaemonSet", "PersistentVolumeClaim"}]
    assert "aHVza" not in str(first["diff"])
    second = stack()  # the password is the cluster's from now on
    assert (second["changed"], second["diff"]) == (False, [])


def test_check_mode_writes_nothing_and_waits_for_nothing(server: Server, stack: Task, waited: list[set[str]]) -> None:
    assert stack(check=True)["changed"]
    assert (server.find("/api/v1/namespaces/observability"), waited) == (None, [])


def test_what_every_host_runs_is_not_waited_for_while_one_is_off(
    server: Server, stack: Task, waited: list[set[str]]
) -> None:
    server.lists["/api/v1/nodes"].append(OFF)
    stack()
    assert waited == [{"Deployment", "PersistentVolumeClaim"}]


def test_a_part_that_is_switched_off_is_taken_away_but_not_its_claim(server: Server, stack: Task) -> None:
    stack()
    deployment = "/apis/apps/v1/namespaces/observability/deployments/loki"
    assert server.find(deployment)
    assert stack(observability={"loki": {"enabled": False}})["changed"]
    assert server.find(deployment) is None
    assert server.find(f"{CLAIMS}/loki")


def test_what_somebody_else_runs_there_under_the_same_name_stays(server: Server, stack: Task) -> None:
    deployment = "/apis/apps/v1/namespaces/observability/deployments/grafana"
    labels = {"app.kubernetes.io/managed-by": "Helm"}
    server.put(deployment, {"apiVersion": "apps/v1", "kind": "Deployment", "metadata": {"labels": labels}})
    stack(observability={"grafana": {"enabled": False}})
    assert server.find(deployment)


def test_certificates_have_to_be_there_and_another_one_restarts_who_reads_it_once(server: Server, stack: Task) -> None:
    named = {"observability_tls_secret_name": "telemetry-tls"}
    result = stack(**named)
    assert (result["failed"], server.writes) == (True, [])
    assert "the Secret telemetry-tls in the namespace observability has no tls.crt" in result["msg"]
    for name in ("telemetry-tls", "telemetry-tls-shipper"):
        server.put(f"{SECRETS}/{name}", certificate("one"))
    assert stack(**named)["changed"]
    assert not stack(**named)["changed"]
    other = server.put(f"{SECRETS}/telemetry-tls", certificate("another"))
    changed = stack(**named)["diff"]
    assert [one["before_header"] for one in changed] == [
        "Deployment observability/loki",
        "Deployment observability/grafana",
    ]
    assert [text for text in other["data"].values() if text in str(changed)] == []


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"observability_profile": "robot"}, "observability_hub_url"),
        ({"observability_dashboards": ["/none.json"]}, "/none.json: No such file"),
        ({"observability_profile": "king"}, "observability_profile"),
    ],
)
def test_a_wrong_setting_is_told_before_anything_is_applied(
    server: Server, stack: Task, given: dict[str, Any], words: str
) -> None:
    result = stack(**given)
    assert (result["failed"], server.writes) == (True, [])
    assert words in result["msg"]


def test_without_a_cluster_check_mode_names_what_would_be_there(tmp_path: Path) -> None:
    none = {"kubeconfig": str(tmp_path / "edge.yaml")}
    assert "Deployment observability/grafana\n" in run(_observability_stack, none, DEFAULTS, True)["diff"]["after"]
