# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter ros_exporter_objects: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: ros_exporter_objects
short_description: The exporter of a ROS graph's metrics
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Builds the ConfigMap and the Deployment C(ros-exporter) that stand beside a robot's ROS master, or the fleet's.
  - The exporter asks the master and the nodes over XML-RPC. It registers nothing and subscribes to nothing. The data
    connections that it opens are the handshake of a service's client and, for an action's goals, one message of the
    action's status topic, neither known to the master.
  - Its image is the master's. Its code is in the ConfigMap.
extends_documentation_fragment: [rosops.fleet._context]
options:
  interval:
    description:
      - Seconds between two looks at the graph.
      - Best the interval at which Prometheus scrapes. The looks then keep a distance from the scrapes by themselves, so
        that a rate does not jump.
    type: float
    default: 10.0
  timeout:
    description: Seconds that the master, and each node, has for its answers.
    type: float
    default: 2.0
  statistics:
    description:
      - Whether latency and drops are read from the topic C(/statistics).
      - That takes a connection to each of its publishers for all the time, not known to the master. Nodes publish it
        only if the parameter C(/enable_statistics) was true when they started.
    type: bool
    default: false
  claims_path:
    description:
      - The directory of the storage class C(local-path) on the robot, C(/var/lib/rancher/k3s/storage) for k3s. It is
        mounted read-only to see what the robot's claims hold.
      - Empty leaves that out.
    type: str
    default: ""
"""

EXAMPLES = r"""
- name: Show the objects
  ansible.builtin.debug:
    msg: "{{ context | rosops.fleet.ros_exporter_objects(interval=10, claims_path='/var/lib/rancher/k3s/storage') }}"
  vars:
    context: "{{ fleet.robots[inventory_hostname] }}"
"""

RETURN = r"""
_value:
  description: ConfigMap and Deployment.
  type: list
  elements: dict
"""

from typing import Any, Callable, Mapping

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module, robot_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects import exporter as _exporter_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.code_files import exporter_files


def ros_exporter_objects(
    ctx: Mapping[str, Any],
    interval: float = 10.0,
    timeout: float = 2.0,
    statistics: bool = False,
    claims_path: str = "",
) -> list[dict[str, Any]]:
    """The pure function, with the code that it does not read itself."""
    settings = _exporter_objects.Settings(float(interval), float(timeout), bool(statistics), claims_path)
    return _exporter_objects.exporter_objects(robot_of(ctx), exporter_files(), settings)


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(ros_exporter_objects=ros_exporter_objects)
