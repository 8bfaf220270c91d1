# SPDX-License-Identifier: GPL-3.0-or-later
"""Verdicts on the facts of several machines: each row of a table changes one fact of a sound host."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._host.facts import collect
from ansible_collections.rosops.fleet.plugins.module_utils._host.k3s import Host
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import machines
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.role_specs import role_options
from ansible_collections.rosops.fleet.plugins.plugin_utils._preflight.findings import (
    clock_offset,
    fleet_findings,
    judge,
    look,
    report,
    server_addresses,
    warning,
)

DEFAULTS: dict[str, Any] = {name: option.get("default") for name, option in role_options("preflight").items()}
WANTED = {
    **DEFAULTS,
    "role": "agent",
    "node_name": "robot1",
    "k3s_version": "v1.34.2+k3s1",
    "interface": "",
    "others": ["10.0.0.1"],
}

X86: dict[str, Any] = {
    "os": {"id": "debian", "name": "Debian GNU/Linux 12 (bookworm)"},
    "kernel": "6.1.0-37-amd64",
    "machine": "x86_64",
    "hostname": "robot1",
    "machine_id": "6c0f0a3e4d5b4f0d8f5f7d1f0a1b2c3d",
    "board": "",
    "systemd": True,
    "root": True,
    "overlay": True,
    "cgroup": {
        **{"version": 2, "refused": False, "controllers": ["cpu", "cpuset", "io", "memory", "pids"]},
        **{"cmdline": "root=/dev/sda1 ro quiet", "cmdline_file": ""},
    },
    "memory_mb": 7943,
    "disk": {"path": "/var/lib/rancher", "total_mb": 60000, "free_mb": 41000, "free_inodes": 3600000, "type": "ext4"},
    "routes": [{"family": 4, "interface": "eth0", "mtu": 1500}],
    "network": {"firewalls": [], "selinux": {"mode": "", "policy": False}, "lacking": []},
    "listening": [],
    "reach": [{"host": "10.0.0.1", "port": 6443, "outcome": "refused"}],
    "k3s": {
        **dict.fromkeys(("config", "node_password", "server_data", "agent_data"), False),
        **{"server_url": "", "units": [], "foreign_units": []},
    },
    "clock": {"offset": 0.02, "uncertainty": 0.1},
}


def shape(value: Any) -> Any:
    return {key: shape(item) for key, item in value.items()} if isinstance(value, dict) else ...


def test_a_host_of_these_tables_has_the_facts_that_a_host_has() -> None:
    assert shape(X86) == {**shape(collect(Host(), [], [], 1.0)), "clock": shape(X86["clock"])}


def host(**changes: Any) -> dict[str, Any]:
    """A sound host with something changed; `a__b=1` sets facts[a][b]."""
    facts = copy.deepcopy(X86)
    for path, value in changes.items():
        *parents, last = path.split("__")
        place = facts
        for parent in parents:
            place = place[parent]
        place[last] = value
    return facts


V1 = {"version": 1, "refused": True}
# Raspberry Pi OS bookworm on a Pi 4: the firmware appends cgroup_disable=memory to the command line.
PI_WITHOUT_MEMORY = host(
    machine="aarch64",
    board="Raspberry Pi 4 Model B Rev 1.4",
    cgroup__controllers=["cpu", "cpuset", "io", "pids"],
    cgroup__cmdline="coherent_pool=1M 8250.nr_uarts=0 cgroup_disable=memory console=tty1 root=PARTUUID=1 rootwait",
    cgroup__cmdline_file="/boot/firmware/cmdline.txt",
    memory_mb=3794,
)
PI_3_ARMV7 = host(os={"id": "raspbian", "version": "11", "name": "Raspbian"}, machine="armv7l", memory_mb=921)
JETSON_ARM64 = host(machine="aarch64", cgroup={**X86["cgroup"], **V1})
AWAY = [{"host": "10.0.0.1", "port": 6443, "outcome": "timeout"}]
THERE = {"host": "10.0.0.2", "port": 6443, "outcome": "open"}
OURS = {"k3s__agent_data": True, "k3s__config": True, "k3s__units": ["k3s-agent.service"]}
SERVER = {"role": "server", "others": []}
CABLE, WIFI = ({"family": 4, "interface": name, "mtu": 1500} for name in ("eth0", "wlan0"))
CABLE6 = {**CABLE, "family": 6}
ENFORCING = {"mode": "enforcing", "policy": False}


def taken(protocol: str, port: int, process: str, k3s: bool = False) -> list[dict[str, Any]]:
    return [{"protocol": protocol, "port": port, "process": process, "k3s": k3s}]


def lines(facts: dict[str, Any], **wanted: Any) -> list[str]:
    return [f"{f.severity}: {f.what} Fix: {f.fix}" for f in judge({"robot1": facts}, "robot1", {**WANTED, **wanted})]


# To a Raspberry Pi its own command line is offered.
TO_THE_PI = (
    "on this Raspberry Pi 4 Model B Rev 1.4: sed -i '1 s/$/ cgroup_enable=cpuset cgroup_enable=memory "
    "cgroup_memory=1/' /boot/firmware/cmdline.txt, then reboot"
)
SWITCHED_OFF = host(cgroup__controllers=["cpu", "cpuset", "pids"], cgroup__cmdline="quiet cgroup_disable=memory")


@pytest.mark.parametrize(
    ("facts", "wanted", "expected"),
    [
        (host(machine="riscv64"), {}, "error: there is no k3s for the architecture riscv64"),
        (host(os={"id": "alpine", "version": "3", "name": "Alpine"}), {}, "warning: Alpine is none of"),
        (host(systemd=False), {}, "error: systemd does not run"),
        (host(root=False), {}, "error: the tasks do not run as root"),
        (host(overlay=False), {}, "warning: the kernel has not loaded overlayfs"),
        (PI_WITHOUT_MEMORY, {}, f"error: these cgroup controllers are off: memory ... {TO_THE_PI}"),
        (SWITCHED_OFF, {}, "error: these cgroup controllers are off: memory ... take cgroup_disable=memory off"),
        (host(cgroup__controllers=["memory", "pids"]), {}, "error: these cgroup controllers are off: cpu, cpuset"),
        (JETSON_ARM64, {}, "warning: it has cgroup v1, with which k3s from 1.35 on does not start"),
        (JETSON_ARM64, {"k3s_version": ""}, "warning: it has cgroup v1"),
        (JETSON_ARM64, {"k3s_version": "v1.35.5+k3s1"}, "error: it has cgroup v1, with which k3s v1.35.5+k3s1 does"),
        (host(memory_mb=399), {}, "error: 399 MiB of memory, a k3s agent needs 400"),
        (host(memory_mb=512), {}, "warning: 512 MiB of memory leave little"),
        (host(memory_mb=899), SERVER, "error: 899 MiB of memory, a k3s server needs 900"),
        (host(disk__free_mb=2999), {}, "error: 2999 MiB free for /var/lib/rancher, at least 3000"),
        (host(disk__total_mb=256000, disk__free_mb=12000), {}, "error: 12000 MiB free for /var/lib/rancher, 4.7 %"),
        (host(disk__free_mb=9000), {}, "warning: 9000 MiB free for /var/lib/rancher; images fill that fast"),
        (host(disk__total_mb=128000, disk__free_mb=20000), {}, "warning: 20000 MiB free for /var/lib/rancher, 15.6 %"),
        (host(disk__free_inodes=100), {}, "warning: 100 inodes free"),
        (host(disk__type="overlay"), {}, "error: /var/lib/rancher lies on overlay"),
        (host(clock={"offset": -86400.0, "uncertainty": 0.2}), {}, "error: the clock is 86400.00 s (± 0.20 s) behind"),
        (host(clock={"offset": 2.5, "uncertainty": 0.2}), {}, "warning: the clock is 2.50 s (± 0.20 s) ahead of"),
        (host(routes=[]), {}, "error: there is no default route"),
        (host(routes=[{"family": 4, "interface": "wg0", "mtu": 1200}]), {}, "error: the MTU is 1200, at least 1280"),
        (host(listening=taken("tcp", 6443, "haproxy")), {}, "error: port 6443/tcp is taken by haproxy"),
        (host(listening=taken("udp", 8472, "")), {}, "error: port 8472/udp is taken by an unnamed process"),
        (host(reach=AWAY), {}, "error: 10.0.0.1 port 6443 does not answer (timeout)"),
        (host(reach=AWAY, **OURS), {}, "warning: 10.0.0.1 port 6443 does not answer (timeout)"),
        (host(reach=[*AWAY, THERE]), {}, "warning: 10.0.0.1 port 6443 does not answer (timeout)"),
        (host(reach=[*AWAY, THERE]), SERVER, "error: 10.0.0.1 port 6443 does not answer (timeout)"),
        (host(hostname="Robot_1"), {}, "error: the host name 'Robot_1' is not valid"),
        (host(hostname=""), {}, "error: the host name '' is not valid"),
        (host(hostname="localhost"), {}, "error: the host is named localhost"),
        (host(), {"node_name": "Robot 1"}, "error: the node name 'Robot 1' is not valid"),
        (host(k3s__units=["k3s.service"]), {}, "error: k3s.service is installed, but this host is to be a k3s agent"),
        (host(k3s__units=["k3s-agent.service"]), SERVER,
         "error: k3s-agent.service is installed, but this host is to be"),
        (host(k3s__server_data=True), {}, "error: the host holds a k3s server's datastore"),
        (host(k3s__server_data=True), SERVER,
         "error: the host holds a k3s server's datastore without its configuration"),
        (host(k3s__config=True, k3s__server_url="https://192.168.9.9:6443", k3s__agent_data=True), {},
         "error: the host belongs to the cluster of https://192.168.9.9:6443, not to that of https://10.0.0.1:6443"),
        (host(k3s__foreign_units=["k3s.service"]), {}, "warning: k3s.service was not written by this collection"),
        (host(k3s__node_password=True), {}, "warning: a node password of an earlier cluster is left"),
        (host(network__firewalls=["ufw"]), {},
         "warning: ufw is on; a k3s agent needs 10250/tcp (kubelet, from the servers), 8472/udp ... 10.42.0.0/16"),
        (host(network__firewalls=["firewalld"]), SERVER,
         "warning: firewalld is on; a k3s server needs 6443/tcp (API), 10250/tcp (kubelet), 8472/udp"),
        (host(network__selinux=ENFORCING), {},
         "warning: SELinux is enforcing, and k3s's policy is not there ... k3s-selinux"),
        (host(network__lacking=["vxlan"]), {},
         "warning: the kernel has no module vxlan: flannel cannot connect ... host-gw"),
        (host(network__lacking=["ip_set"]), {},
         "warning: the kernel has no module ip_set: NetworkPolicies are not ... linux-modules-extra-raspi"),
        (host(routes=[CABLE, WIFI, CABLE6]), {},
         "warning: there are default routes by eth0 and wlan0 ... flannel-iface"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_found_alone(facts: dict[str, Any], wanted: dict[str, Any], expected: str) -> None:
    (found,) = lines(facts, **wanted)
    what, _between, fix = expected.partition(" ... ")
    assert found.startswith(what)
    assert fix in found.partition(" Fix: ")[2]


@pytest.mark.parametrize(
    "facts",
    [
        PI_3_ARMV7,
        host(listening=taken("tcp", 10250, "exe", True), k3s__config=True),  # the kubelet
        host(listening=taken("udp", 8472, ""), k3s__config=True, k3s__units=["k3s-agent.service"]),  # flannel
        host(clock={"offset": 1.2, "uncertainty": 0.4}),  # within the uncertainty
        host(disk__free_inodes=None),  # btrfs
        host(disk__total_mb=0, disk__free_mb=41000),
        host(cgroup__version=1),  # and it is allowed
        host(reach=[{"host": "10.0.0.1", "port": 6443, "outcome": "open"}]),
        host(k3s__node_password=True, k3s__config=True),  # a member
        host(hostname="robot1.field.example"),
        host(network__selinux={**ENFORCING, "policy": True}),
        host(network__selinux={**ENFORCING, "mode": "permissive"}),
        host(routes=[CABLE, CABLE, CABLE6]),
    ],
)
def test_what_is_right_is_not_reported(facts: dict[str, Any]) -> None:
    assert lines(facts) == lines(host(routes=[CABLE, WIFI]), interface="wlan0") == []


@pytest.mark.parametrize(
    ("times", "expected"),
    [
        ((100.0, 100.4, 100.5, 100.9), {"offset": 0.0, "uncertainty": 0.4}),
        ((100.0, 105.4, 105.5, 100.9), {"offset": 5.0, "uncertainty": 0.4}),
        ((100.0, 40.1, 60.1, 120.2), {"offset": -60.0, "uncertainty": 0.1}),
    ],
    ids=["no offset", "ahead", "behind, and the module's own 20 s do not count"],
)
def test_clock_offset_is_bounded_by_the_way_alone(times: tuple[float, ...], expected: dict[str, float]) -> None:
    assert clock_offset(*times) == expected


def test_hosts_are_compared_with_one_another() -> None:
    twin = host(hostname="ROBOT1", routes=[{"interface": "wlan0", "mtu": 1400}])
    found = fleet_findings("robot2", {"robot1": host(), "robot2": twin})
    assert [(f.severity, f.what.split(":")[0]) for f in found] == [
        ("error", "the host name ROBOT1 is also that of robot1"),
        ("warning", "the machine ID is also that of robot1, as after copying an SD card"),
        ("warning", "the MTU is 1400, but 1500 on robot1"),
    ]


def test_the_first_of_two_twins_goes_on() -> None:
    fleet = {"edge1": host(), "robot1": host(machine_id="other")}
    assert [judge(fleet, name, WANTED)[0].severity for name in fleet] == ["warning", "error"]


def test_all_findings_come_in_one_report_errors_first() -> None:
    facts = host(os={"id": "x", "version": "", "name": "X"}, memory_mb=100, routes=[], disk__free_mb=5000)
    found = report("robot1", judge({"robot1": facts}, "robot1", WANTED)).splitlines()
    assert found[0] == "robot1: 2 errors, 2 warnings"
    assert [line.split(":")[0].strip() for line in found[1:]] == ["error"] * 2 + ["warning"] * 2
    told = report("robot1", [warning("\x1b[31mred\n  error: all", "/etc", "none")])
    assert told.splitlines() == [
        "robot1: 0 errors, 1 warning",
        "  warning: \\x1b[31mred error: all (seen in /etc). Fix: none",
    ]
    sound = judge({"robot1": host()}, "robot1", WANTED)
    assert report("robot1", sound) == "robot1: ready for k3s, nothing to remark"


# ---- what a host's part makes it need

HOSTVARS: dict[str, dict[str, str]] = {"edge1": {"ansible_host": "10.0.0.1"}, "edge2": {"ansible_host": "fd00::2"}}
SERVERS = ["edge1", "edge2"]


@pytest.mark.parametrize(
    ("role", "host", "reach", "ports"),
    [
        (
            "server", "edge1", ["[fd00::2]:6443", "[fd00::2]:2379", "[fd00::2]:2380"],
            ["6443/tcp", "6444/tcp", "2379/tcp", "2380/tcp", "10250/tcp", "8472/udp"],
        ),
        ("agent", "robot1", ["10.0.0.1:6443", "[fd00::2]:6443"], ["6444/tcp", "10250/tcp", "8472/udp"]),
        ("server", "alone", [], ["6443/tcp", "6444/tcp", "10250/tcp", "8472/udp"]),  # without an etcd
    ],
)  # fmt: skip
def test_a_server_reaches_the_others_api_and_etcd_and_an_agent_the_api(
    role: str, host: str, reach: list[str], ports: list[str]
) -> None:
    found = look(role, [] if host == "alone" else server_addresses(SERVERS, host, HOSTVARS))
    assert (found["reach"], [f"{one['port']}/{one['protocol']}" for one in found["ports"]]) == (reach, ports)


def test_a_host_that_passes_is_beyond_what_k3s_acts_upon() -> None:
    limits = DEFAULTS["preflight_disk_percent"]
    assert limits["minimum"] > machines.EVICTION_FREE_PERCENT
    assert limits["recommended"] > 100 - machines.IMAGE_GC_USED_PERCENT
