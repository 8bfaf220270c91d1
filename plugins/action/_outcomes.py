# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""For the playbooks: hand on what became of every host, as AWX's artifacts and to the hosts' clusters.

The callback fleet_report knows it, and writes down before each play what it knows so far.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import ClassVar

from ansible import context
from ansible.utils.display import Display
from ansible_collections.rosops.fleet.plugins.module_utils._common.documents import Arguments, Result, Variables
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.cluster import ClusterAction
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.access import NoClusterError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.fleet import Fleet, Home
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.host_variables import HostVariables
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.outcomes import FAILED, UNCHANGED
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.files import noted_run
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.keep import PATIENCE, keep
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.run import declared_in

display = Display()

BEGUN = "the run ended before it could say what became of the host"
# Without the callback.
UNKNOWN = {
    "here": {"outcome": UNCHANGED, "reason": ""},
    "lost": {
        "outcome": FAILED,
        "reason": "it left the run; the callback fleet_report, which knows why, is not enabled",
    },
}


class ActionModule(ClusterAction):
    """`begin`: no play has run yet, so this stands where the run ends early. `keep`: in the clusters, too."""

    ARGUMENTS: ClassVar = {
        "begin": {"type": "bool", "default": False},
        "keep": {"type": "bool", "default": True},
    }

    def options(self) -> Result:
        return dict(self.ARGUMENTS)

    def work(self, params: Arguments, known: Variables) -> Result:
        fleet = Fleet.from_vars(known)
        hosts = [host for host in known["ansible_play_hosts_all"] if host in fleet.hosts]
        if params["begin"]:
            begun = {"outcome": UNCHANGED, "reason": ""} if _only_validates() else {"outcome": FAILED, "reason": BEGUN}
            rows = [{**begun, "host": host, "steps": []} for host in hosts]
        else:
            rows = list(_rows(known, hosts))
            if params["keep"] and not self._task.check_mode:
                self._keep(rows, fleet, known)
        data = {row["host"]: {key: row[key] for key in ("outcome", "reason", "steps")} for row in rows}
        # AWX takes no artifacts by host
        stats = {"data": {"fleet_outcomes": data}, "per_host": False, "aggregate": False}
        return {"changed": False, "ansible_stats": stats, "_ansible_verbose_override": True}

    def _keep(self, rows: Iterable[Result], fleet: Fleet, known: Variables) -> None:
        """In each cluster what became of its hosts. One that cannot be told keeps nobody from the others."""
        clusters: dict[str, list[Result]] = {}
        for row in rows:
            clusters.setdefault(fleet.hosts[row["host"]].cluster, []).append(row)
        hostvars = HostVariables(known["hostvars"])
        for cluster, own in clusters.items():
            host = own[0]["host"]
            path = str(hostvars[host].get("k3s_kubeconfig_path") or "")
            try:
                with self.opened(Home(fleet.hosts[host], fleet.name), path, known, {}, PATIENCE) as kube:
                    keep(kube, own)
            except NoClusterError:
                continue  # nor is there anything to look at
            except FleetError as error:
                display.warning(f"cluster {cluster}: what became of its hosts is not kept there: {error}")


def _rows(known: Variables, hosts: Iterable[str]) -> Iterator[Result]:
    """Who has left the run has failed or is away; the callback knows which, and what the others' tasks changed."""
    noted, here = noted_run(), set(known["ansible_play_hosts"])
    run = {"playbook": noted.get("playbook", ""), "started": noted.get("started", "")}
    for host in hosts:
        side = "here" if host in here else "lost"
        note = noted.get("hosts", {}).get(host, {})
        found = note.get(side) or (_told(known["hostvars"][host]) if host in here else {})
        yield {**UNKNOWN[side], "steps": [], "changed": 0, **run, **note.get("host", {}), **found, "host": host}


def _told(variables: Variables) -> Result:
    """What a task of this run has said of the host; facts may be those of an earlier run, out of a cache."""
    updated = declared_in((variables.get("update_result") or {}).get("outcome"))
    return updated or declared_in(variables.get("fleet_k3s_outcome"))


def _only_validates() -> bool:
    """Whether nothing else was asked for. What imports that playbook has other names."""
    asked = [str(name).removesuffix(".yml") for name in context.CLIARGS.get("args", ())]
    return all(name.endswith("validate") for name in asked)
