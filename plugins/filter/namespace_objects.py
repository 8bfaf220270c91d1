# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter namespace_objects: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: namespace_objects
short_description: Namespace, quota, limits and pull secrets of a robot
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Builds the Kubernetes objects that the robot's workloads live in.
extends_documentation_fragment: [rosops.fleet._context]
options:
  pull_secrets:
    description: Credentials of image registries (C(robot_namespace_pull_secrets)), for their Secrets.
    type: list
    elements: dict
    default: []
"""

EXAMPLES = r"""
- name: Show the objects
  ansible.builtin.debug:
    msg: "{{ context | rosops.fleet.namespace_objects }}"
  vars:
    context: "{{ fleet.robots[inventory_hostname] }}"
"""

RETURN = r"""
_value:
  description: Kubernetes objects in the order to apply them.
  type: list
  elements: dict
"""

from typing import Any, Callable, Mapping, Sequence

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module, robot_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects import namespace


def namespace_objects(ctx: Mapping[str, Any], pull_secrets: Sequence[Mapping[str, Any]] = ()) -> list[dict[str, Any]]:
    """The namespace's objects, and the Secrets of these credentials."""
    robot = robot_of(ctx)
    return [*namespace.namespace_objects(robot), *namespace.pull_secret_objects(robot, pull_secrets)]


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(namespace_objects=namespace_objects)
