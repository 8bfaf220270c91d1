# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts of a robot."""

from __future__ import annotations

from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import PARTS, awaited_objects, part_objects
from ansible_collections.rosops.fleet.tests.unit.robots import robot

TALKER: dict[str, Any] = {"name": "talker", "image": "a:1", "volumes": [{"name": "data"}]}


def kinds(objects: list[dict[str, Any]]) -> list[str]:
    return [f"{one['kind']} {one['metadata']['name']}" for one in objects]


def test_every_part_says_where_all_of_it_lives() -> None:
    made = robot(TALKER, volumes=[{"name": "data"}])
    for part in PARTS:
        for one in part_objects(part, made):
            assert one["metadata"].get("namespace", one["metadata"]["name"]) == "robot-robot1"


def test_a_master_of_ones_own_comes_with_its_keeper_s_code() -> None:
    assert kinds(part_objects("master", robot()))[0] == "ConfigMap rosops-code"
    assert part_objects("master", robot(TALKER, master={"mode": "external", "uri": "http://a:1"})) == []


def test_what_is_awaited() -> None:
    awaited = kinds(awaited_objects(robot(TALKER, volumes=[{"name": "data"}])))
    assert {"PersistentVolumeClaim data-pvc", "Deployment ros-master", "Deployment talker"} <= set(awaited)
    assert not [name for name in awaited if name.startswith(("Service", "ConfigMap rosops-code"))]
