# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter storage_objects: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: storage_objects
short_description: Persistent volume claims of a robot
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Builds one claim C(<name>-pvc) per item of C(persistent_storage.volumes).
extends_documentation_fragment: [rosops.fleet._context]
"""

EXAMPLES = r"""
- name: Show the objects
  ansible.builtin.debug:
    msg: "{{ context | rosops.fleet.storage_objects }}"
  vars:
    context: "{{ fleet.robots[inventory_hostname] }}"
"""

RETURN = r"""
_value:
  description: Kubernetes objects.
  type: list
  elements: dict
"""

from typing import Any, Callable, Mapping

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module, robot_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects import namespace


def storage_objects(ctx: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Of the robot that was given."""
    return namespace.storage_objects(robot_of(ctx))


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(storage_objects=storage_objects)
