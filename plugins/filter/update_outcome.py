# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter update_outcome: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: update_outcome
short_description: What became of a robot's update
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - One outcome out of the results of a robot's steps.
positional: steps
options:
  _input:
    description:
      - Results of the steps that were begun.
    type: list
    elements: dict
    required: true
  steps:
    description:
      - How many steps the plan had.
    type: int
    required: true
"""

EXAMPLES = r"""
- name: Declare the outcome
  ansible.builtin.set_fact:
    fleet_outcome: "{{ results | rosops.fleet.update_outcome(3) }}"
"""

RETURN = r"""
_value:
  description:
    - C(outcome), C(reason), C(steps).
  type: dict
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import robot_outcome


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(update_outcome=robot_outcome)
