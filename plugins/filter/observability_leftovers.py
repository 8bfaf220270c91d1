# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter observability_leftovers: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: observability_leftovers
short_description: Objects of parts that no longer run
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Names the objects that an earlier profile or switch left behind. Claims and Secrets are never among them.
options:
  _input:
    description: The stack of one cluster, as the role P(rosops.fleet.observability#role) puts it together.
    type: dict
    required: true
"""

EXAMPLES = r"""
- name: Show what would be taken away
  ansible.builtin.debug:
    msg: "{{ {'profile': 'robot'} | rosops.fleet.observability_leftovers }}"
"""

RETURN = r"""
_value:
  description: Kubernetes objects with no more than their names.
  type: list
  elements: dict
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.stack import observability_leftovers


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(observability_leftovers=observability_leftovers)
