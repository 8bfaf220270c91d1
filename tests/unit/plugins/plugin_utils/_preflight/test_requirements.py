# SPDX-License-Identifier: GPL-3.0-or-later
"""What a host's part in the cluster makes it need."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import machines
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.role_specs import role_options
from ansible_collections.rosops.fleet.plugins.plugin_utils._preflight.requirements import (
    look,
    requirements,
    server_addresses,
)

HOSTVARS: dict[str, dict[str, str]] = {"edge1": {"ansible_host": "10.0.0.1"}, "edge2": {"ansible_host": "fd00::2"}}


SERVERS = ["edge1", "edge2"]
DEFAULTS: dict[str, Any] = {name: option.get("default") for name, option in role_options("preflight").items()}


def part(role: str) -> dict[str, str]:
    return {"role": role, "node_name": "n", "k3s_version": "", "interface": ""}


@pytest.mark.parametrize(
    ("role", "host", "reach", "ports"),
    [
        (
            "server", "edge1", ["[fd00::2]:6443", "[fd00::2]:2379", "[fd00::2]:2380"],
            ["6443/tcp", "6444/tcp", "2379/tcp", "2380/tcp", "10250/tcp", "8472/udp"],
        ),
        ("agent", "robot1", ["10.0.0.1:6443", "[fd00::2]:6443"], ["6444/tcp", "10250/tcp", "8472/udp"]),
    ],
)  # fmt: skip
def test_a_server_reaches_the_others_api_and_etcd_and_an_agent_the_api(
    role: str, host: str, reach: list[str], ports: list[str]
) -> None:
    servers = server_addresses(SERVERS, host, HOSTVARS)
    found = look(role, servers)
    assert (found["reach"], [f"{one['port']}/{one['protocol']}" for one in found["ports"]]) == (reach, ports)
    urls = [f"https://{one}" for one in reach if one.endswith(":6443")]
    assert requirements(part(role), DEFAULTS, servers).server_urls == urls


def test_a_server_that_is_alone_has_no_etcd() -> None:
    assert [one["port"] for one in look("server", [])["ports"]] == [6443, 6444, 10250, 8472]


def test_a_host_that_passes_is_beyond_what_k3s_acts_upon() -> None:
    limits = requirements(part("agent"), DEFAULTS, []).disk_percent
    assert limits["minimum"] > machines.EVICTION_FREE_PERCENT
    assert limits["recommended"] > 100 - machines.IMAGE_GC_USED_PERCENT


@pytest.mark.parametrize(("role", "minimum"), [("server", 900), ("agent", 400)])
def test_memory_goes_by_the_part(role: str, minimum: int) -> None:
    assert requirements(part(role), DEFAULTS, []).memory_mb["minimum"] == minimum
