# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter update_conditions: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: update_conditions
short_description: What the ROS graph must show after a step
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Gives options of M(rosops.fleet.ros_ready). The contracts are restored and the new revisions' own readiness holds.
positional: contracts, tolerance
options:
  _input:
    description:
      - A step of P(rosops.fleet.update_plan#filter).
    type: dict
    required: true
  contracts:
    description:
      - By app, as P(rosops.fleet.update_gate#filter) returns them.
    type: dict
    required: true
  tolerance:
    description:
      - How much a rate may fall.
    type: float
    required: true
  back:
    description:
      - The contracts under the old names, for the way back.
    type: bool
    default: false
"""

EXAMPLES = r"""
- name: Show them
  ansible.builtin.debug:
    msg: "{{ step | rosops.fleet.update_conditions(gate.contracts, 0.1) }}"
"""

RETURN = r"""
_value:
  description:
    - C(nodes), C(topics), C(services), C(actions), C(edges), C(absent).
  type: dict
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.step import step_conditions


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(update_conditions=step_conditions)
