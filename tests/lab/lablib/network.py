# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The lab's bridge network."""

from __future__ import annotations

import json
from ipaddress import IPv4Network
from typing import Any

from .artifacts import Cache
from .errors import LabError
from .names import choose_subnet, parse_networks
from .podman import podman, podman_json, podman_try
from .run import run, say


def _subnets(network: dict[str, Any]) -> list[str]:
    return [entry["subnet"] for entry in network.get("subnets") or []]


def _taken() -> list[IPv4Network]:
    """What podman's networks and this machine's routes and addresses cover."""
    names = podman("network", "ls", "--format", "{{.Name}}").split()
    networks = podman_json("network", "inspect", *names) if names else []
    routes = json.loads(run(["ip", "-json", "-4", "route", "show", "table", "all"]).stdout or "[]")
    texts = [subnet for network in networks for subnet in _subnets(network)]
    return parse_networks([*texts, *(str(route.get("dst", "")) for route in routes)])


def ensure_network(cache: Cache, name: str, labels: dict[str, str]) -> IPv4Network:
    """The network's subnet; it is made where it is missing. One at a time per machine: subnets must not clash."""
    with cache.lock("network", "another lab to make its network"):
        found = podman_try("network", "inspect", name)
        if found.returncode == 0:
            subnets = parse_networks(_subnets(json.loads(found.stdout)[0]))
            if len(subnets) == 1:
                return subnets[0]
            raise LabError(f"the podman network {name} is not the lab's", todo=f"podman network rm -f {name}")
        subnet = choose_subnet(name, _taken())
        flags = [f"--label={key}={value}" for key, value in labels.items()]
        podman("network", "create", "--disable-dns", f"--subnet={subnet}", *flags, name)
        say(f"network {name}: {subnet}")
        return subnet


def remove_network(name: str) -> None:
    if podman_try("network", "inspect", name).returncode == 0:
        podman("network", "rm", "--force", name)
