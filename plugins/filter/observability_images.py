# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter observability_images: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: observability_images
short_description: Images that an observability stack needs
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Lists the images of all that runs in a profile, for a registry or an archive of one's own.
options:
  _input:
    description: The stack of one cluster, as the role P(rosops.fleet.observability#role) puts it together.
    type: dict
    required: true
"""

EXAMPLES = r"""
- name: Show the images of a robot
  ansible.builtin.debug:
    msg: "{{ {'profile': 'robot'} | rosops.fleet.observability_images }}"
"""

RETURN = r"""
_value:
  description: Image references, sorted, each once.
  type: list
  elements: str
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.stack import observability_images


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(observability_images=observability_images)
