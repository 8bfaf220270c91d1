# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter update_events: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: update_events
short_description: The ConfigMap that tells of a robot's updates
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Makes the ConfigMap C(robot-updates) of the robot's namespace, from which the ROS exporter makes metrics and log
    lines. It keeps the latest step of every app.
  - What an earlier run left as C(running) becomes C(failed).
  - The same steps give the same bytes, so that it can be applied again.
positional: robot, maps, running
options:
  _input:
    description:
      - Results of the steps of this run that have ended, as P(rosops.fleet.update_outcome#filter) takes them.
    type: list
    elements: dict
    required: true
  robot:
    description:
      - The robot's name in the inventory.
    type: str
    required: true
  maps:
    description:
      - ConfigMaps of the robot's namespace as they were before the run.
    type: list
    elements: dict
    default: []
  running:
    description:
      - The step at hand, a result without its outcome. Empty between the steps.
    type: dict
    default: {}
seealso:
  - plugin: rosops.fleet.update_step_id
    plugin_type: filter
"""

EXAMPLES = r"""
- name: Show what would be told
  ansible.builtin.debug:
    msg: "{{ fleet_outcome.steps | rosops.fleet.update_events(inventory_hostname) }}"
"""

RETURN = r"""
_value:
  description:
    - A ConfigMap with the key C(updates.json).
    - "That is C({updates: [...]}), each with C(id), C(app), C(step), C(handoff), C(outcome), C(reason), C(from) and
      C(to) (revisions; C(from) of a new app is empty), C(from_image), C(to_image), C(started) and C(finished) (seconds
      since 1970; C(finished) is null while it runs), C(phases) (seconds by name) and C(busy_wait) (seconds)."
    - The apps of one step share its C(id).
  type: dict
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.events import update_events


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(update_events=update_events)
