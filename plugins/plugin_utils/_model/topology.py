# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which host plays which part, from the inventory's groups alone.

Neither reachability nor --limit may enter here: a host that is off today must not make another one the first server.
Nor may the order of hosts: an inventory of AWX has another one in every job.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ...module_utils._common.documents import Variables
from .finding import Problem, shown

EDGE_CLUSTER = "edge"
MODES = ("agent", "standalone")
SERVER_COUNTS = (1, 3)
Groups = Mapping[str, object]  # Ansible's, by name; those that are lists of hosts count


@dataclass(frozen=True)
class ClusterPart:
    """One host's part: `server` or `agent` of a cluster, whose servers are these; `init` starts the cluster.

    `node` is its name in the cluster.
    """

    role: str
    cluster: str
    servers: tuple[str, ...]
    init: bool
    node: str


def fleet_topology(
    groups: Groups, modes: Mapping[str, str], nodes: Mapping[str, str] | None = None
) -> dict[str, ClusterPart]:
    """The part of every host of the groups `edge` and `robots`, of which nothing is wrong (`topology_problems`).

    `modes` is robot -> `agent` or `standalone`. Without the group `k3s_server` all edge hosts are servers. The first of
    them starts the cluster (`edge_ordered`). `nodes` are the names of hosts that are called otherwise in their cluster.
    """
    servers = edge_servers(groups)
    hosts: dict[str, ClusterPart] = {}
    for host in [*members(groups, "edge"), *members(groups, "robots")]:
        cluster, of = (host, [host]) if modes.get(host) == "standalone" else (EDGE_CLUSTER, servers)
        role, node = "server" if host in of else "agent", (nodes or {}).get(host, host)
        hosts[host] = ClusterPart(role, cluster, tuple(of), host == of[0], node)
    return hosts


def edge_ordered(groups: Groups, first: str = "") -> dict[str, object]:
    """The groups with the edge's hosts by name, after the one that is named as the first."""
    ordered = {
        name: sorted(members(groups, name), key=lambda host: (host != first, host))
        for name in ("edge", "k3s_server")
        if isinstance(groups.get(name), list)
    }
    return {**groups, **ordered}


def members(groups: Groups, group: str) -> list[str]:
    """The hosts of a group in the groups' order; none if the group is missing or is no list."""
    hosts = groups.get(group)
    return [str(host) for host in hosts] if isinstance(hosts, Sequence) and not isinstance(hosts, str) else []


def edge_servers(groups: Groups) -> list[str]:
    """The servers of the shared cluster, in order."""
    return members(groups, "k3s_server") or members(groups, "edge")


def mode_of(robot: str, hosts: Mapping[str, Variables]) -> Any:
    """What a robot's variables say of its mode; `agent` where nothing is said."""
    said = hosts.get(robot, {}).get("robot_mode")
    return MODES[0] if said is None else said


def topology_problems(groups: Groups, modes: Mapping[str, object]) -> list[Problem]:
    """Everything that keeps the groups from making a fleet; empty if they do."""
    edge, robots = members(groups, "edge"), members(groups, "robots")
    problems = [
        Problem(f"groups.{name}", f"is {shown(groups[name])}", "a list of host names")
        for name in ("edge", "robots", "k3s_server")
        if groups.get(name) is not None and (isinstance(groups[name], str) or not isinstance(groups[name], Sequence))
    ]
    if problems:
        return problems
    if not edge and not robots:
        return [Problem("groups", "has no host in edge or robots", "hosts in the groups edge and robots")]
    for host in robots:
        if host in edge:
            problems.append(
                Problem(f"groups.robots.{host}", "is in edge too", "a host in edge or in robots, not in both")
            )
        if host == EDGE_CLUSTER:
            problems.append(Problem(f"groups.robots.{host}", "is the name of the shared cluster", "any other name"))
        if not (isinstance(modes.get(host), str) and modes[host] in MODES):
            problems.append(Problem(f"hosts.{host}.robot_mode", f"is {shown(modes.get(host))}", "agent or standalone"))
    agents = [robot for robot in robots if modes.get(robot) == "agent"]
    if agents and not edge:
        problems.append(
            Problem(
                "groups.edge",
                f"is empty, but {', '.join(agents)} must join its cluster",
                "a host in edge, or robot_mode: standalone",
            )
        )
    return problems + _server_problems(groups)


def _server_problems(groups: Groups) -> list[Problem]:
    """Embedded etcd keeps its majority with an odd number of members; two are worse than one."""
    edge, named, servers = members(groups, "edge"), members(groups, "k3s_server"), edge_servers(groups)
    problems = [
        Problem(f"groups.k3s_server.{host}", "is not in edge", "hosts of the group edge")
        for host in named
        if host not in edge
    ]
    if servers and len(servers) not in SERVER_COUNTS:
        where = "groups.k3s_server" if named else "groups.edge"
        hint = "" if named else " (name them in the group k3s_server; the other edge hosts join as agents)"
        problems.append(Problem(where, f"gives the cluster {len(servers)} servers", f"1 or 3 servers{hint}"))
    return problems
