# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter observability_secrets: a thin wrapper of module_utils."""

from __future__ import annotations

DOCUMENTATION = r"""
name: observability_secrets
short_description: Secrets of an observability stack
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Builds the Secrets of Grafana's password and of Alertmanager's configuration.
  - What it returns must not be shown; use C(no_log).
options:
  _input:
    description: The stack of one cluster, as the role P(rosops.fleet.observability#role) puts it together.
    type: dict
    required: true
  admin:
    description: Grafana's password and its version, as the filter P(rosops.fleet.grafana_admin#filter) gives them.
    type: dict
    required: false
"""

EXAMPLES = r"""
- name: Build the Secrets
  ansible.builtin.set_fact:
    secrets: "{{ {'profile': 'hub'} | rosops.fleet.observability_secrets({'password': password, 'version': 'a1'}) }}"
  no_log: true
"""

RETURN = r"""
_value:
  description: Kubernetes objects.
  type: list
  elements: dict
"""

from typing import Any, Callable

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.stack import observability_secrets


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(observability_secrets=observability_secrets)
