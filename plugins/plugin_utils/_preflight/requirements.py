# SPDX-License-Identifier: GPL-3.0-or-later
"""What a host's part in its cluster makes it need, and the limits of the role preflight's variables. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ...module_utils._common.documents import Arguments, Variables
from .._model.topology import address

API = 6443
ETCD = (2379, 2380)
# what k3s takes on its host: API, load balancer of the agent part, etcd, kubelet, flannel's VXLAN
PORTS = {
    "server": (("tcp", API), ("tcp", 6444), *(("tcp", port) for port in ETCD), ("tcp", 10250), ("udp", 8472)),
    "agent": (("tcp", 6444), ("tcp", 10250), ("udp", 8472)),
}
# the options of an action that say a host's part
PART = {
    "role": {"type": "str", "choices": [*PORTS], "required": True},
    "servers": {"type": "list", "elements": "str", "required": True},
}
TIMEOUT = 3.0  # seconds for the answer of a server


def server_addresses(servers: Sequence[str], host: str, hostvars: Mapping[str, Variables]) -> list[str]:
    """Where the cluster's other servers are."""
    return [address(server, hostvars) for server in servers if server != host]


def look(role: str, others: Sequence[str]) -> Arguments:
    """The arguments of the job `facts`. A server talks to the others' etcd, too; one that is alone has none."""
    etcd = ETCD if role == "server" else ()
    return {
        "ports": [{"port": port, "protocol": protocol} for protocol, port in PORTS[role] if others or port not in ETCD],
        "reach": [f"{server}:{port}" for server in others for port in (API, *etcd)],
        "timeout": TIMEOUT,
    }


@dataclass(frozen=True)
class Requirements:
    """What findings are measured by. A limit is `{minimum, recommended}`, of the clock `{recommended, maximum}`."""

    role: str
    node_name: str
    k3s_version: str
    interface: str
    systems: Sequence[str]
    memory_mb: Mapping[str, float]
    disk_mb: Mapping[str, float]
    disk_percent: Mapping[str, float]
    clock_offset: Mapping[str, float]  # s
    server_urls: Sequence[str]


def requirements(part: Arguments, variables: Variables, others: Sequence[str]) -> Requirements:
    """Of a host; `part` are role, node_name, k3s_version and interface, `others` the addresses of the other servers."""
    return Requirements(
        **{key: part[key] for key in ("role", "node_name", "k3s_version", "interface")},
        **{key: variables[f"preflight_{key}"] for key in ("systems", "disk_mb", "disk_percent", "clock_offset")},
        memory_mb=variables[f"preflight_{part['role']}_memory_mb"],
        server_urls=[f"https://{server}:{API}" for server in others],
    )
