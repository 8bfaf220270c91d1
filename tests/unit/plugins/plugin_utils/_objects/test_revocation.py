# SPDX-License-Identifier: GPL-3.0-or-later
"""Whose rights the policy ends, which tokens were made for whom, and which Secrets a robot's pods name."""

from __future__ import annotations

from base64 import b64encode
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.revocation import (
    accounts_of,
    described,
    left_to_user,
    revocation_objects,
    tokens_of,
)
from ansible_collections.rosops.fleet.tests.unit.robots import robot


def test_the_policy_is_about_one_node_and_whatever_it_writes() -> None:
    policy, binding = revocation_objects("robot2")
    assert policy["metadata"]["name"] == binding["spec"]["policyName"] == "rosops-fleet-revoked-robot2"
    spec = policy["spec"]
    assert [one["expression"] for one in spec["matchConditions"]] == [
        "request.userInfo.username == 'system:node:robot2'"
    ]
    assert spec["matchConstraints"]["resourceRules"] == [
        {"apiGroups": ["*"], "apiVersions": ["*"], "operations": ["*"], "resources": ["*/*"]}
    ]
    assert (spec["failurePolicy"], binding["spec"]["validationActions"]) == ("Fail", ["Deny"])
    assert "; k3s_enrol takes it in again" in spec["validations"][0]["message"]


def test_tokens_are_found_by_what_they_were_made_for() -> None:
    def token(name: str, said: str | None) -> dict[str, Any]:
        data = {} if said is None else {"description": b64encode(said.encode()).decode()}
        return {"metadata": {"name": name}, "data": data}

    found = [token("a", described("robot2")), token("b", described("robot21")), token("c", None), token("d", "robot2")]
    assert tokens_of("robot2", found) == ["a"]
    assert tokens_of("robot2", [{"metadata": {"name": "e"}}]) == []


def test_accounts_are_named_once() -> None:
    def pod(**spec: str) -> dict[str, Any]:
        return {"metadata": {"namespace": "robot-robot2"}, "spec": spec}

    assert accounts_of([pod(), pod(serviceAccountName="ros-keeper"), pod()]) == [
        "robot-robot2/default", "robot-robot2/ros-keeper",
    ]  # fmt: skip


def test_what_is_left_is_named_and_not_shown_and_secrets_are_found_wherever_a_pod_names_one() -> None:
    variables = {
        "k3s_registries": {"configs": {"registry.lan": {"auth": {"password": "secret!"}}}},
        "k3s_config": {"vpn-auth": "joinKey=secret!", "node-label": ["a=b"]},
    }
    volumes = [{"secret": {"secretName": "plain"}}, {"projected": {"sources": [{"secret": {"name": "projected"}}]}}]
    container = {
        "env": [{"name": "KEY", "valueFrom": {"secretKeyRef": {"name": "variable", "key": "k"}}}],
        "envFrom": [{"secretRef": {"name": "all"}}],
    }
    pod = {"volumes": volumes, "containers": [container], "imagePullSecrets": [{"name": "pull"}, {}]}
    labels = {"secret": "by-name", "secretRef": None}  # somebody else's words
    shipper = {"metadata": {"namespace": "observability", "labels": labels}, "spec": {"template": {"spec": pod}}}
    held = {"metadata": {"namespace": "robot-robot1", "name": "held"}}
    left = left_to_user(robot(pull_secrets=[{"name": "registry"}]), variables, [held], [shipper])
    assert left[:9] == [
        *(f"Secret observability/{name}" for name in ("all", "plain", "projected", "pull", "variable")),
        "Secret robot-robot1/held", "Secret robot-robot1/registry",
        "the login for registry.lan (k3s_registries)", "what k3s_config says as vpn-auth",
    ]  # fmt: skip
    assert not [one for one in left[9:] if "Secret" in one or "secret!" in one]
