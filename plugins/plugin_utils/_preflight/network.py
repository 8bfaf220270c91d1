# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What of a host may keep its pods from those of others, though its Node is Ready. Pure."""

from __future__ import annotations

from collections.abc import Iterable

from ...module_utils._common.documents import Result
from .finding import Finding, warning
from .requirements import Requirements

PORTS = {
    "server": "6443/tcp (API), 10250/tcp (kubelet), 8472/udp (flannel), with several servers 2379-2380/tcp (etcd)",
    "agent": "10250/tcp (kubelet, from the servers), 8472/udp (flannel, from all nodes)",
}
NETWORKS = "10.42.0.0/16 and 10.43.0.0/16"
ALLOW = {
    "firewalld": "firewall-cmd --permanent --zone=trusted --add-source=10.42.0.0/16 --add-source=10.43.0.0/16, "
    "--add-port for each of the ports, then firewall-cmd --reload; or systemctl disable --now firewalld",
    "ufw": "ufw allow from 10.42.0.0/16, ufw allow from 10.43.0.0/16, ufw allow for each of the ports; or ufw disable",
}
WITHOUT = {
    "vxlan": "flannel cannot connect the pods of different nodes",
    "ip_set": "NetworkPolicies are not enforced",
}


def network_findings(facts: Result, requirements: Requirements) -> Iterable[Finding]:
    """`facts` are the host's; warnings only: what a firewall lets through is not seen from here."""
    network, role = facts["network"], requirements.role
    for firewall in network["firewalls"]:
        yield warning(
            f"{firewall} is on; a k3s {role} needs {PORTS[role]}, and its pods and services {NETWORKS}",
            "/etc/ufw/ufw.conf" if firewall == "ufw" else "/proc",
            ALLOW[firewall],
        )
    selinux = network["selinux"]
    if selinux["mode"] == "enforcing" and not selinux["policy"]:
        yield warning(
            "SELinux is enforcing, and k3s's policy is not there: containers may be denied their files",
            "/sys/fs/selinux/enforce",
            "install the packages container-selinux and k3s-selinux, and set k3s_config: {selinux: true}",
        )
    for module in network["lacking"]:
        yield warning(
            f"the kernel has no module {module}: {WITHOUT[module]}",
            f"/lib/modules/{facts['kernel']}",
            "on Ubuntu for the Raspberry Pi: apt install linux-modules-extra-raspi; elsewhere a kernel that has it"
            + (", or k3s_config: {flannel-backend: host-gw} on the servers" if module == "vxlan" else ""),
        )
    interfaces = list(dict.fromkeys(route["interface"] for route in facts["routes"] if route["family"] == 4))
    if len(interfaces) > 1 and not requirements.interface:
        yield warning(
            f"there are default routes by {' and '.join(interfaces)}: pods go by {interfaces[0]}, or by another one "
            "when k3s starts while that is down",
            "/proc/net/route",
            "say by which one the robot reaches the others: k3s_config: {flannel-iface: NAME}, and k3s_node_ip",
        )
