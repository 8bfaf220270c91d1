# SPDX-License-Identifier: GPL-3.0-or-later
"""Facts read from recorded trees and, for sockets, from this machine's loopback."""

from __future__ import annotations

import os
import socket
import time
from pathlib import Path
from unittest.mock import Mock

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._host import facts as _host_facts
from ansible_collections.rosops.fleet.plugins.module_utils._host.k3s import Host, K3sHost
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers
from ansible_collections.rosops.fleet.tests.unit.plugins.module_utils._robot.cluster_around import (
    certificate,
    start_server,
)


def tree(tmp_path: Path, files: dict[str, str]) -> Host:
    """The host whose root is `tmp_path`; `files` come to those that are there."""
    for name, content in files.items():
        file = tmp_path / name.lstrip("/")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(content)
    return Host(str(tmp_path))


CGROUP = "1:name=systemd:/system.slice/k3s.service\n0::/\n"
CGROUPS_V1 = """#subsys_name\thierarchy\tnum_cgroups\tenabled
cpuset\t9\t1\t1
cpu\t4\t50\t1
memory\t0\t60\t0
pids\t6\t60\t1
"""
ROUTE = """Iface\tDestination\tGateway \tFlags\tRefCnt\tUse\tMetric\tMask\t\tMTU\tWindow\tIRTT
wlan0\t00000000\tFE01A8C0\t0003\t0\t0\t600\t00000000\t0\t0\t0
eth0\t00000000\t0100000A\t0003\t0\t0\t100\t00000000\t0\t0\t0
eth0\t0000000A\t00000000\t0001\t0\t0\t100\t00FFFFFF\t0\t0\t0
"""
ROUTE6 = (
    "00000000000000000000000000000000 00 00000000000000000000000000000000 00 "
    "fe800000000000000000000000000001 00000400 00000001 00000000 00000003     eth0\n"
    "00000000000000000000000000000000 00 00000000000000000000000000000000 00 "
    "00000000000000000000000000000000 ffffffff 00000001 00000000 00200200       lo\n"
)
MOUNTS = """overlay / overlay rw 0 0
/dev/sda1 /var ext4 rw 0 0
tmpfs /var/lib tmpfs rw 0 0
/dev/sdb1 /var/lib/rancher xfs rw 0 0
/dev/sdc1 /var/lib/rancher-other btrfs rw 0 0
"""
TCP = """  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode
   0: 0100007F:192B 00000000:0000 0A 00000000:00000000 00:00000000 00000000     0        0 555 1 0 100 0 0 10 0
   1: 0100007F:192B 0100007F:9999 01 00000000:00000000 00:00000000 00000000     0        0 556 1 0 100 0 0 10 0
   2: 00000000:0016 00000000:0000 0A 00000000:00000000 00:00000000 00000000     0        0 557 1 0 100 0 0 10 0
"""
UDP = """  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode ref
 100: 00000000:2118 00000000:0000 07 00000000:00000000 00:00000000 00000000     0        0 0 2 0 0
"""


DROP_INS = "/var/lib/rancher/k3s/agent/etc/kubelet.conf.d"
DROP_IN = "apiVersion: kubelet.config.k8s.io/v1beta1\nkind: KubeletConfiguration\nfailCgroupV1: {}\n"


V2 = {"/sys/fs/cgroup/cgroup.controllers": "cpuset cpu io memory pids\n"}


@pytest.mark.parametrize(
    ("files", "version", "controllers", "refused"),
    [
        ({}, 1, ["cpu", "cpuset", "pids"], True),  # those that are enabled
        ({f"{DROP_INS}/10-cgroup-v1.conf": DROP_IN.format("false")}, 1, ["cpu", "cpuset", "pids"], False),
        ({f"{DROP_INS}/10-cgroup-v1.conf": DROP_IN.format("true")}, 1, ["cpu", "cpuset", "pids"], True),
        ({f"{DROP_INS}/10-cgroup-v1.conf.off": DROP_IN.format("false")}, 1, ["cpu", "cpuset", "pids"], True),
        (V2, 2, ["cpu", "cpuset", "io", "memory", "pids"], False),  # it wins over v1's table
    ],
)
def test_cgroups(tmp_path: Path, files: dict[str, str], version: int, controllers: list[str], refused: bool) -> None:
    there = {"/proc/cgroups": CGROUPS_V1, "/boot/cmdline.txt": "x", **files}
    found = _host_facts.cgroup(tree(tmp_path, there))
    assert (found["version"], found["controllers"], found["refused"]) == (version, controllers, refused)
    assert found["cmdline_file"] == "/boot/cmdline.txt"


