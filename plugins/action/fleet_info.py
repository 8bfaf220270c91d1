# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The hosts of the run as the inventory and a former task have them, and what their clusters answer to one question."""

from __future__ import annotations

import os
from collections.abc import Mapping
from itertools import chain
from typing import Any, ClassVar

from ansible_collections.rosops.fleet.plugins.plugin_utils._action.base import FleetAction
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.fleet import Fleet
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.host_variables import HostVariables
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.clusters import KINDS, ask
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.hosts import (
    clusters_of,
    graphs_to_read,
    members,
    unmeasured,
    usage_of,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import cluster_rows


class ActionModule(FleetAction):
    _requires_connection = False
    ARGUMENTS: ClassVar = {"volumes": {"type": "str", "required": True}}

    def work(self, params: Mapping[str, Any], known: dict[str, Any]) -> dict[str, Any]:
        return {"changed": False, **_look(known, params["volumes"])}


def _look(task_vars: dict[str, Any], volumes: str) -> dict[str, Any]:
    hostvars = HostVariables(task_vars["hostvars"])
    variables = {host: hostvars[host] for host in task_vars["ansible_play_hosts_all"]}
    results = {host: own.get(volumes, {}) for host, own in variables.items()}
    hosts = members(Fleet.from_vars(task_vars), variables, results, os.environ)
    asked, silent = clusters_of(hosts)
    answers = ask(asked)
    problems = {**silent, **{cluster: answer.problem for cluster, answer in answers.items() if answer.problem}}
    together = {kind: list(chain(*(one.objects.get(kind, ()) for one in answers.values()))) for kind in KINDS}
    return {
        "hosts": [host.row() for host in hosts],
        "graphs": graphs_to_read(hosts, {name: one.objects.get("Service", ()) for name, one in answers.items()}),
        "problems": [
            *({"where": f"cluster {cluster}", "what": f"does not answer: {why}"} for cluster, why in problems.items()),
            *unmeasured(results),
        ],
        **cluster_rows(together, usage_of(results.values())),
    }
