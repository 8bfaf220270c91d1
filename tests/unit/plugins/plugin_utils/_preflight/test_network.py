# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What may keep a robot's pods from the others' is said before it does."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._preflight.network import network_findings
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._preflight.test_findings import REQUIREMENTS

WIFI = {"family": 4, "interface": "wlan0"}
CABLE = {"family": 4, "interface": "eth0"}
CABLE6 = {"family": 6, "interface": "eth0"}
SOUND: dict[str, Any] = {"firewalls": [], "selinux": {"mode": "", "policy": False}, "lacking": []}


def found(routes: Any = (CABLE,), role: str = "agent", interface: str = "", **network: Any) -> list[str]:
    facts = {"kernel": "6.1", "routes": routes, "network": {**SOUND, **network}}
    seen = list(network_findings(facts, replace(REQUIREMENTS, role=role, interface=interface)))
    assert {one.severity for one in seen} <= {"warning"}
    return [f"{one.what} | {one.fix}" for one in seen]


def test_a_sound_host_has_none() -> None:
    assert found() == found(selinux={"mode": "enforcing", "policy": True}) == []
    assert found(selinux={"mode": "permissive", "policy": False}) == []


@pytest.mark.parametrize(
    ("role", "firewall", "words"),
    [
        ("agent", "ufw", "ufw is on; a k3s agent needs 10250/tcp (kubelet, from the servers), 8472/udp"),
        ("server", "firewalld", "firewalld is on; a k3s server needs 6443/tcp (API), 10250/tcp (kubelet), 8472/udp"),
    ],
)
def test_a_firewall_is_named_with_the_ports(role: str, firewall: str, words: str) -> None:
    (line,) = found(role=role, firewalls=[firewall])
    assert words in line
    assert "10.42.0.0/16" in line


def test_selinux_without_the_policy() -> None:
    (line,) = found(selinux={"mode": "enforcing", "policy": False})
    assert "k3s-selinux" in line


def test_modules_that_the_kernel_lacks() -> None:
    overlay, sets = found(lacking=["vxlan", "ip_set"])
    assert "pods of different nodes" in overlay
    assert "host-gw" in overlay
    assert "NetworkPolicies" in sets
    assert "linux-modules-extra-raspi" in sets


def test_wifi_beside_a_cable() -> None:
    (line,) = found(routes=[CABLE, WIFI, CABLE6])
    assert "default routes by eth0 and wlan0" in line
    assert "flannel-iface" in line
    assert found(routes=[CABLE, WIFI], interface="wlan0") == []
    assert found(routes=[CABLE, CABLE, CABLE6]) == []
