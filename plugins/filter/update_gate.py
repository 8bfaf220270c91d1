# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter update_gate: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: update_gate
short_description: What is known before a step of an update
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Records the step's contract, which is the part of the ROS graph that its apps are, under the new revision's names.
  - Finds what forbids the step, what an operator should be warned of, and which actions have to be idle first.
positional: graph, updates, images
options:
  _input:
    description:
      - A step of P(rosops.fleet.update_plan#filter).
    type: dict
    required: true
  graph:
    description:
      - The graph that M(rosops.fleet.ros_graph_info) returned, with rates and md5sums.
    type: dict
    required: true
  updates:
    description:
      - The ConfigMaps C(<app>-update); a step that was cut off finds its contract there.
    type: list
    elements: dict
    default: []
  images:
    description:
      - Edge host to what C(crictl images -o json) printed there.
    type: dict
    default: {}
"""

EXAMPLES = r"""
- name: Show what would have to hold
  ansible.builtin.debug:
    msg: "{{ (plan.steps[0] | rosops.fleet.update_gate(ros.graph)).contracts }}"
"""

RETURN = r"""
_value:
  description:
    - C(contracts) (by app), C(problems), C(warnings), C(actions) (options of M(rosops.fleet.ros_action_hold)).
  type: dict
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.step import step_gate


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(update_gate=step_gate)
