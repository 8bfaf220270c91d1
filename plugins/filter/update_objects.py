# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter update_objects: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: update_objects
short_description: What a step of an update applies
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - The ConfigMaps with contract and history, and the Deployments.
  - The Deployments carry the mark of an unproven version.
positional: contracts, tolerance, now, seconds, run
options:
  _input:
    description:
      - A step of P(rosops.fleet.update_plan#filter).
    type: dict
    required: true
  contracts:
    description:
      - By app, as P(rosops.fleet.update_gate#filter) returns them.
    type: dict
    required: true
  tolerance:
    description:
      - How much a rate may fall.
    type: float
    required: true
  now:
    description:
      - Seconds since 1970.
    type: float
    required: true
  seconds:
    description:
      - How long pods hold to the contract.
    type: float
    required: true
  run:
    description:
      - What the mark says.
    type: str
    required: true
"""

EXAMPLES = r"""
- name: Show what would be applied
  ansible.builtin.debug:
    msg: "{{ step | rosops.fleet.update_objects(gate.contracts, 0.1, now().timestamp(), 120, 'by hand') }}"
"""

RETURN = r"""
_value:
  description:
    - Kubernetes objects.
  type: list
  elements: dict
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.step import update_objects


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(update_objects=update_objects)
