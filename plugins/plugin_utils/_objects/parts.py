# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts that make up a robot in its cluster, in the order in which they are applied."""

from __future__ import annotations

from typing import Any, Callable, Mapping, Sequence

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.code_files import app_files
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.code_maps import code_maps
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.common import Object
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.master import master_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.namespace import (
    namespace_objects,
    pull_secret_objects,
    storage_objects,
)

# Read once in Ansible's main process, which imports the actions: the workers of all robots have it then.
CODE = app_files()
PullSecrets = Sequence[Mapping[str, Any]]


def _namespace(robot: Robot, secrets: PullSecrets) -> list[Object]:
    return [*namespace_objects(robot), *pull_secret_objects(robot, secrets)]


def _storage(robot: Robot, _secrets: PullSecrets) -> list[Object]:
    return storage_objects(robot)


def _master(robot: Robot, _secrets: PullSecrets) -> list[Object]:
    """With the code that its keeper runs, so that the part is whole without the apps."""
    made = master_objects(robot)
    return [*code_maps(robot, CODE), *made] if made else []


def _apps(robot: Robot, _secrets: PullSecrets) -> list[Object]:
    return app_objects(robot, CODE)


PARTS: dict[str, Callable[[Robot, PullSecrets], list[Object]]] = {
    "namespace": _namespace,
    "storage": _storage,
    "master": _master,
    "apps": _apps,
}


def part_objects(part: str, robot: Robot, secrets: PullSecrets = ()) -> list[Object]:
    """The objects of one part; `secrets` are the credentials of robot_namespace_pull_secrets."""
    return PARTS[part](robot, secrets)


def awaited_objects(robot: Robot) -> list[Object]:
    """Everything of the robot that is rolled out before its graph is asked."""
    made = [*storage_objects(robot), *master_objects(robot), *app_objects(robot)]
    return [one for one in made if one["kind"] != "Service"]
