# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter k3s_plan: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: k3s_plan
short_description: What is to be done about k3s on a host
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Compares what P(rosops.fleet.k3s_info#module) found with what should be.
options:
  _input:
    description: The module's result.
    type: dict
    required: true
  wanted:
    description:
      - C(init), C(tokens), C(files) (each with C(path), C(content), C(mode), C(secret); empty content means gone),
        C(checksum), C(version), C(archive), C(kubeconfig).
    type: dict
    required: true
"""

EXAMPLES = r"""
- name: Show what would be done
  ansible.builtin.debug:
    msg: "{{ k3s | rosops.fleet.k3s_plan(wanted) }}"
"""

RETURN = r"""
_value:
  description:
    - C(any) (whether there is anything to do), C(binary), C(archive), C(tokens), C(files), C(start), C(wait),
      C(kubeconfig), and C(state) for the unit.
  type: dict
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s.plan import plan
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(k3s_plan=plan)
