# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter fleet_context: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: fleet_context
short_description: A robot's variables as the context of the workload filters
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Picks the fleet's variables of one robot and fills in every default.
options:
  _input:
    description: The magic variable C(hostvars). The robot's values may refer to it in their turn.
    type: dict
    required: true
  robot:
    description: The robot's inventory name.
    type: str
    required: true
"""

EXAMPLES = r"""
- name: Show the objects
  ansible.builtin.debug:
    msg: "{{ hostvars | rosops.fleet.fleet_context(inventory_hostname) }}"
"""

RETURN = r"""
_value:
  description: The context, with the keys C(name), C(mode), C(namespace), C(apps), C(volumes), C(master) and more.
  type: dict
"""

from typing import Any, Callable, Mapping

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.host_variables import HostVariables


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(fleet_context=_context)


def _context(hostvars: Mapping[str, Any], robot: str) -> dict[str, Any]:
    return Robot.from_variables(HostVariables(hostvars)[robot], robot).as_dict()
