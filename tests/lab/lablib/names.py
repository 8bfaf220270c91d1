# SPDX-License-Identifier: GPL-3.0-or-later
"""Names and subnets: pure functions. They keep the labs of several checkouts on one machine apart."""

from __future__ import annotations

import hashlib
import ipaddress
import re
from collections.abc import Iterable
from ipaddress import IPv4Address, IPv4Network

from .errors import LabError

GROUPS = ("edge", "robots")
DEFAULT_HOSTS = "edge1:edge,robot1:robots,robot2:robots"
LABEL = re.compile(r"[a-z0-9]([a-z0-9-]{0,40}[a-z0-9])?")
# 4096 networks of 254 hosts, away from k3s's pods and services (10.42, 10.43), podman's and docker's own ranges.
POOL = IPv4Network("10.64.0.0/12")
# What k3s and ROS put on the hosts: a lab inside these would hide behind pod or service addresses.
RESERVED = (IPv4Network("10.42.0.0/16"), IPv4Network("10.43.0.0/16"))
FIRST_HOST = 11


def checkout_id(path: str) -> str:
    """Eight hex digits that tell this checkout from any other on the machine."""
    return hashlib.sha256(path.encode()).hexdigest()[:8]


def network_name(checkout: str, lab: str) -> str:
    return f"rosops-{checkout}-{lab}"


def container_name(checkout: str, lab: str, host: str) -> str:
    return f"{network_name(checkout, lab)}-{host}"


def volume_name(checkout: str, lab: str, host: str) -> str:
    return f"{container_name(checkout, lab, host)}-rancher"


def check_lab_name(name: str) -> str:
    if not LABEL.fullmatch(name):
        raise LabError(
            f"lab name {name!r} is not usable", todo="use lower-case letters, digits and dashes, at most 42 characters"
        )
    return name


def parse_hosts(text: str) -> dict[str, str]:
    """`edge1:edge,robot1:robots` as group by name; every mistake in it is reported at once."""
    problems: list[str] = []
    hosts: dict[str, str] = {}
    for item in filter(None, (part.strip() for part in text.split(","))):
        name, colon, group = item.partition(":")
        if not colon or group not in GROUPS:
            problems.append(f"{item!r}: the group must be one of {', '.join(GROUPS)} (name:group)")
        if not LABEL.fullmatch(name):
            problems.append(f"{item!r}: the name must be lower-case letters, digits and dashes, at most 42 characters")
        if name in hosts:
            problems.append(f"{item!r}: the name {name} is used twice")
        hosts[name] = group
    if not hosts:
        problems.append("no host given")
    if problems:
        raise LabError("--hosts: " + "; ".join(problems), todo=f"for example --hosts {DEFAULT_HOSTS}")
    return hosts


def choose_subnet(seed: str, taken: Iterable[IPv4Network]) -> IPv4Network:
    """The first /24 of the pool, from a place that the seed gives, that overlaps nothing taken or reserved.

    Starting from a hash makes two labs that start at the same moment unlikely to try the same network, and gives
    a lab the same addresses again after it was removed.
    """
    busy = [*RESERVED, *taken]
    count = 2 ** (24 - POOL.prefixlen)
    start = int.from_bytes(hashlib.sha256(seed.encode()).digest()[:4], "big") % count
    base = int(POOL.network_address)
    for step in range(count):
        candidate = IPv4Network((base + ((start + step) % count) * 256, 24))
        if not any(candidate.overlaps(other) for other in busy):
            return candidate
    raise LabError(
        f"no free /24 network left in {POOL}",
        where=f"{len(busy)} networks are in use by podman, by this machine's routes or by k3s",
        todo="remove networks that are not needed any more (podman network prune)",
    )


def parse_networks(texts: Iterable[str]) -> list[IPv4Network]:
    """The IPv4 networks among some route or subnet texts; `default` and IPv6 overlap nothing of ours."""
    networks: list[IPv4Network] = []
    for text in texts:
        try:
            network = ipaddress.ip_network(text, strict=False)
        except ValueError:
            continue
        if isinstance(network, IPv4Network) and network.prefixlen > 0:
            networks.append(network)
    return networks


def assign_addresses(
    subnet: IPv4Network, names: Iterable[str], fixed: dict[str, str] | None = None
) -> dict[str, IPv4Address]:
    """An address for each host: the one it had, else the next free one."""
    addresses = {name: IPv4Address(text) for name, text in (fixed or {}).items() if IPv4Address(text) in subnet}
    result: dict[str, IPv4Address] = {}
    used = set(addresses.values())
    free = (address for address in list(subnet.hosts())[FIRST_HOST - 1 :] if address not in used)
    for name in names:
        result[name] = addresses[name] if name in addresses else next(free)
    return result