def test_default_routes_come_best_first_with_their_mtu(tmp_path: Path) -> None:
    files = {
        "/proc/net/route": ROUTE,
        "/proc/net/ipv6_route": ROUTE6,
        "/sys/class/net/eth0/mtu": "1500\n",
        "/sys/class/net/wlan0/mtu": "1400\n",
    }
    assert [(r["family"], r["interface"], r["mtu"]) for r in _host_facts.routes(tree(tmp_path, files))] == [
        (4, "eth0", 1500), (4, "wlan0", 1400), (6, "eth0", 1500),
    ]  # fmt: skip


@pytest.mark.parametrize(("directory", "kind"), [
    ("/var/lib/rancher/k3s", "xfs"), ("/var/lib/rancher", "xfs"), ("/var/lib", "tmpfs"), ("/var/log", "ext4"),
    ("/", "overlay"),
])  # fmt: skip
def test_the_innermost_mount_counts(directory: str, kind: str) -> None:
    assert _host_facts.filesystem_type(MOUNTS, directory) == kind


def test_the_disk_of_a_directory_that_is_not_there_yet(tmp_path: Path) -> None:
    found = _host_facts.disk(Host(str(tmp_path)), "/var/lib/rancher")
    assert found["path"] == "/var/lib/rancher"
    assert found["total_mb"] > 0


def test_the_disk_to_which_a_link_leads(tmp_path: Path) -> None:
    host = tree(tmp_path, {"/proc/self/mounts": f"{MOUNTS}/dev/sdd1 /data ext4 rw 0 0\n", "/data/x": ""})
    (tmp_path / "var/lib").mkdir(parents=True)
    (tmp_path / "var/lib/rancher").symlink_to("../../data")
    assert _host_facts.disk(host, "/var/lib/rancher")["type"] == "ext4"


def test_listeners_are_named_and_other_sockets_left_out(tmp_path: Path) -> None:
    host = tree(
        tmp_path, {"/proc/net/tcp": TCP, "/proc/net/udp": UDP, "/proc/77/comm": "exe\n", "/proc/77/cgroup": CGROUP}
    )
    (tmp_path / "proc/77/fd").mkdir()
    (tmp_path / "proc/77/fd/3").symlink_to("socket:[555]")
    assert _host_facts.listening(host, [("tcp", 6443), ("udp", 8472), ("tcp", 2379)]) == [
        {"protocol": "tcp", "port": 6443, "process": "exe", "k3s": True},
        {"protocol": "udp", "port": 8472, "process": "", "k3s": False},
    ]


def test_an_empty_tree_reads_as_nothing(tmp_path: Path) -> None:
    found = _host_facts.collect(Host(str(tmp_path)), [], [], 1)
    assert found["memory_mb"] == 0
    assert found["routes"] == found["listening"] == found["reach"] == []
    assert found["cgroup"]["controllers"] == []
    assert not found["k3s"]["config"]
    assert found["network"] == {"firewalls": [], "selinux": {"mode": "", "policy": False}, "lacking": []}


def test_leftovers_of_a_member(tmp_path: Path) -> None:
    files = {
        "/etc/rancher/k3s/config.yaml": "node-name: robot1\nserver: https://10.0.0.1:6443\n",
        "/etc/rancher/node/password": "x",
        "/var/lib/rancher/k3s/agent/client-kubelet.crt": "x",
        "/etc/systemd/system/k3s-agent.service": "# Written by Ansible (rosops.fleet.k3s)\n",
        "/etc/systemd/system/k3s.service": "[Unit]\n",
    }
    assert _host_facts.k3s_leftovers(tree(tmp_path, files)) == {
        "config": True, "server_url": "https://10.0.0.1:6443", "node_password": True, "server_data": False,
        "agent_data": True, "units": ["k3s.service", "k3s-agent.service"], "foreign_units": ["k3s.service"],
    }  # fmt: skip


def test_what_the_system_says_of_itself(tmp_path: Path) -> None:
    told = "NAME=Other\nPRETTY_NAME=\"Debian GNU/Linux 12 (bookworm)\"\nID=debian\nVERSION_ID='12'\n"
    model = "Raspberry Pi 4 Model B Rev 1.4\0"  # which ends with a zero byte
    found = _host_facts.system(tree(tmp_path, {"/etc/os-release": told, "/proc/device-tree/model": model}))
    assert found["os"] == {"id": "debian", "name": "Debian GNU/Linux 12 (bookworm)"}
    assert found["board"] == "Raspberry Pi 4 Model B Rev 1.4"


