# SPDX-License-Identifier: GPL-3.0-or-later
"""Secrets among what is shown of objects."""

from __future__ import annotations

import json
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.secrets import secrets_in, without


def pod(env: dict[str, str]) -> dict[str, Any]:
    variables = [{"name": name, "value": value} for name, value in env.items()]
    return {"spec": {"containers": [{"name": "ros-app", "env": variables}]}}


@pytest.mark.parametrize(
    "name",
    ["DB_PASSWORD", "API_KEY", "apikey", "AWS_SECRET_ACCESS_KEY", "TOKEN", "PGPASSWORD", "MQTT_AUTH", "DOOR_PIN"],
)
def test_variables_whose_name_says_so(name: str) -> None:
    assert list(secrets_in(pod({name: "hush", "ROS_IP": "10.0.0.1"}))) == ["hush"]


@pytest.mark.parametrize("name", ["ROS_MASTER_URI", "KEYBOARD", "AUTHOR", "PINS", "ROSOPS_SETTINGS"])
def test_variables_that_are_none(name: str) -> None:
    assert list(secrets_in(pod({name: "plain"}))) == []


def test_passwords_in_addresses_and_in_objects_that_are_kept_as_text() -> None:
    kept = {"data": {"history.json": json.dumps([pod({"DB_PASSWORD": 'hu"sh', "URL": "postgres://me:other@db/x"})])}}
    assert set(secrets_in(kept)) == {'hu"sh', "other"}
    shown = without(kept, dict.fromkeys(secrets_in(kept), "***"))
    assert json.loads(shown["data"]["history.json"]) == [pod({"DB_PASSWORD": "***", "URL": "postgres://me:***@db/x"})]


def test_a_short_one_is_hidden_where_it_stands_alone() -> None:
    assert without(["1", "v1.1", {"a": "1"}], {"1": "***"}) == ["***", "v1.1", {"a": "***"}]
