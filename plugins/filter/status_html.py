# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter status_html: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: status_html
short_description: A fleet's status as one HTML file
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Renders the rows of P(rosops.fleet.fleet_status#filter) as a page with counts, what needs attention, plots and
    tables.
  - The page is one file without scripts. It loads nothing, and everything in it is escaped.
positional: made, previous, limit
options:
  _input:
    description: The rows.
    type: dict
    required: true
  made:
    description: When the fleet was looked at, in UTC, as in V(2026-11-21T09:07:52Z).
    type: str
    required: true
  previous:
    description:
      - The text of an earlier page. It is returned as it is when nothing but the time would be new, so that a file is
        written only when it says something new.
    type: str
    default: ""
  limit:
    description: What the run was limited to (C(ansible_limit)). The page says so.
    type: str
    default: ""
seealso:
  - plugin: rosops.fleet.fleet_status
    plugin_type: filter
  - plugin: rosops.fleet.status_table
    plugin_type: filter
"""

EXAMPLES = r"""
- name: Write the page on the control node
  ansible.builtin.copy:
    content: "{{ status | rosops.fleet.status_html(now(utc=true).strftime('%Y-%m-%dT%H:%M:%SZ')) }}"
    dest: fleet-status.html
    mode: "0644"
  delegate_to: localhost
  run_once: true
"""

RETURN = r"""
_value:
  description: The page.
  type: str
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.html import status_html


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(status_html=status_html)
