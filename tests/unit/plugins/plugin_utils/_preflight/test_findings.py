# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Verdicts on the facts of several machines: each row of a table changes one fact of a sound host."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._preflight import findings as _preflight

REQUIREMENTS: dict[str, Any] = {
    "role": "agent",
    "node_name": "robot1",
    "systems": ["debian", "ubuntu", "raspbian"],
    "memory_mb": {"minimum": 400, "recommended": 900},
    "disk_mb": {"minimum": 3000, "recommended": 10000},
    "disk_percent": {"minimum": 6, "recommended": 16},
    "k3s_version": "v1.34.2+k3s1",
    "clock_offset": {"maximum": 30, "recommended": 1},
    "interface": "",
    "server_urls": ["https://10.0.0.1:6443"],
}

X86: dict[str, Any] = {
    "os": {"id": "debian", "version": "12", "name": "Debian GNU/Linux 12 (bookworm)"},
    "kernel": "6.1.0-37-amd64",
    "machine": "x86_64",
    "hostname": "robot1",
    "machine_id": "6c0f0a3e4d5b4f0d8f5f7d1f0a1b2c3d",
    "board": "",
    "systemd": True,
    "root": True,
    "overlay": True,
    "cgroup": {
        "version": 2,
        "refused": False,
        "controllers": ["cpu", "cpuset", "hugetlb", "io", "memory", "misc", "pids", "rdma"],
        "cmdline": "BOOT_IMAGE=/boot/vmlinuz-6.1.0-37-amd64 root=/dev/sda1 ro quiet",
        "cmdline_file": "",
    },
    "memory_mb": 7943,
    "disk": {"path": "/var/lib/rancher", "total_mb": 60000, "free_mb": 41000, "free_inodes": 3600000, "type": "ext4"},
    "routes": [{"family": 4, "interface": "eth0", "gateway": "10.0.0.254", "mtu": 1500}],
    "network": {"firewalls": [], "selinux": {"mode": "", "policy": False}, "lacking": []},
    "listening": [],
    "reach": [{"host": "10.0.0.1", "port": 6443, "outcome": "refused"}],
    "k3s": {
        "config": False,
        "server_url": "",
        "node_password": False,
        "server_data": False,
        "agent_data": False,
        "units": [],
        "foreign_units": [],
    },
    "clock": {"offset": 0.02, "uncertainty": 0.1},
}


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


# Raspberry Pi OS bookworm on a Pi 4: the firmware appends cgroup_disable=memory to the command line.
PI_WITHOUT_MEMORY = host(
    os={"id": "debian", "version": "12", "name": "Debian GNU/Linux 12 (bookworm)"},
    machine="aarch64",
    board="Raspberry Pi 4 Model B Rev 1.4",
    cgroup={
        "version": 2,
        "refused": False,
        "controllers": ["cpu", "cpuset", "io", "pids"],
        "cmdline": "coherent_pool=1M 8250.nr_uarts=0 cgroup_disable=memory console=tty1 root=PARTUUID=1 rootwait",
        "cmdline_file": "/boot/firmware/cmdline.txt",
    },
    memory_mb=3794,
)
PI_3_ARMV7 = host(
    os={"id": "raspbian", "version": "11", "name": "Raspbian GNU/Linux 11 (bullseye)"},
    machine="armv7l",
    board="Raspberry Pi 3 Model B Plus Rev 1.3",
    cgroup={
        "version": 1,
        "refused": True,
        "controllers": ["blkio", "cpu", "cpuacct", "cpuset", "devices", "freezer", "memory", "net_cls", "pids"],
        "cmdline": "cgroup_enable=cpuset cgroup_enable=memory cgroup_memory=1",
        "cmdline_file": "/boot/cmdline.txt",
    },
    memory_mb=921,
)
JETSON_ARM64 = host(
    os={"id": "ubuntu", "version": "20.04", "name": "Ubuntu 20.04.6 LTS"},
    machine="aarch64",
    board="NVIDIA Jetson Xavier NX Developer Kit",
    cgroup={
        "version": 1,
        "refused": True,
        "controllers": ["cpu", "cpuset", "memory", "pids"],
        "cmdline": "",
        "cmdline_file": "",
    },
)


FREE = "MiB free for /var/lib/rancher"


def lines(facts: dict[str, Any], **requirements: Any) -> list[str]:
    return [f"{f['severity']}: {f['what']}" for f in _preflight.findings(facts, {**REQUIREMENTS, **requirements})]


@pytest.mark.parametrize(
    "facts", [X86, {**PI_3_ARMV7, "cgroup": X86["cgroup"]}, host(machine="aarch64")], ids=["x86_64", "armv7", "arm64"]
)
def test_sound_hosts_have_no_findings(facts: dict[str, Any]) -> None:
    assert lines(facts) == []


