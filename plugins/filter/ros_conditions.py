# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter ros_conditions: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: ros_conditions
short_description: What the ROS graph of a robot must show
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Unites the readiness of all apps of a robot into options of M(rosops.fleet.ros_ready), every name in full.
extends_documentation_fragment: [rosops.fleet._context]
"""

EXAMPLES = r"""
- name: Wait for the graph
  rosops.fleet.ros_ready: "{{ conditions | combine({'master_uri': master_uri}) }}"
  vars:
    context: "{{ fleet.robots[inventory_hostname] }}"
    conditions: "{{ context | rosops.fleet.ros_conditions }}"
    master_uri: http://10.43.0.17:11311
"""

RETURN = r"""
_value:
  description:
    - C(nodes), C(topics), C(services), C(actions), C(absent), C(timeout), C(interval) and C(consecutive).
    - C(master_uri) for an external master only.
  type: dict
"""

from typing import Any, Callable, Mapping

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module, robot_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.conditions import graph_conditions


def ros_conditions(ctx: Mapping[str, Any]) -> dict[str, Any]:
    """Of the robot that was given."""
    return graph_conditions(robot_of(ctx))


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(ros_conditions=ros_conditions)
