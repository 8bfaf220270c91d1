# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts that make up a robot in its cluster, which are the stages of rosops.fleet.site, too. Pure."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from ...module_utils._common.documents import Variables
from ...module_utils._step.objects import Object
from .._model.context import Robot
from .app import app_objects
from .code_files import app_files
from .code_maps import code_maps
from .files import file_maps
from .keeper_access import keeper_access
from .master import master_objects
from .namespace import namespace_objects, pull_secret_objects, storage_objects
from .ports import port_services

NAMESPACE, STORAGE, MASTER, APPS, READY = PARTS = ("namespace", "storage", "master", "apps", "ready")

# Read once in Ansible's main process, which imports the actions: the workers of all robots have it then.
CODE = app_files()


def tagged_parts(parts: Sequence[str], run_tags: Collection[str], skip_tags: Collection[str] = ()) -> tuple[str, ...]:
    """Those of the parts that a run's tags mean: all of them, unless some are named.

    >>> tagged_parts(PARTS, ["apps", "ready"]), tagged_parts(("apps",), ["all"], ["ready"])
    (('apps', 'ready'), ('apps',))
    """
    named = [part for part in parts if part in run_tags] or parts
    return tuple(part for part in named if part not in skip_tags)


def ground_objects(
    robot: Robot, parts: Collection[str], pull_secrets: Sequence[Variables], code: Mapping[str, str]
) -> list[Object]:
    """What the pods stand on, and what changes without any of them.

    These are namespace, Secrets, claims, the code in the pods, the files of versions to come, and apps' Services.

    `pull_secrets` are the items of robot_namespace_pull_secrets, `code` is file name -> content.
    """
    found: list[Object] = []
    if NAMESPACE in parts:
        found += [*namespace_objects(robot), *pull_secret_objects(robot, pull_secrets)]
    elif MASTER in parts:
        found += keeper_access(robot)
    if STORAGE in parts:
        found += storage_objects(robot)
    if MASTER in parts or APPS in parts:
        found += code_maps(robot, code)
    if APPS in parts:
        found += [*file_maps(robot), *port_services(robot)]
    return found


def workload_objects(robot: Robot, parts: Collection[str]) -> list[Object]:
    """What runs, with its Services."""
    made = master_objects(robot) if MASTER in parts else []
    return [*made, *(app_objects(robot) if APPS in parts else [])]