@pytest.mark.parametrize(
    ("facts", "requirements", "expected"),
    [
        (host(machine="riscv64"), {}, "error: there is no k3s for the architecture riscv64"),
        (host(machine="armv6l"), {}, "error: there is no k3s for the architecture armv6l"),
        (
            host(os={"id": "alpine", "version": "3.20", "name": "Alpine Linux v3.20"}),
            {},
            "warning: Alpine Linux v3.20 is none of",
        ),
        (host(systemd=False), {}, "error: systemd does not run"),
        (host(root=False), {}, "error: the tasks do not run as root"),
        (host(overlay=False), {}, "warning: the kernel has not loaded overlayfs"),
        (PI_WITHOUT_MEMORY, {}, "error: these cgroup controllers are off: memory"),
        (host(cgroup__controllers=["memory", "pids"]), {}, "error: these cgroup controllers are off: cpu, cpuset"),
        (host(memory_mb=399), {}, "error: 399 MiB of memory, a k3s agent needs 400"),
        (host(memory_mb=512), {}, "warning: 512 MiB of memory leave little"),
        (
            host(memory_mb=800),
            {"role": "server", "memory_mb": {"minimum": 900, "recommended": 1900}, "server_urls": []},
            "error: 800 MiB of memory, a k3s server needs 900",
        ),
        (host(disk__free_mb=2999), {}, "error: 2999 MiB free for /var/lib/rancher, at least 3000"),
        (host(disk__free_mb=5000), {}, "warning: 5000 MiB free"),
        (
            host(disk__total_mb=256000, disk__free_mb=12000),
            {},
            "error: 12000 MiB free for /var/lib/rancher, 4.7 % of 2560",
        ),
        (
            host(disk__total_mb=128000, disk__free_mb=6000),
            {},
            "error: 6000 MiB free for /var/lib/rancher, 4.7 % of 1280",
        ),
        (
            host(disk__total_mb=64000, disk__free_mb=3200),
            {},
            "error: 3200 MiB free for /var/lib/rancher, 5.0 % of 64000",
        ),
        (
            host(disk__total_mb=16000, disk__free_mb=2900),
            {},
            "error: 2900 MiB free for /var/lib/rancher, at least 3000",
        ),
        (host(disk__free_mb=9000), {}, "warning: 9000 MiB free for /var/lib/rancher; images fill that fast"),
        (
            host(disk__total_mb=128000, disk__free_mb=20000),
            {},
            "warning: 20000 MiB free for /var/lib/rancher, 15.6 % of",
        ),
        (JETSON_ARM64, {}, "warning: it has cgroup v1, with which k3s from 1.35 on does not start"),
        (PI_3_ARMV7, {"k3s_version": ""}, "warning: it has cgroup v1"),
        (
            JETSON_ARM64,
            {"k3s_version": "v1.35.5+k3s1"},
            "error: it has cgroup v1, with which k3s v1.35.5+k3s1 does not start",
        ),
        (host(disk__free_inodes=100), {}, "warning: 100 inodes free"),
        (host(disk__type="overlay"), {}, "error: /var/lib/rancher lies on overlay"),
        (host(disk__type="nfs4"), {}, "error: /var/lib/rancher lies on nfs4"),
        (
            host(clock={"offset": -86400.0, "uncertainty": 0.2}),
            {},
            "error: the clock is 86400.00 s (± 0.20 s) behind the control node's",
        ),
        (host(clock={"offset": 2.5, "uncertainty": 0.2}), {}, "warning: the clock is 2.50 s (± 0.20 s) ahead of"),
        (host(routes=[]), {}, "error: there is no default route"),
        (host(routes=[{"family": 4, "interface": "wg0", "mtu": 1200}]), {}, "error: the MTU is 1200, at least 1280"),
        (
            host(listening=[{"protocol": "tcp", "port": 6443, "process": "haproxy", "k3s": False}]),
            {},
            "error: port 6443/tcp is taken by haproxy",
        ),
        (
            host(listening=[{"protocol": "udp", "port": 8472, "process": "", "k3s": False}]),
            {},
            "error: port 8472/udp is taken by an unnamed process",
        ),
        (
            host(reach=[{"host": "10.0.0.1", "port": 6443, "outcome": "timeout"}]),
            {},
            "error: 10.0.0.1 port 6443 does not answer (timeout)",
        ),
        (
            host(
                reach=[{"host": "10.0.0.1", "port": 6443, "outcome": "timeout"}],
                k3s__agent_data=True,
                k3s__config=True,
                k3s__units=["k3s-agent.service"],
                k3s__server_url="https://10.0.0.1:6443",
            ),
            {},
            "warning: 10.0.0.1 port 6443 does not answer (timeout)",
        ),
        (host(hostname="Robot_1"), {}, "error: the host name 'Robot_1' is not valid"),
        (host(hostname=""), {}, "error: the host name '' is not valid"),
        (host(hostname="localhost"), {}, "error: the host is named localhost"),
        (host(), {"node_name": "Robot 1"}, "error: the node name 'Robot 1' is not valid"),
        (host(k3s__units=["k3s.service"]), {}, "error: k3s.service is installed, but this host is to be a k3s agent"),
        (
            host(k3s__units=["k3s-agent.service"]),
            {"role": "server", "server_urls": []},
            "error: k3s-agent.service is installed, but this host is to be a k3s server",
        ),
        (host(k3s__server_data=True), {}, "error: the host holds a k3s server's datastore"),
        (
            host(k3s__server_data=True),
            {"role": "server", "server_urls": []},
            "error: the host holds a k3s server's datastore without its configuration",
        ),
        (
            host(k3s__config=True, k3s__server_url="https://192.168.9.9:6443", k3s__agent_data=True),
            {},
            "error: the host belongs to the cluster of https://192.168.9.9:6443, not to that of https://10.0.0.1:6443",
        ),
        (host(k3s__foreign_units=["k3s.service"]), {}, "warning: k3s.service was not written by this collection"),
        (host(k3s__node_password=True), {}, "warning: a node password of an earlier cluster is left"),
    ],
)
def test_what_is_wrong_is_found_alone(facts: dict[str, Any], requirements: dict[str, Any], expected: str) -> None:
    found = lines(facts, **requirements)
    assert len(found) == 1
    assert found[0].startswith(expected)


