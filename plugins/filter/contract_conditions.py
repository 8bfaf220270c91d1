# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter contract_conditions: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: contract_conditions
short_description: A contract as conditions on the ROS graph
version_added: 0.2.0
author: rosops.fleet contributors (@rosops)
description:
  - Says a contract of P(rosops.fleet.ros_contract#filter) as options of M(rosops.fleet.ros_ready).
  - A connection's end that does not belong to the contract's own nodes may have left by itself meanwhile.
positional: tolerance, absent
options:
  _input:
    description: A contract.
    type: dict
    required: true
  tolerance:
    description: By how much of the recorded rate the new one may be lower; the contract's own if not given.
    type: float
  absent:
    description: Nodes that must be gone, those of the old revision.
    type: list
    elements: str
    default: []
"""

EXAMPLES = r"""
- name: The new revision is to the graph what the old one was, for ten seconds
  rosops.fleet.ros_ready: "{{ contract | rosops.fleet.contract_conditions(absent=old) | combine(wait) }}"
  vars:
    old: [/talker_1f0c2a9b]
    wait: {stable: 10, timeout: 60}
"""

RETURN = r"""
_value:
  description: C(nodes), C(topics), C(services), C(actions), C(edges) and C(absent).
  type: dict
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.module_utils._contract import conditions
from ansible_collections.rosops.fleet.plugins.plugin_utils._filter import filter_module


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(contract_conditions=conditions)
