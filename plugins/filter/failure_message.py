# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter failure_message: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: failure_message
short_description: What a failed result says
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - The message of a failed result, or those of its failed items, or what the command wrote.
options:
  _input:
    description:
      - A result, such as C(ansible_failed_result) in a C(rescue).
    type: dict
    required: true
"""

EXAMPLES = r"""
- name: Keep why it failed
  ansible.builtin.set_fact:
    reason: "{{ ansible_failed_result | rosops.fleet.failure_message }}"
"""

RETURN = r"""
_value:
  description:
    - The message, at most 4000 characters.
  type: str
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.run import message_of


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(failure_message=message_of)
