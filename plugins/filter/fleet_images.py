# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter fleet_images: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: fleet_images
short_description: Images that a robot's workloads run
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Lists the images of the robot's master and apps, overrides included.
extends_documentation_fragment: [rosops.fleet._context]
options:
  placement:
    description: Only images of pods placed so.
    type: str
    choices: [local, remote]
    required: false
"""

EXAMPLES = r"""
- name: Show the objects
  ansible.builtin.debug:
    msg: "{{ context | rosops.fleet.fleet_images }}"
  vars:
    context: "{{ fleet.robots[inventory_hostname] }}"
"""

RETURN = r"""
_value:
  description: Image references, sorted, each once.
  type: list
  elements: str
"""

from typing import Any, Callable, Mapping

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.images import images


def fleet_images(ctx: Mapping[str, Any], placement: str | None = None) -> list[str]:
    """Of the robot that was given."""
    return images(Robot.from_dict(ctx), placement)


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(fleet_images=fleet_images)
