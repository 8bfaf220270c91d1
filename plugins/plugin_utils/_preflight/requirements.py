# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is asked of a host, from the variables of the role preflight. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.addresses import address

API = 6443
ETCD = (2379, 2380)


def server_addresses(variables: Mapping[str, Any], host: str, hostvars: Mapping[str, Any]) -> list[str]:
    """Where the cluster's other servers are."""
    return [address(server, hostvars) for server in variables["preflight_server_hosts"] if server != host]


def look(variables: Mapping[str, Any], servers: Sequence[str]) -> dict[str, Any]:
    """The arguments of the job `facts`. A server talks to the others' etcd, too; one that is alone has none."""
    role, alone = variables["preflight_role"], not servers
    return {
        "ports": [one for one in variables[f"preflight_{role}_ports"] if not (alone and one["port"] in ETCD)],
        "reach": [f"{server}:{port}" for server in servers for port in (API, *(ETCD if role == "server" else ()))],
        "timeout": variables["preflight_timeout"],
    }


def requirements(variables: Mapping[str, Any], servers: Sequence[str]) -> dict[str, Any]:
    """What findings are measured by."""
    return {
        "role": variables["preflight_role"],
        "node_name": variables["preflight_node_name"],
        "systems": variables["preflight_systems"],
        "memory_mb": variables[f"preflight_{variables['preflight_role']}_memory_mb"],
        "disk_mb": variables["preflight_disk_mb"],
        "disk_percent": variables["preflight_disk_percent"],
        "k3s_version": variables["preflight_k3s_version"],
        "clock_offset": variables["preflight_clock_offset"],
        "minimum_mtu": variables["preflight_minimum_mtu"],
        "interface": variables["preflight_interface"],
        "server_urls": [f"https://{server}:{API}" for server in servers],
    }
