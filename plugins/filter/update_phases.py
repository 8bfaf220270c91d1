# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter update_phases: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: update_phases
short_description: Seconds of every phase of a step
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Every mark is made when a phase begins; the last one ends the step.
options:
  _input:
    description:
      - Marks C({phase, at}), C(at) in seconds.
    type: list
    elements: dict
    required: true
"""

EXAMPLES = r"""
- name: Show that the first phase took two seconds
  ansible.builtin.debug:
    msg: "{{ [{'phase': 'record', 'at': 10}, {'phase': 'end', 'at': 12}] | rosops.fleet.update_phases }}"
"""

RETURN = r"""
_value:
  description:
    - Phase to seconds.
  type: dict
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import phases


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(update_phases=phases)
