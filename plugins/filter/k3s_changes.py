# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter k3s_changes: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: k3s_changes
short_description: Files that are not as they should be
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Compares files that should be with what P(rosops.fleet.k3s_info#module) found.
options:
  _input:
    description: Files with C(path), C(content), C(mode), C(secret). Empty content means that the file must be gone.
    type: list
    elements: dict
    required: true
  found:
    description: RV(rosops.fleet.k3s_info#module:files).
    type: dict
    required: true
"""

EXAMPLES = r"""
- name: Show what would be written
  ansible.builtin.debug:
    msg: "{{ (files | rosops.fleet.k3s_changes(k3s.files)).open | map(attribute='path') }}"
"""

RETURN = r"""
_value:
  description: C(open) and C(secret) (files to write), C(remove) (paths).
  type: dict
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._filter import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s_config import file_changes


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(k3s_changes=file_changes)
