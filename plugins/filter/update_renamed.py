# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter update_renamed: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: update_renamed
short_description: A recorded graph under the names of the finished steps
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - The graph is recorded once, before the first step; a step that overlaps gives its nodes new names.
positional: steps
options:
  _input:
    description:
      - The graph that M(rosops.fleet.ros_graph_info) returned.
    type: dict
    required: true
  steps:
    description:
      - The finished steps of P(rosops.fleet.update_plan#filter).
    type: list
    elements: dict
    required: true
"""

EXAMPLES = r"""
- name: Show the nodes as the second step finds them
  ansible.builtin.debug:
    msg: "{{ (ros.graph | rosops.fleet.update_renamed(plan.steps[:1])).nodes.keys() }}"
"""

RETURN = r"""
_value:
  description:
    - The graph.
  type: dict
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.step import renamed_graph


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(update_renamed=renamed_graph)
