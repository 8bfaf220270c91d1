# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter k3s_kubeconfig: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: k3s_kubeconfig
short_description: A server's kubeconfig for use elsewhere
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Sets the server's address and names cluster, user and context after the cluster.
  - The first line of the result says what it was made from.
options:
  _input:
    description: Text of the server's C(k3s.yaml).
    type: str
    required: true
  server:
    description: URL of the API.
    type: str
    required: true
  cluster:
    description: Name for cluster, user and context.
    type: str
    required: true
  source:
    description: SHA-256 of the server's file.
    type: str
    required: true
"""

EXAMPLES = r"""
- name: Keep the kubeconfig
  ansible.builtin.copy:
    content: "{{ text | rosops.fleet.k3s_kubeconfig('https://edge1:6443', 'edge', digest) }}"
    dest: edge.yaml
    mode: "0600"
"""

RETURN = r"""
_value:
  description: Text of the kubeconfig.
  type: str
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s.config import local_kubeconfig
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(k3s_kubeconfig=local_kubeconfig)
