# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The hosts of a run that looks at the fleet: who is off, which cluster can be asked, and who reads whose ROS graph."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from ...module_utils._step.objects import Object, name_of
from .._kube.pods import meta
from .._model import names
from .._model.context import Robot, master_namespace
from .._model.fleet import Fleet
from .._model.topology import ClusterPart
from .._objects.pod_settings import promised
from . import rows
from .look import Asked
from .results import Result, message_of
from .ros_graph import apps_of
from .rows import SHARED, Promise, Trouble, Workload

TIMED_OUT = (124, 137)  # how timeout(1) ends after SIGTERM, and after SIGKILL
# What a robot measures: local-path's directories are <volume>_<namespace>_<claim>.
_USAGE = re.compile(r"(\d+)\s+(?:.*/)?[^/_]+_([^/_]+)_([^/]+)")


@dataclass(frozen=True)
class Member:
    """A host of this run, with the robot that it is. `away` is why it does not answer, None where it does."""

    name: str
    address: str
    part: ClusterPart
    robot: Robot | None = None
    away: str | None = None

    @property
    def graph(self) -> str:
        """Whose ROS graph the robot's is. A robot that is a cluster of its own shares with nobody."""
        shared = self.robot is not None and self.robot.master.mode == "shared" and self.part.servers != (self.name,)
        return SHARED if shared else self.name

    @property
    def row(self) -> rows.Host:
        group, away = "robots" if self.robot else "edge", self.away
        return rows.Host(self.name, group, self.address, self.part.role, self.part.cluster, away is None, away or "")


def members(fleet: Fleet, addresses: Mapping[str, str], results: Mapping[str, Result]) -> list[Member]:
    """The hosts of a run, by their addresses; `results` are theirs of a task that ran on all of them."""
    return [
        Member(
            name,
            address,
            fleet.hosts[name],
            fleet.robots.get(name),
            message_of(results[name]) if results.get(name, {}).get("unreachable") else None,
        )
        for name, address in addresses.items()
    ]


def clusters_of(hosts: Iterable[Member]) -> tuple[dict[str, str], dict[str, str]]:
    """Each cluster that can be asked with a host of it, and why the others cannot. A server that is off would be
    waited for; one that this run does not have may be up."""
    asked: dict[str, str] = {}
    silent: dict[str, str] = {}
    by_name = {host.name: host for host in hosts}
    for host in by_name.values():
        servers = [by_name[name] for name in host.part.servers if name in by_name]
        if servers and all(server.away is not None for server in servers):
            silent[host.part.cluster] = "its servers are unreachable"
        else:
            asked.setdefault(host.part.cluster, host.name)
    return asked, silent


def cluster_problems(silent: Mapping[str, str], hosts: Sequence[Member]) -> list[Trouble]:
    """What is told of clusters that do not answer; `cluster` says which hosts' being off explains it."""
    servers = {server for host in hosts for server in host.part.servers}
    by_cluster = {host.part.cluster: host.name for host in hosts if host.name in servers}
    return [
        Trouble(
            f"cluster {cluster}",
            f"does not answer: {why}",
            f"ansible {by_cluster.get(cluster, cluster)} -b -a 'systemctl status k3s'",
            cluster=cluster,
        )
        for cluster, why in silent.items()
    ]


def graphs_to_read(
    hosts: Iterable[Member], services: Mapping[str, Sequence[Object]], apps: Sequence[Workload]
) -> dict[str, Asked]:
    """Which robot reads whose graph.

    A shared master's graph is all robots': the first of them that answers reads it. `services` are each cluster's.
    """
    found: dict[str, Asked] = {}
    taken = set()
    for host in hosts:
        if host.robot is None or host.away is not None or host.graph in taken:
            continue
        uri = _master_uri(host.robot, services.get(host.part.cluster, ()))
        if uri:
            taken.add(host.graph)
            pods = {address for row in apps_of(host.graph, apps) for address in row.addresses}
            found[host.name] = Asked(host.graph, uri, tuple(sorted(pods)))
    return found


def promised_rates(hosts: Iterable[Member]) -> dict[str, dict[str, Promise]]:
    """What apps' readiness says of topics' rates, by graph and topic."""
    found: dict[str, dict[str, Promise]] = {}
    for host in hosts:
        robot = host.robot
        if robot is None:
            continue
        for topic, app, said in promised(robot):
            if rate := said.get("min_rate"):
                owner = host.name if app.scope == "robot" else SHARED
                found.setdefault(host.graph, {})[topic] = Promise(rate, app.name, owner)
    return found


def _master_uri(robot: Robot, services: Iterable[Object]) -> str:
    """Where a host of the cluster reaches the robot's master; empty where there is none."""
    if robot.master.mode == "external":
        return robot.master.uri
    wanted = (master_namespace(robot), names.MASTER_NAME)
    found = (one["spec"]["clusterIP"] for one in services if (meta(one).get("namespace"), name_of(one)) == wanted)
    return next((f"http://{address}:{names.MASTER_PORT}" for address in found), "")


def unmeasured(results: Mapping[str, Result]) -> list[Trouble]:
    """Hosts whose volumes took longer to measure than `timeout` gave them: what is known of them is not all."""
    return [
        Trouble(
            f"volumes of {host}",
            "measuring what they hold took too long; some have no number",
            "ansible-playbook rosops.fleet.status -e status_storage_seconds=120",
        )
        for host, result in results.items()
        if result.get("rc") in TIMED_OUT
    ]


def usage_of(results: Iterable[Result]) -> dict[str, int]:
    """Bytes by `<namespace>/<claim>`, from what `du -sb` said on the hosts."""
    lines = [_USAGE.fullmatch(line) for result in results for line in result.get("stdout_lines") or []]
    return {f"{found[2]}/{found[3]}": int(found[1]) for found in lines if found}
