# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter nodes_off: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: nodes_off
short_description: Names of the nodes that are not ready
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Their hosts are off, away or broken; a DaemonSet is not rolled out there until they are back.
options:
  _input:
    description: Objects of kind Node.
    type: list
    elements: dict
    required: true
"""

EXAMPLES = r"""
- name: Look which hosts are there
  kubernetes.core.k8s_info:
    kind: Node
  register: nodes

- name: Name those that are not
  ansible.builtin.debug:
    msg: "{{ nodes.resources | rosops.fleet.nodes_off }}"
"""

RETURN = r"""
_value:
  description: Names of nodes.
  type: list
  elements: str
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import nodes_off


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(nodes_off=nodes_off)
