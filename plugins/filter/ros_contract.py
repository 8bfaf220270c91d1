# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter ros_contract: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: ros_contract
short_description: What an app is to the ROS graph, for its next revision to restore
version_added: 0.2.0
author: rosops.fleet contributors (@rosops)
description:
  - Takes down what nodes publish (with type, md5sum and the rate of their own), subscribe to and serve, and their
    connections to others, from a graph of M(rosops.fleet.ros_graph_info) with O(ignore:rates) and O(ignore:md5sums).
  - Names are those that hold after the update. A node's own name and what stands in its private namespace follow
    O(renames).
  - Left out are C(/rosout) and logger services, which every node has, nodes that do not answer, tools with an anonymous
    name, rates below 1 Hz and those of an action's topics, and connections over a renamed private topic to a node that
    is not renamed along.
positional: nodes, renames
options:
  _input:
    description: A graph, as M(rosops.fleet.ros_graph_info) returns it.
    type: dict
    required: true
  nodes:
    description: The nodes, by their present names. The first one is the app's own.
    type: list
    elements: str
    required: true
  renames:
    description: Old names to new ones, of all nodes that are updated together.
    type: dict
    default: {}
  revision:
    description: The new revision.
    type: str
    default: ""
  until:
    description: When the contract ends, in seconds since 1970.
    type: float
    default: 0
  tolerance:
    description: By how much of the recorded rate the new one may be lower.
    type: float
    default: 0.1
  ignore:
    description: Topics, services and actions that the update is meant to change.
    type: list
    elements: str
    default: []
  least_rate:
    description: Rates below this are not recorded, in messages per second.
    type: float
    default: 1.0
"""

EXAMPLES = r"""
- name: Read the graph before an update
  rosops.fleet.ros_graph_info:
    rates: true
    md5sums: true
  register: before

- name: Keep what the app is to it
  ansible.builtin.set_fact:
    contract: "{{ before.graph | rosops.fleet.ros_contract(renames | list, renames) }}"
  vars:
    renames: {/talker_1f0c2a9b: /talker_77aa01de}
"""

RETURN = r"""
_value:
  description:
    - C(revision), C(until), C(tolerance), C(node), C(nodes) (those that answered), C(topics), C(subscriptions),
      C(services), C(actions) and C(edges).
  type: dict
  sample:
    revision: 77aa01de
    until: 1790000000
    tolerance: 0.1
    node: /talker_77aa01de
    nodes: [/talker_77aa01de]
    topics:
      /chatter:
        type: std_msgs/String
        md5sum: 992ce8a1687cec8c8bd883ec73ca41d1
        rate: 499.8
        publishers: {/talker_77aa01de: {rate: 499.8, connected: true}}
    subscriptions: {/config: {type: std_msgs/String}}
    services: {/reset: {type: std_srvs/Trigger, md5sum: 937c9679a518e3a18d831e57125ea522}}
    actions: []
    edges: [[/talker_77aa01de, /chatter, /listener]]
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.module_utils._contract import record
from ansible_collections.rosops.fleet.plugins.plugin_utils._filter import filter_module


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(ros_contract=record)
