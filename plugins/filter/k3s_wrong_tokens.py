# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter k3s_wrong_tokens: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: k3s_wrong_tokens
short_description: Tokens of the inventory that are not the cluster's
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Compares tokens given in the inventory with those of a running cluster, in their short and full forms.
options:
  _input:
    description: Results of M(ansible.builtin.slurp), looped over the names C(token) and C(agent-token).
    type: list
    elements: dict
    required: true
  given:
    description: The same names, each mapped to the token given, or to an empty string.
    type: dict
    required: true
"""

EXAMPLES = r"""
- name: Show which variables are wrong
  ansible.builtin.debug:
    msg: "{{ slurped.results | rosops.fleet.k3s_wrong_tokens({'token': k3s_token, 'agent-token': k3s_agent_token}) }}"
"""

RETURN = r"""
_value:
  description: Names of variables, never tokens.
  type: list
  elements: str
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s.config import wrong_tokens
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(k3s_wrong_tokens=wrong_tokens)
