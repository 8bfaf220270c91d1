# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter ros_hook_objects: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: ros_hook_objects
short_description: Code that runs in a robot's pods
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Builds the ConfigMaps with the probes, the stop hook and the keeper, and with what those have to know of each app.
  - They are part of what P(rosops.fleet.ros_app_objects#filter) gives, too.
extends_documentation_fragment: [rosops.fleet._context]
"""

EXAMPLES = r"""
- name: Show the objects
  ansible.builtin.debug:
    msg: "{{ context | rosops.fleet.ros_hook_objects }}"
  vars:
    context: "{{ fleet.robots[inventory_hostname] }}"
"""

RETURN = r"""
_value:
  description: ConfigMaps, one per namespace that needs it.
  type: list
  elements: dict
"""

from typing import Any, Callable, Mapping

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module, robot_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.code_files import app_files
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.code_maps import code_maps


def ros_hook_objects(ctx: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Of the robot that was given."""
    return code_maps(robot_of(ctx), app_files())


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(ros_hook_objects=ros_hook_objects)
