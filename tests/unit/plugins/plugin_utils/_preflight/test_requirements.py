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


def test_a_server_reaches_the_others_api_and_etcd() -> None:
    servers = server_addresses(SERVERS, "edge1", HOSTVARS)
    assert servers == ["[fd00::2]"]
    found = look("server", servers)
    assert found["reach"] == ["[fd00::2]:6443", "[fd00::2]:2379", "[fd00::2]:2380"]
    assert {"port": 2379, "protocol": "tcp"} in found["ports"]


def test_a_server_that_is_alone_has_no_etcd() -> None:
    assert [one["port"] for one in look("server", [])["ports"]] == [6443, 6444, 10250, 8472]


def test_an_agent_reaches_every_servers_api() -> None:
    servers = server_addresses(SERVERS, "robot1", HOSTVARS)
    found = look("agent", servers)
    assert found["reach"] == ["10.0.0.1:6443", "[fd00::2]:6443"]
    assert {"port": 6443, "protocol": "tcp"} not in found["ports"]
    wanted = requirements(part("agent"), DEFAULTS, servers)
    assert wanted.server_urls == ["https://10.0.0.1:6443", "https://[fd00::2]:6443"]


def test_a_host_that_passes_is_beyond_what_k3s_acts_upon() -> None:
    limits = requirements(part("agent"), DEFAULTS, []).disk_percent
    assert limits["minimum"] > machines.EVICTION_FREE_PERCENT
    assert limits["recommended"] > 100 - machines.IMAGE_GC_USED_PERCENT


@pytest.mark.parametrize(("role", "minimum"), [("server", 900), ("agent", 400)])
def test_memory_goes_by_the_part(role: str, minimum: int) -> None:
    assert requirements(part(role), DEFAULTS, []).memory_mb["minimum"] == minimum
