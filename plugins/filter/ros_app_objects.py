# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter ros_app_objects: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: ros_app_objects
short_description: ROS apps of a robot
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Builds one Deployment per item of C(ros_apps), and before them the ConfigMaps with the code that runs in their pods.
extends_documentation_fragment: [rosops.fleet._context]
"""

EXAMPLES = r"""
- name: Show the objects
  ansible.builtin.debug:
    msg: "{{ context | rosops.fleet.ros_app_objects }}"
  vars:
    context: "{{ fleet.robots[inventory_hostname] }}"
"""

RETURN = r"""
_value:
  description: Kubernetes objects, ConfigMaps first, then Deployments in the order of C(ros_apps).
  type: list
  elements: dict
"""

from typing import Any, Callable, Mapping

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module, robot_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.code_files import app_files


def ros_app_objects(ctx: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Of the robot that was given."""
    return app_objects(robot_of(ctx), app_files())


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(ros_app_objects=ros_app_objects)