def test_ports_are_open_or_refuse(peers: Peers) -> None:
    found = _host_facts.reach([f"127.0.0.1:{port}" for port in (peers.hung(), peers.dead())], 2)
    assert [target["outcome"] for target in found] == ["open", "refused"]


@pytest.mark.parametrize(("raised", "outcome"), [
    (TimeoutError(), "timeout"), (socket.gaierror(-2, "no name"), "unresolved"),
    (OSError(113, "x"), "no route to host"), (OSError("odd"), "unreachable"),
])  # fmt: skip
def test_silence_and_other_ends(monkeypatch: pytest.MonkeyPatch, raised: OSError, outcome: str) -> None:
    monkeypatch.setattr(socket, "create_connection", Mock(side_effect=raised))
    assert _host_facts.reach(["[fd00::1]:6443"], 1) == [{"host": "fd00::1", "port": 6443, "outcome": outcome}]


# ---- between pods and their network


SERVICE = "system.slice/firewalld.service/cgroup.procs"


@pytest.mark.parametrize(
    ("files", "found"),
    [
        ({"/etc/ufw/ufw.conf": "# ENABLED=yes\nENABLED=no\n"}, []),
        ({"/etc/ufw/ufw.conf": "ENABLED=yes\n", f"/sys/fs/cgroup/{SERVICE}": ""}, ["ufw", "firewalld"]),
        ({f"/sys/fs/cgroup/systemd/{SERVICE}": ""}, ["firewalld"]),
    ],
)
def test_firewalls_that_are_on(tmp_path: Path, files: dict[str, str], found: list[str]) -> None:
    assert _host_facts.firewalls(tree(tmp_path, files)) == found


def test_selinux(tmp_path: Path) -> None:
    fedora = tree(tmp_path, {"/sys/fs/selinux/enforce": "1", "/usr/share/selinux/packages/k3s.pp": ""})
    assert _host_facts.selinux(fedora) == {"mode": "enforcing", "policy": True}
    assert _host_facts.selinux(tree(tmp_path, {"/sys/fs/selinux/enforce": "0"}))["mode"] == "permissive"


def test_modules(tmp_path: Path) -> None:
    jetson = {
        "/lib/modules/6.1/modules.dep": "kernel/net/ipv4/netfilter/x.ko:\nkernel/net/ip_set.ko.xz: a\n",
        "/lib/modules/6.1/modules.builtin": "kernel/net/not_vxlan.ko\n",
    }
    host = tree(tmp_path, jetson)
    assert _host_facts.lacking(host, "6.1") == ["vxlan"]
    assert _host_facts.lacking(host, "6.2") == []  # a container has no list of its host's
    assert _host_facts.lacking(tree(tmp_path, {"/sys/module/vxlan/refcnt": "0"}), "6.1") == []


# ---- what k3s is there

AGENT = {
    "role": "agent", "files": [], "beside": [], "token": "", "agent_token": "", "servers": [], "external": False,
}  # fmt: skip


def test_a_file_that_k3s_does_not_read_is_looked_at_and_makes_no_start_due(tmp_path: Path) -> None:
    run = Mock(return_value=(0, "", ""))
    found = _host_facts.k3s_facts(K3sHost(run, str(tmp_path)), {**AGENT, "files": ["/read"], "beside": ["/beside"]})
    assert {"/read", "/beside"} <= found["files"].keys()
    assert [words[3:] for (words,), _more in run.call_args_list if words[0] == "stat"] == [["/read"]]


@pytest.mark.parametrize(("role", "path", "said"), [
    ("server", "db/etcd/member", {"data", "etcd"}), ("server", "db/state.db", {"data"}),
    ("agent", "db/etcd/member", set()), ("server", "cred/encryption-config.json", {"encrypts"}),
    ("agent", "cred/encryption-config.json", set()),
])  # fmt: skip
def test_which_datastore_a_server_has_and_whether_it_encrypts(
    tmp_path: Path, role: str, path: str, said: set[str]
) -> None:
    tree(tmp_path, {f"/var/lib/rancher/k3s/server/{path}": ""})
    found = _host_facts.k3s_facts(K3sHost(lambda _argv: (0, "", ""), str(tmp_path)), {**AGENT, "role": role})
    assert {key for key in ("data", "etcd", "encrypts") if found[key]} == said


