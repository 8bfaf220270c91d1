# SPDX-License-Identifier: GPL-3.0-or-later
"""What an app has beside its Deployment: files of the inventory, and a Service in front of its ports."""

from __future__ import annotations

from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.belongings import belongings
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import APPS, MASTER, ground_objects
from ansible_collections.rosops.fleet.tests.unit.api_schema import fits_the_api
from ansible_collections.rosops.fleet.tests.unit.robots import robot

Object = dict[str, Any]
APP = {"name": "bridge", "image": "example.org/bridge:1.0", "command": ["run"], "hooks": "none"}


def made(**more: Any) -> tuple[list[Object], Object]:
    """What belongs to an app, which is there before it and with no other part, and its Deployment."""
    one = robot({**APP, **more}, {**APP, "name": "eye"}, master={"mode": "shared"})
    held, deployment = belongings(one), app_objects(one)[0]
    for item in (*held, deployment):
        fits_the_api(item)
    for item in held:
        assert item in ground_objects(one, [APPS], (), {})
        assert item not in ground_objects(one, [MASTER], (), {})
        assert item["metadata"]["namespace"] == deployment["metadata"]["namespace"]
    return held, deployment


def file(content: str, **more: Any) -> tuple[Object, Object]:
    """The ConfigMap, and the pod template."""
    (held,), deployment = made(files=[{"path": "/p", "content": content, **more}])
    return held, deployment["spec"]["template"]


def test_another_content_is_another_map_and_another_revision() -> None:
    one, first = file("a")
    two, second = file("b")
    assert (one, first) == file("a")
    assert one["metadata"]["name"] != two["metadata"]["name"]
    assert first["metadata"]["labels"] != second["metadata"]["labels"]
    assert file("a", mode="0755")[1] != first
    assert made(files=[{"path": "/p", "secret": "s"}])[0] == []


def test_a_port_of_all_hosts_overlaps_and_one_of_the_robot_s_does_not() -> None:
    port = {"name": "web", "port": 9090}
    (service,), deployment = made(ports=[{**port, "node_port": 30090}], pattern="pubsub")
    assert service["spec"]["selector"] == deployment["spec"]["selector"]["matchLabels"]
    assert deployment["spec"]["strategy"]["type"] == "RollingUpdate"
    _service, deployment = made(ports=[{**port, "host_port": 80}], placement="local")
    assert deployment["spec"]["strategy"]["type"] == "Recreate"


def test_what_is_the_fleet_s_is_no_robot_s() -> None:
    files, ports = [{"path": "/p", "content": "a"}], [{"name": "web", "port": 9090}]
    held, _deployment = made(files=files, ports=ports, scope="fleet")
    assert [item["kind"] for item in held] == ["ConfigMap", "Service"]
    for item in held:
        assert item["metadata"]["namespace"] == "fleet"
        assert "rosops.fleet/robot" not in item["metadata"]["labels"]
