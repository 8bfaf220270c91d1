# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Firewalls, SELinux and kernel modules, out of the trees of several machines."""

from __future__ import annotations

from pathlib import Path

from ansible_collections.rosops.fleet.plugins.module_utils._host import network_facts
from ansible_collections.rosops.fleet.plugins.module_utils._host.files import Host
from ansible_collections.rosops.fleet.tests.unit.plugins.module_utils._host.host_tree import tree


def test_a_bare_tree_has_nothing(tmp_path: Path) -> None:
    expected = {"firewalls": [], "selinux": {"mode": "", "policy": False}, "lacking": []}
    assert network_facts.network(Host(str(tmp_path))) == expected


def test_firewalls_that_are_on(tmp_path: Path) -> None:
    off = tree(tmp_path / "off", {"/etc/ufw/ufw.conf": "# ENABLED=yes\nENABLED=no\n", "/proc/7/comm": "python3\n",
                                  "/proc/7/cmdline": "python3\0/usr/bin/other\0"})  # fmt: skip
    assert network_facts.firewalls(off) == []
    both = tree(tmp_path / "on", {"/etc/ufw/ufw.conf": "ENABLED=yes\n", "/proc/7/comm": "python3\n",
                                  "/proc/7/cmdline": "/usr/bin/python3\0-s\0/usr/sbin/firewalld\0"})  # fmt: skip
    assert network_facts.firewalls(both) == ["ufw", "firewalld"]


def test_selinux(tmp_path: Path) -> None:
    fedora = tree(tmp_path, {"/sys/fs/selinux/enforce": "1", "/usr/share/selinux/packages/k3s.pp": ""})
    assert network_facts.selinux(fedora) == {"mode": "enforcing", "policy": True}
    assert network_facts.selinux(tree(tmp_path, {"/sys/fs/selinux/enforce": "0"}))["mode"] == "permissive"


def test_modules(tmp_path: Path) -> None:
    jetson = {
        "/lib/modules/6.1/modules.dep": "kernel/net/ipv4/netfilter/x.ko:\nkernel/net/ip_set.ko.xz: a\n",
        "/lib/modules/6.1/modules.builtin": "kernel/net/not_vxlan.ko\n",
    }
    host = tree(tmp_path, jetson)
    assert network_facts.lacking(host, "6.1") == ["vxlan"]
    assert network_facts.lacking(host, "6.2") == []  # a container has no list of its host's
    assert network_facts.lacking(tree(tmp_path, {"/sys/module/vxlan/refcnt": "0"}), "6.1") == []
