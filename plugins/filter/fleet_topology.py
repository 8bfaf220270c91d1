# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter fleet_topology: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: fleet_topology
short_description: The part of every host of a fleet, from the inventory's groups
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Says of every host of the groups C(edge) and C(robots) whether it is a k3s server or an agent, of which cluster,
    and which servers that cluster has.
  - Looks at groups and robot modes alone, never at what is reachable or at C(--limit).
options:
  _input:
    description: The inventory's groups, as the magic variable C(groups) has them.
    type: dict
    required: true
  robot_modes:
    description:
      - A robot's name to V(agent) or V(standalone), or to a mapping that holds C(robot_mode).
      - The magic variable C(hostvars) will do.
      - A robot without a mode is an V(agent).
    type: dict
    required: false
"""

EXAMPLES = r"""
- name: Learn this host's part
  ansible.builtin.debug:
    msg: "{{ (groups | rosops.fleet.fleet_topology(hostvars))[inventory_hostname] }}"
"""

RETURN = r"""
_value:
  description: Every host's part, with the keys C(role) (V(server) or V(agent)), C(cluster), C(servers) and C(init).
  type: dict
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.topology import fleet_topology


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(fleet_topology=fleet_topology)
