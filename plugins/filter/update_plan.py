# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter update_plan: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: update_plan
short_description: The steps of a robot's update
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Compares what the inventory wants of a robot with what its cluster has, by the hash that every Deployment carries.
  - A step is one changed app, the changed apps of one group, or the ROS master; steps are in the order of dependencies.
  - With O(to) the steps lead back to what an earlier update replaced.
positional: deployments, updates
options:
  _input:
    description:
      - A robot's context as the filter P(rosops.fleet.fleet_context#filter) builds it.
    type: dict
    required: true
  deployments:
    description:
      - The Deployments of the robot's namespace (and of C(fleet)) as the API shows them.
    type: list
    elements: dict
    required: true
  updates:
    description:
      - The ConfigMaps C(<app>-update) of earlier updates.
    type: list
    elements: dict
    required: true
  only:
    description:
      - Limit the plan to these apps; V(ros-master) is the master.
    type: list
    elements: str
    default: []
  shared:
    description:
      - Whether objects of the whole fleet are part of the plan.
    type: bool
    default: true
  to:
    description:
      - Empty for what the inventory says, V(previous), or a revision.
    type: str
    default: ""
"""

EXAMPLES = r"""
- name: Show what an update would do
  ansible.builtin.debug:
    msg: "{{ context | rosops.fleet.update_plan(deployments, config_maps) }}"
"""

RETURN = r"""
_value:
  description:
    - C(steps) with all that the tasks of a step need, C(unchanged) (apps).
    - C(orphans) are Deployments that the inventory does not know.
  type: dict
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module, robot_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.plan import rollback_plan, update_plan


def plan(ctx: Any, deployments: Any, updates: Any, *, to: str = "", **limits: Any) -> Any:
    """Forward to what the inventory says, or back. `limits` are `only` and `shared`."""
    if to:
        return rollback_plan(robot_of(ctx), deployments, updates, to=to, **limits)
    return update_plan(robot_of(ctx), deployments, updates, **limits)


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(update_plan=plan)
