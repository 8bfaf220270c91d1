# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter ros_master_objects: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: ros_master_objects
short_description: ROS master of a robot
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Builds the master's Deployment and Service; nothing for an external master.
extends_documentation_fragment: [rosops.fleet._context]
"""

EXAMPLES = r"""
- name: Show the objects
  ansible.builtin.debug:
    msg: "{{ context | rosops.fleet.ros_master_objects }}"
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
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.master import master_objects


def ros_master_objects(ctx: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Of the robot that was given."""
    return master_objects(robot_of(ctx))


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(ros_master_objects=ros_master_objects)
