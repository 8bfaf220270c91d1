# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter update_step_id: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: update_step_id
short_description: The name of one step of one robot
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Twelve hexadecimal digits that report, metrics, annotations and log lines of a step have in common.
positional: apps, started
options:
  _input:
    description:
      - The robot's name in the inventory.
    type: str
    required: true
  apps:
    description:
      - What the step changes.
    type: list
    elements: str
    required: true
  started:
    description:
      - When it began, in seconds since 1970.
    type: float
    required: true
seealso:
  - plugin: rosops.fleet.update_events
    plugin_type: filter
"""

EXAMPLES = r"""
- name: Show it
  ansible.builtin.debug:
    msg: "{{ inventory_hostname | rosops.fleet.update_step_id(['temperature'], 1795252087.3) }}"
"""

RETURN = r"""
_value:
  description:
    - The id.
  type: str
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.events import step_id


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(update_step_id=step_id)