@pytest.mark.parametrize(("role", "external", "data"), [
    ("server", True, True), ("server", False, False), ("agent", True, False),
])  # fmt: skip
def test_a_server_whose_datastore_is_elsewhere_has_joined_once_k3s_ran(
    tmp_path: Path, role: str, external: bool, data: bool
) -> None:
    host, asked = K3sHost(lambda _argv: (0, "", ""), str(tmp_path)), {**AGENT, "role": role, "external": external}
    assert not _host_facts.k3s_facts(host, asked)["data"]
    tree(tmp_path, {"/var/lib/rancher/k3s/server/token": "K10"})
    assert bool(_host_facts.k3s_facts(host, asked)["data"]) is data


@pytest.mark.parametrize(("state", "restarts", "ready"), [
    ("active", 0, True), ("active", 9, True), ("activating", 9, False), ("failed", 0, False),
])  # fmt: skip
def test_what_runs_now_is_ready_however_often_it_was_started_before(
    tmp_path: Path, state: str, restarts: int, ready: bool
) -> None:
    shown = f"LoadState=loaded\nActiveState={state}\nSubState=running\nNRestarts={restarts}\n"
    host = K3sHost(lambda argv: (0, shown if "show" in argv else "", ""), str(tmp_path))
    assert _host_facts.k3s_facts(host, AGENT)["ready"] is ready


@pytest.mark.parametrize(("joined", "authority", "foreign"), [
    (True, "another", True), (True, "its own", False), (True, "half of one", False), (False, "another", False),
])  # fmt: skip
def test_a_server_of_another_cluster_than_the_one_that_the_host_joined(
    tmp_path: Path, joined: bool, authority: str, foreign: bool
) -> None:
    """By the authority of its certificate, whatever names that has. What cannot be told is none."""
    server = start_server(tmp_path, "fleet")
    texts = {"another": certificate()[0], "its own": (tmp_path / "ca.crt").read_bytes(), "half of one": b"-----BEGIN"}
    agent = "/var/lib/rancher/k3s/agent"
    tree(tmp_path, {f"{agent}/server-ca.crt": texts[authority].decode()})
    if joined:
        tree(tmp_path, {f"{agent}/client-kubelet.crt": ""})
    asked = {**AGENT, "servers": [f"127.0.0.1:{server.server_address[1]}"]}
    try:
        found = _host_facts.k3s_facts(K3sHost(lambda _argv: (0, "", ""), str(tmp_path)), asked)
    finally:
        server.stop()
    assert (found["answering"], found["foreign"]) == (asked["servers"], asked["servers"] * foreign)


def test_who_says_nothing_of_a_certificate_is_waited_for_as_long_as_for_a_connection(
    tmp_path: Path, peers: Peers
) -> None:
    (tmp_path / "ca.crt").write_bytes(certificate()[0])
    assert _host_facts.knock("127.0.0.1", peers.hung(), 0.1, str(tmp_path / "ca.crt")) == "timeout"


@pytest.mark.parametrize(("days", "lapsed"), [(0, False), (350, False), (366, True)])
def test_a_certificate_that_ended_is_of_no_use_to_join_again(tmp_path: Path, days: int, lapsed: bool) -> None:
    """k3s writes it anew at each start of an agent."""
    host = K3sHost(lambda _argv: (0, "", ""), str(tmp_path))
    assert _host_facts.k3s_facts(host, AGENT)["lapsed"] is False
    certificate = tmp_path / "var/lib/rancher/k3s/agent/client-kubelet.crt"
    certificate.parent.mkdir(parents=True)
    certificate.write_text("x")
    issued = time.time() - days * 86400
    os.utime(certificate, (issued, issued))
    assert _host_facts.k3s_facts(host, AGENT)["lapsed"] is lapsed


@pytest.mark.parametrize(
    ("given", "kept", "known", "verdict"),
    [
        ("", "old", "old", "same"),
        ("new", "old", "old", "differs"),
        ("new", "new", "old", "same"),  # k3s did not start since: it is stale
        ("", "new", "old", "same"),
        ("", "", "old", "lost"),
        ("old", "", "old", "restore"),
        ("", "", "", "absent"),
    ],
)
def test_the_agents_token_may_change(tmp_path: Path, given: str, kept: str, known: str, verdict: str) -> None:
    for place, text in (("etc/rancher/k3s", kept), ("var/lib/rancher/k3s/server", known)):
        (tmp_path / place).mkdir(parents=True)
        (tmp_path / place / "agent-token").write_text(text)
    host = K3sHost(lambda _argv: (0, "", ""), str(tmp_path))
    found = _host_facts.k3s_facts(host, {**AGENT, "role": "server", "agent_token": given})
    assert found["tokens"] == {"server": "absent", "agent": verdict}
