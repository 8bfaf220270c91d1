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


SECRETS = (
    *("DB_PASSWORD", "API_KEY", "apikey", "AWS_SECRET_ACCESS_KEY", "TOKEN", "PGPASSWORD", "MQTT_AUTH", "DOOR_PIN"),
    *("MQTT_PASS", "PASS", "WIFI_PSK", "psk", "KEY_PASSPHRASE"),
)
NONE = ("ROS_IP", "ROS_MASTER_URI", "KEYBOARD", "AUTHOR", "PINS", "ROSOPS_SETTINGS", "LOW_PASS", "BYPASS")


def test_variables_whose_name_says_so() -> None:
    found = secrets_in(pod({name: f"of {name}" for name in (*SECRETS, *NONE)}))
    assert [*found] == [f"of {name}" for name in SECRETS]


def test_passwords_in_addresses_and_in_objects_that_are_kept_as_text() -> None:
    kept = {"data": {"history.json": json.dumps([pod({"DB_PASSWORD": 'hu"sh', "URL": "postgres://me:other@db/x"})])}}
    assert set(secrets_in(kept)) == {'hu"sh', "other"}
    shown = without(kept, dict.fromkeys(secrets_in(kept), "***"))
    assert json.loads(shown["data"]["history.json"]) == [pod({"DB_PASSWORD": "***", "URL": "postgres://me:***@db/x"})]


@pytest.mark.parametrize(
    "value",
    [
        {"args": ["--user=me", "--password=hush"]},
        {"args": ["serve -token hush"]},
        {"args": ["serve", "--token", "hush", "--verbose"]},
        {"args": ["curl", "-H", "Authorization: Bearer hush"]},
        {"data": {"file-0": "authorization: hush\n"}},
        {"args": ["--wifi-psk=hush"]},
        {"args": ["me:hush@db.example.org/x"]},
        {"data": {"file-0": "broker=me:hush@mqtt\nname=x"}},
        {"data": {"file-0": '{"auths": {"r.example": {"auth": "hush"}}}'}},
        {"data": {"file-0": '{"psk": "hush", "ssid": "lab"}'}},
        {"data": {"file-0": "user=me\nmqtt.password = hush\n"}},
        {"data": {"file-0": "broker:\n  api_key: 'hush'\n  port: 1883"}},
        {"data": {"file-0": 'export DB_PASSWORD="hush"\r\n'}},
        {"data": {"file-0": '{\n  "psk": "hush",\n  "ssid": "lab"\n}'}},
        {"data": {"file-0": "psk=hush\nscan_ssid=1"}},
        {"params": {"~password": "hush", "/mqtt/token": "hush"}},
    ],
)
def test_those_in_texts_and_under_keys(value: dict[str, Any]) -> None:
    assert {*secrets_in(value)} == {"hush"}


@pytest.mark.parametrize(
    "value",
    [
        {"image": "registry.example.org:5000/talker:v1.2.3@sha256:0123"},
        {"image": "talker:v1.2.3@sha256:0123"},
        {"args": ["--tokens", "3"]},
        {"data": {"file-0": "use_token: true\nmax_tokens: 512\ntoken:\nkeyboard = de\npublic_key: a"}},
        {"args": ["--tokens=3", "--topic=a", "rosrun", "x:=y", "http://a:80/x", "at 10:30 mail me@example.org"]},
        {"spec": {"secretName": "x", "secret": {"items": [{"key": "a", "path": "b"}]}}},
        {"automountServiceAccountToken": True},
    ],
)
def test_texts_that_are_none(value: dict[str, Any]) -> None:
    assert [*secrets_in(value)] == []


def test_a_short_one_is_hidden_where_it_stands_alone() -> None:
    assert without(["1", "v1.1", {"a": "1"}], {"1": "***"}) == ["***", "v1.1", {"a": "***"}]
