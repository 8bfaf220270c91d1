# SPDX-License-Identifier: GPL-3.0-or-later
"""For the playbooks: hand on what became of every host, as AWX's artifacts and to the hosts' clusters.

The callback fleet_report knows it, and writes down before each play what it knows so far.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import ClassVar

from ansible import context

from ..module_utils._common.documents import Arguments, Result, Variables
from ..module_utils._common.errors import FleetError
from ..plugin_utils._action.cluster import ClusterAction
from ..plugin_utils._action.voice import display
from ..plugin_utils._kube.access import NoClusterError
from ..plugin_utils._model.fleet import Fleet, Home
from ..plugin_utils._model.host_variables import HostVariables
from ..plugin_utils._model.outcomes import FAILED, UNCHANGED
from ..plugin_utils._report.host_run import HostRun, noted_run
from ..plugin_utils._report.kept import PATIENCE, keep
from ..plugin_utils._report.results import declared_in
from ..plugin_utils._update.outcome import RobotOutcome
from ..plugin_utils._upstream.ansible_core import BRIEF

BEGUN = "the run ended before it could say what became of the host"
# Without the callback.
LEFT = RobotOutcome(FAILED, "it left the run; the callback fleet_report, which knows why, is not enabled")


class ActionModule(ClusterAction):
    """`begin`: no play has run yet, so this stands where the run ends early. `keep`: in the clusters, too."""

    ACCESS: ClassVar = {}  # none is that of all clusters
    ARGUMENTS: ClassVar = {
        "begin": {"type": "bool", "default": False},
        "keep": {"type": "bool", "default": True},
    }

    def work(self, params: Arguments, known: Variables) -> Result:
        fleet = Fleet.from_vars(known)
        hosts = [host for host in known["ansible_play_hosts_all"] if host in fleet.hosts]
        if params["begin"]:
            begun = RobotOutcome(UNCHANGED) if _only_validates() else RobotOutcome(FAILED, BEGUN)
            outcomes = dict.fromkeys(hosts, begun)
        else:
            runs = list(_runs(known, hosts))
            outcomes = {run.host: run.outcome for run in runs}
            if params["keep"] and not self._task.check_mode:
                self._keep(runs, fleet, known)
        data = {host: outcome.as_dict() for host, outcome in outcomes.items()}
        # AWX takes no artifacts by host
        stats = {"data": {"fleet_outcomes": data}, "per_host": False, "aggregate": False}
        return {"changed": False, "ansible_stats": stats, **BRIEF}

    def _keep(self, runs: Iterable[HostRun], fleet: Fleet, known: Variables) -> None:
        """In each cluster what became of its hosts. One that cannot be told keeps nobody from the others."""
        clusters: dict[str, list[HostRun]] = {}
        for run in runs:
            clusters.setdefault(fleet.hosts[run.host].cluster, []).append(run)
        hostvars = HostVariables(known["hostvars"])
        for cluster, own in clusters.items():
            host = own[0].host
            path = str(hostvars[host].get("k3s_kubeconfig_path") or "")
            try:
                with self.opened(Home(fleet.hosts[host], fleet.name), path, known, {}, PATIENCE) as kube:
                    keep(kube, own)
            except NoClusterError:
                continue  # nor is there anything to look at
            except FleetError as error:
                display.warning(f"cluster {cluster}: what became of its hosts is not kept there: {error}")


def _runs(known: Variables, hosts: Iterable[str]) -> Iterator[HostRun]:
    """Who has left the run has failed or is away; the callback knows which, and what the others' tasks changed."""
    noted, here = noted_run(), set(known["ansible_play_hosts"])
    for host in hosts:
        run = (noted.here if host in here else noted.lost).get(host)
        outcome = _told(known["hostvars"][host]) if host in here else LEFT
        yield HostRun.from_dict(run) if run else HostRun(host, noted.playbook, noted.started, outcome)


def _told(variables: Variables) -> RobotOutcome:
    """What a task of this run has said of the host; facts may be those of an earlier run, out of a cache."""
    updated = declared_in((variables.get("update_result") or {}).get("outcome"))
    return updated or declared_in(variables.get("fleet_k3s_outcome")) or RobotOutcome(UNCHANGED)


def _only_validates() -> bool:
    """Whether nothing else was asked for. What imports that playbook has other names."""
    asked = [str(name).removesuffix(".yml") for name in context.CLIARGS.get("args", ())]
    return all(name.endswith("validate") for name in asked)
