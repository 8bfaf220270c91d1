# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter observability_objects: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: observability_objects
short_description: Metrics, logs and dashboards of one cluster
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Builds all objects of the stack but its Secrets, with the rules and dashboards that come with the collection.
options:
  _input:
    description: The stack of one cluster, as the role P(rosops.fleet.observability#role) puts it together.
    type: dict
    required: true
  dashboards:
    description: Dashboards of the inventory's own, as P(rosops.fleet.dashboards_checked#filter) gives them.
    type: list
    elements: dict
    default: []
"""

EXAMPLES = r"""
- name: Show the objects
  ansible.builtin.debug:
    msg: "{{ {'profile': 'standalone'} | rosops.fleet.observability_objects }}"
"""

RETURN = r"""
_value:
  description: Kubernetes objects.
  type: list
  elements: dict
"""

from typing import Any, Callable, Mapping, Sequence

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import stack as _observability
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.files import own_files


def observability_objects(
    spec: Mapping[str, Any], dashboards: Sequence[Mapping[str, str]] = ()
) -> list[dict[str, Any]]:
    """The objects, with what the role's files say."""
    files = own_files()
    folders = {"Fleet": files["dashboards"], "Own": {f"{one['name']}.json": one["json"] for one in dashboards}}
    return _observability.observability_objects(spec, {**files, "dashboards": folders})


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(observability_objects=observability_objects)
