# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter status_table: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: status_table
short_description: A fleet's status as plain text
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Renders the rows of P(rosops.fleet.fleet_status#filter) as tables for a terminal.
options:
  _input:
    description:
      - The rows. A section whose key is missing is left out; one without rows says so,
        but for problems, outcomes and steps.
      - A host's row is C({name, group, address, role, cluster, reachable, reason}).
    type: dict
    required: true
  width:
    description: Columns of the terminal. What does not fit is cut, the widest column first.
    type: int
    default: 120
seealso:
  - plugin: rosops.fleet.fleet_status
    plugin_type: filter
  - plugin: rosops.fleet.status_html
    plugin_type: filter
"""

EXAMPLES = r"""
- name: Show the fleet (with callback_result_format = yaml in ansible.cfg, lines stay lines)
  ansible.builtin.debug:
    msg: "{{ status | rosops.fleet.status_table }}"
"""

RETURN = r"""
_value:
  description: The page, lines ended by newlines.
  type: str
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.text import status_table


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(status_table=status_table)
