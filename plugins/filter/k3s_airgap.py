# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter k3s_airgap: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: k3s_airgap
short_description: Artifacts of an airgap directory for a machine
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Reads the manifest of an airgap directory and says which binary and which image archive a machine needs.
options:
  _input:
    description: The directory on the control node.
    type: str
    required: true
  machine:
    description: The host's hardware name, as C(uname -m) says it.
    type: str
    required: true
"""

EXAMPLES = r"""
- name: Show the artifacts
  ansible.builtin.debug:
    msg: "{{ '/srv/k3s' | rosops.fleet.k3s_airgap('aarch64') }}"
"""

RETURN = r"""
_value:
  description: C(binary) and C(images), each with C(name), C(sha256), C(path), C(size). No images are an empty name.
  type: dict
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s.config import airgap
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(k3s_airgap=airgap)
