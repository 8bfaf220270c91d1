# SPDX-License-Identifier: GPL-3.0-or-later
"""Which host plays which part, and where it is, from the inventory alone.

Neither reachability nor --limit may enter here: a host that is off today must not make another one the first server.
Nor may the order of hosts: an inventory of AWX has another one in every job.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ...module_utils._common.documents import Variables
from ...module_utils._common.errors import SpecError

EDGE_CLUSTER = "edge"
Groups = Mapping[str, Sequence[str]]  # Ansible's: hosts by the group's name


@dataclass(frozen=True)
class ClusterPart:
    """One host's part: `server` or `agent` of a cluster, whose servers are these; `init` starts the cluster."""

    role: str
    cluster: str
    servers: tuple[str, ...]
    init: bool
    node: str  # its name in the cluster


def fleet_topology(
    groups: Groups, modes: Mapping[str, str], nodes: Mapping[str, str] | None = None
) -> dict[str, ClusterPart]:
    """The part of every host of the groups `edge` and `robots`, of which nothing is wrong.

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


def edge_ordered(groups: Groups, first: str = "") -> Groups:
    """The groups with the edge's hosts by name, after the one that is named as the first."""
    of_edge = {"edge", "k3s_server"} & groups.keys()
    return {**groups, **{name: sorted(groups[name], key=lambda host: (host != first, host)) for name in of_edge}}


def members(groups: Groups, group: str) -> list[str]:
    """The hosts of a group in the groups' order; none if there is no such group."""
    return [str(host) for host in groups.get(group, ())]


def edge_servers(groups: Groups) -> list[str]:
    """The servers of the shared cluster, in order."""
    return members(groups, "k3s_server") or members(groups, "edge")


def address(host: str, hostvars: Mapping[str, Variables]) -> str:
    """The host's address as it stands in a URL, an IPv6 one in brackets."""
    if host not in hostvars:
        raise SpecError(f"{host} is no host of the inventory")
    known = hostvars[host]
    text = str(known.get("k3s_node_ip") or known.get("ansible_host") or host).split(",", maxsplit=1)[0].strip()
    return in_url(text)


def in_url(name: str) -> str:
    """A name or an address as it stands in a URL, whether an IPv6 one was given its brackets or not."""
    return f"[{name.strip('[]')}]" if ":" in name else name
