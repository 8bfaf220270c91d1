# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts that make up a robot in its cluster, in the order in which they are applied."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.code_files import app_files, exporter_files
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.code_maps import code_maps
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.common import Object
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.exporter import Settings, exporter_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.master import master_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.namespace import (
    namespace_objects,
    pull_secret_objects,
    storage_objects,
)

# Read once in Ansible's main process, which imports the actions: the workers of all robots have it then.
CODE = app_files()


@dataclass(frozen=True)
class Outside:
    """What is no part of a robot but of its objects: the items of robot_namespace_pull_secrets, settings."""

    pull_secrets: Sequence[Mapping[str, Any]] = ()
    exporter: Settings = field(default_factory=Settings)


def _namespace(robot: Robot, outside: Outside) -> list[Object]:
    return [*namespace_objects(robot), *pull_secret_objects(robot, outside.pull_secrets)]


def _master(robot: Robot, _outside: Outside) -> list[Object]:
    """With the code that its keeper runs, so that the part is whole without the apps."""
    made = master_objects(robot)
    return [*code_maps(robot, CODE), *made] if made else []


PARTS: dict[str, Callable[[Robot, Outside], list[Object]]] = {
    "namespace": _namespace,
    "storage": lambda robot, _outside: storage_objects(robot),
    "master": _master,
    "apps": lambda robot, _outside: app_objects(robot, CODE),
    "exporter": lambda robot, outside: exporter_objects(robot, exporter_files(), outside.exporter),
}


def part_objects(part: str, robot: Robot, outside: Outside | None = None) -> list[Object]:
    """The objects of one part."""
    return PARTS[part](robot, outside or Outside())


def awaited_objects(robot: Robot) -> list[Object]:
    """Everything of the robot that is rolled out before its graph is asked."""
    made = [*storage_objects(robot), *master_objects(robot), *app_objects(robot)]
    return [one for one in made if one["kind"] != "Service"]
