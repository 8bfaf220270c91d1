# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter k3s_address: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: k3s_address
short_description: Address of a host as the cluster's members use it
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - The first address of C(k3s_node_ip), else C(ansible_host), else the host's name, all from the inventory. So a host
    that is off has one, too.
options:
  _input:
    description: A host's inventory name.
    type: str
    required: true
  hostvars:
    description: Ansible's C(hostvars).
    type: dict
    required: true
"""

EXAMPLES = r"""
- name: Show the servers' addresses
  ansible.builtin.debug:
    msg: "{{ k3s_server_hosts | map('rosops.fleet.k3s_address', hostvars) | list }}"
"""

RETURN = r"""
_value:
  description: A name or address, an IPv6 address in brackets as it stands in a URL.
  type: str
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s.config import address
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(k3s_address=address)
