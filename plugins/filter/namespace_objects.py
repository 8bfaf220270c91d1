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
"""

EXAMPLES = r"""
- name: Show the objects
  ansible.builtin.debug:
    msg: "{{ context | rosops.fleet.namespace_objects }}"
  vars:
    context: "{{ hostvars | rosops.fleet.fleet_context(inventory_hostname) }}"
"""

RETURN = r"""
_value:
  description: Kubernetes objects in the order to apply them.
  type: list
  elements: dict
"""

from typing import Any, Callable, Mapping

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module, robot_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects import namespace


def namespace_objects(ctx: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Of the robot that was given."""
    robot = robot_of(ctx)
    return [*namespace.namespace_objects(robot), *namespace.pull_secret_objects(robot, ctx.get("pull_secrets") or [])]


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(namespace_objects=namespace_objects)
