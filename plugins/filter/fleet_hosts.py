# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter fleet_hosts: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: fleet_hosts
short_description: The fleet's variables of every host, for fleet_config
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Picks the variables that this collection knows, and those that look like a misspelt one, of each host.
  - Secrets are replaced by a number each, equal for equal secrets, so that they can be compared but not read.
options:
  _input:
    description: The magic variable C(hostvars). A host's values may refer to it in their turn.
    type: dict
    required: true
  names:
    description: The hosts to pick, usually C(groups.all).
    type: list
    elements: str
    required: true
"""

EXAMPLES = r"""
- name: Check the whole inventory before anything is touched
  rosops.fleet.fleet_config:
    fleet:
      groups: "{{ groups }}"
      hosts: "{{ hostvars | rosops.fleet.fleet_hosts(groups.all) }}"
  delegate_to: localhost
  run_once: true
"""

RETURN = r"""
_value:
  description: A host's name to its variables.
  type: dict
"""

from typing import Any, Callable, Iterable, Mapping

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.host_variables import HostVariables
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.hosts import fleet_hosts


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(fleet_hosts=_hosts)


def _hosts(hostvars: Mapping[str, Any], names: Iterable[str]) -> dict[str, dict[str, Any]]:
    return fleet_hosts(HostVariables(hostvars), names)
