# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter preflight_report: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: preflight_report
short_description: What keeps a host from running k3s
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Judges the facts of P(rosops.fleet.preflight_info#module), all checks at once, and compares the host with the
    others.
options:
  _input:
    description: Every host that answered, mapped to its facts.
    type: dict
    required: true
  host:
    description: The host to judge.
    type: str
    required: true
  requirements:
    description:
      - What is required, with the keys C(role), C(node_name), C(systems), C(minimum_mtu), C(server_urls), and
        C(memory_mb), C(disk_mb), C(clock_offset), each with C(minimum) or C(maximum), and C(recommended).
    type: dict
    required: true
"""

EXAMPLES = r"""
- name: Judge a host
  ansible.builtin.debug:
    msg: "{{ (facts_by_host | rosops.fleet.preflight_report(inventory_hostname, requirements)).text }}"
"""

RETURN = r"""
_value:
  description: The keys C(errors) and C(warnings) (numbers), C(findings) (list, errors first) and C(text).
  type: dict
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._preflight.findings import judge


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(preflight_report=judge)
