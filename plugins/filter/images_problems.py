# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter images_problems: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: images_problems
short_description: Images that are still missing or wrong on a node
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Compares what P(rosops.fleet.images_plan#filter) wanted with what a node has.
options:
  _input:
    description: Name to ID.
    type: dict
    required: true
  listing:
    description: What C(crictl images -o json) printed on the node.
    type: str
    required: true
"""

EXAMPLES = r"""
- name: Show what is wrong
  ansible.builtin.debug:
    msg: "{{ plan.wanted | rosops.fleet.images_problems(crictl.stdout) }}"
"""

RETURN = r"""
_value:
  description: One line for each image that is not as wanted.
  type: list
  elements: str
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.images import images_problems


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(images_problems=images_problems)
