# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter fleet_status: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: fleet_status
short_description: Kubernetes objects and ROS graphs as rows for a status page
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Picks what a person wants to know of a fleet out of raw objects. The result is data;
    P(rosops.fleet.status_table#filter) makes text of it.
options:
  _input:
    description:
      - What was found. Every key may be missing.
      - C(hosts) is a list of C({name, group, address, role, cluster, reachable, reason}), taken over as it is.
      - C(nodes), C(deployments), C(pods), C(claims) are lists of Kubernetes objects, of all clusters together. Of the
        Deployments only those that this collection manages are shown.
      - C(graphs) maps a robot to C(graph) as M(rosops.fleet.ros_graph_info) returns it.
      - C(problems) is a list of C({where, what}) of what could not be looked at, taken over as it is.
      - C(reports) maps the name of a JSON file of the callback P(rosops.fleet.fleet_report#callback) to its text.
      - C(usage) maps C(<namespace>/<claim>) to the bytes that are used.
    type: dict
    required: true
seealso:
  - plugin: rosops.fleet.status_table
    plugin_type: filter
"""

EXAMPLES = r"""
- name: Make rows of what was found
  ansible.builtin.set_fact:
    status: >-
      {{ {'nodes': nodes.resources, 'deployments': deployments.resources, 'pods': pods.resources,
          'claims': claims.resources, 'graphs': {'robot1': ros.graph}} | rosops.fleet.fleet_status }}
"""

RETURN = r"""
_value:
  description:
    - Lists of rows under C(problems), C(hosts), C(nodes), C(placement), C(masters), C(apps), C(ros_nodes), C(topics),
      C(claims), C(outcomes), C(steps).
    - "C(nodes): name, ready, reason, version, address, roles, placement, robot, labels (those that somebody chose)."
    - "C(placement): node, placement, runs."
    - "C(masters) and C(apps): name, namespace, robot, placement, ready, wanted, nodes, images, restarts, note."
    - "C(ros_nodes): robot, name, reachable, error, publications, subscriptions, services."
    - "C(topics): robot, name, type, publishers, subscribers, connections, rate, note; without rosout and clock."
    - "C(claims): name, namespace, robot, bound, phase, storage_class, size, used_bytes."
    - "C(outcomes), of the newest report that has the host, but for those of check mode and of playbooks that only look:
      host, outcome, playbook, started, changed, note."
    - "C(steps), of the robot's newest update: robot, id, name, handoff, outcome, from, to, seconds, busy_wait, phases,
      note."
  type: dict
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import fleet_status


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(fleet_status=fleet_status)
