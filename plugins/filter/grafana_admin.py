# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter grafana_admin: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: grafana_admin
short_description: The password of Grafana's admin
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - The given one, else the one that the cluster has already, else a fresh one.
  - What it returns must not be shown; use C(no_log).
options:
  _input:
    description: What the cluster has under the name of the Secret, a list of at most one.
    type: list
    elements: dict
    required: true
  given:
    description: The inventory's password; may be empty.
    type: str
    required: true
  fresh:
    description: At least 24 random characters, of which a new password and its version are made.
    type: str
    required: true
"""

EXAMPLES = r"""
- name: Choose the password
  ansible.builtin.set_fact:
    admin: "{{ [] | rosops.fleet.grafana_admin('', lookup('ansible.builtin.password', '/dev/null', length=40)) }}"
  no_log: true
"""

RETURN = r"""
_value:
  description: The password, and a version that changes with it.
  type: dict
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.stack import grafana_admin


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(grafana_admin=grafana_admin)
