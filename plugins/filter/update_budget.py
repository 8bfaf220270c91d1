# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter update_budget: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: update_budget
short_description: How many more robots may fail
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - A robot that failed or was rolled back costs one; robots that are off or busy cost nothing.
positional: robots, outcomes
options:
  _input:
    description:
      - A number of robots, or a percentage of them.
    type: raw
    required: true
  robots:
    description:
      - How many robots the run has.
    type: int
    required: true
  outcomes:
    description:
      - The outcomes so far.
    type: list
    elements: str
    required: true
"""

EXAMPLES = r"""
- name: Show that none may fail any more
  ansible.builtin.debug:
    msg: "{{ '10%' | rosops.fleet.update_budget(20, ['failed', 'updated', 'rolled-back']) }}"
"""

RETURN = r"""
_value:
  description:
    - The number; negative if the budget is used up.
  type: int
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import budget_left


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(update_budget=budget_left)
