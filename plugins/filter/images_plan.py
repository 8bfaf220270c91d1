# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter images_plan: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: images_plan
short_description: Images that a node lacks
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Compares image archives on the control node and image names with what a node has, by image ID.
options:
  _input:
    description: Archives, each a dictionary with C(path) and, to use only some of its images, C(images).
    type: list
    elements: dict
    required: true
  refs:
    description: Names of images to pull.
    type: list
    elements: str
    required: true
  listing:
    description: What C(crictl images -o json) printed on the node.
    type: str
    required: true
  machine:
    description: The node's hardware name, as C(uname -m) says it.
    type: str
    default: x86_64
"""

EXAMPLES = r"""
- name: Show what a node lacks
  ansible.builtin.debug:
    msg: "{{ archives | rosops.fleet.images_plan([], crictl.stdout, 'aarch64') }}"
"""

RETURN = r"""
_value:
  description: C(bring) (paths of archives), C(pull) (names), C(wanted) (name to ID).
  type: dict
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.images import images_plan


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(images_plan=images_plan)
