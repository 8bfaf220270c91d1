# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of the inventory and values of Secrets in an app's container."""

from __future__ import annotations

from typing import Any

import kubernetes_validate
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.files import file_maps
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import APPS, MASTER, ground_objects
from ansible_collections.rosops.fleet.tests.unit.robots import robot

APP = {"name": "arm", "image": "example.org/arm:1.0", "command": ["run"], "hooks": "none"}


def made(*files: dict[str, Any], **more: Any) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """The ConfigMaps, and the Deployment's pod template."""
    one = robot({**APP, "files": files, **more}, master={"mode": "shared"})
    (deployment,) = app_objects(one)
    for item in (*file_maps(one), deployment):
        kubernetes_validate.validate(item, "1.34", strict=True)
    return file_maps(one), deployment["spec"]["template"]


def test_another_content_is_another_map_and_another_revision() -> None:
    (one,), first = made({"path": "/p", "content": "a"})
    (two,), second = made({"path": "/p", "content": "b"})
    (again,), third = made({"path": "/p", "content": "a"})
    assert (one, first) == (again, third)
    assert one["metadata"]["name"] != two["metadata"]["name"]
    assert first["metadata"]["labels"] != second["metadata"]["labels"]
    assert made({"path": "/p", "content": "a", "mode": "0755"})[1] != first


def test_maps_are_where_their_pods_are_and_come_before_them() -> None:
    files = [{"path": "/p", "content": "a"}]
    one = robot({**APP, "files": files, "scope": "fleet"}, {**APP, "name": "eye"}, master={"mode": "shared"})
    (held,) = file_maps(one)
    assert held["metadata"]["namespace"] == "fleet"
    assert "rosops.fleet/robot" not in held["metadata"]["labels"]
    assert held in ground_objects(one, [APPS], (), {})
    assert held not in ground_objects(one, [MASTER], (), {})
    assert made({"path": "/p", "secret": "s"})[0] == []