@pytest.mark.parametrize(
    "facts",
    [
        host(listening=[{"protocol": "tcp", "port": 6443, "process": "k3s-server", "k3s": False}], k3s__config=True),
        host(listening=[{"protocol": "tcp", "port": 10250, "process": "exe", "k3s": True}], k3s__config=True),
        host(
            listening=[{"protocol": "udp", "port": 8472, "process": "", "k3s": False}],
            k3s__config=True,
            k3s__units=["k3s-agent.service"],
        ),
        host(clock={"offset": 1.2, "uncertainty": 0.4}),
        host(disk__free_inodes=None),
        host(disk__total_mb=0, disk__free_mb=41000),
        host(cgroup__version=1),  # and it is allowed
        host(reach=[{"host": "10.0.0.1", "port": 6443, "outcome": "open"}]),
        host(k3s__node_password=True, k3s__config=True),
        host(hostname="robot1.field.example"),
    ],
    ids=[
        "port of k3s itself",
        "kubelet",
        "flannel",
        "within the uncertainty",
        "btrfs",
        "no size",
        "cgroup v1 that is allowed",
        "server is up",
        "a member",
        "long name",
    ],
)
def test_what_is_right_is_not_reported(facts: dict[str, Any]) -> None:
    assert lines(facts) == []


def test_the_raspberry_pi_gets_its_command_line_offered() -> None:
    (finding,) = _preflight.findings(PI_WITHOUT_MEMORY, REQUIREMENTS)
    assert finding["fix"] == (
        "on this Raspberry Pi 4 Model B Rev 1.4: sed -i '1 s/$/ cgroup_enable=cpuset cgroup_enable=memory "
        "cgroup_memory=1/' /boot/firmware/cmdline.txt, then reboot"
    )


def test_another_board_is_told_what_disables_the_controller() -> None:
    facts = host(cgroup__controllers=["cpu", "cpuset", "pids"], cgroup__cmdline="quiet cgroup_disable=memory")
    assert "take cgroup_disable=memory off" in _preflight.findings(facts, REQUIREMENTS)[0]["fix"]


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
    assert _preflight.clock_offset(*times) == expected


def test_hosts_are_compared_with_one_another() -> None:
    twin = host(hostname="ROBOT1", routes=[{"interface": "wlan0", "mtu": 1400}])
    found = _preflight.fleet_findings("robot2", {"robot1": host(), "robot2": twin})
    assert [(f["severity"], f["what"].split(":")[0]) for f in found] == [
        ("error", "the host name ROBOT1 is also that of robot1"),
        ("warning", "the machine ID is also that of robot1, as after copying an SD card"),
        ("warning", "the MTU is 1400, but 1500 on robot1"),
    ]


def test_the_first_of_two_twins_goes_on() -> None:
    fleet = {"edge1": host(), "robot1": host(machine_id="other")}
    assert [_preflight.fleet_findings(name, fleet)[0]["severity"] for name in fleet] == ["warning", "error"]


def test_a_host_alone_has_nothing_to_compare_with() -> None:
    assert _preflight.fleet_findings("robot1", {"robot1": host()}) == []


def test_all_findings_come_in_one_report_errors_first() -> None:
    facts = host(os={"id": "x", "version": "", "name": "X"}, memory_mb=100, routes=[], disk__free_mb=5000)
    report = _preflight.judge({"robot1": facts}, "robot1", REQUIREMENTS)
    assert (report["errors"], report["warnings"]) == (2, 2)
    assert report["text"].splitlines()[0] == "robot1: 2 errors, 2 warnings"
    assert [line.split(":")[0].strip() for line in report["text"].splitlines()[1:]] == ["error"] * 2 + ["warning"] * 2


def test_a_sound_host_says_so() -> None:
    assert _preflight.judge({"robot1": host()}, "robot1", REQUIREMENTS)["text"] == (
        "robot1: ready for k3s, nothing to remark"
    )
