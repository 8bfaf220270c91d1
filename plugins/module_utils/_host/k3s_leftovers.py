# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a k3s leaves on a host beside its files: processes of pods, mounts, interfaces, firewall chains.

The functions decide from text what is k3s's own; nothing else may be touched, whatever else runs on the robot.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Iterable

from .files import UNIT_CGROUP

# A pod's processes are children of a shim that serves k3s's own containerd; one of Docker has another socket.
SHIM = re.compile(r"containerd-shim\S*\s.*-address\s+/run/k3s/containerd/")
MOUNTS = re.compile(r"^(/run/k3s|/var/lib/rancher/k3s|/var/lib/kubelet|/run/netns/cni-)")
OPERATORS_MOUNTS = ("/var/lib/rancher/k3s", "/var/lib/rancher/k3s/storage", "/var/lib/kubelet", "/run/k3s")
INTERFACES = ("cni0", "flannel.1", "flannel-wg", "flannel-wg-v6", "flannel-v6.1", "kube-ipvs0", "kube-bridge")
CHAINS = re.compile(r"\b(KUBE-|CNI-|FLANNEL-|flannel|cni0|kube-router)")


@dataclass(frozen=True)
class Process:
    """What /proc says about one."""

    pid: int
    parent: int
    command: str
    cgroup: str


def own_processes(processes: Iterable[Process]) -> list[int]:
    """What is left in the units' cgroups, the pods' shims and everything below them, children before parents."""
    listed = sorted(processes, key=lambda process: process.pid)
    children: dict[int, list[int]] = {}
    for process in listed:
        children.setdefault(process.parent, []).append(process.pid)
    order: list[int] = []
    stack = [process.pid for process in listed if _is_k3s(process)]
    while stack:
        pid = stack.pop()
        if pid in order:
            order.remove(pid)  # a child that was met by itself before: it goes before its parent
        order.append(pid)
        stack.extend(children.get(pid, []))
    return order[::-1]


def in_pods(processes: Iterable[Process]) -> list[int]:
    """Of these the ones in containers: they get the time that a pod has to stop. A shim is nobody's to ask."""
    listed = list(processes)
    known = {process.pid: process for process in listed}
    return [pid for pid in own_processes(listed) if not _is_k3s(known[pid])]


def _is_k3s(process: Process) -> bool:
    return bool(SHIM.search(process.command) or UNIT_CGROUP.search(process.cgroup))


def own_mounts(mounts: str) -> list[str]:
    """Mount points of k3s and its pods out of /proc/self/mounts, the innermost first."""
    # what may have been mounted for k3s before it came stays: that is the operator's
    found = [point for point in _points(mounts) if MOUNTS.match(point) and point not in OPERATORS_MOUNTS]
    return sorted(found, key=lambda point: (point.count("/"), point), reverse=True)


def own_interfaces(links: Iterable[tuple[str, str]]) -> list[str]:
    """Interfaces to delete. `links`: (name, name of its bridge). A pod's end of a pair goes with its bridge cni0."""
    names = [name for name, bridge in links if name in INTERFACES or (name.startswith("veth") and bridge == "cni0")]
    return sorted(names, key=lambda name: (not name.startswith("veth"), name))


def without_own_rules(saved: str) -> str:
    """`iptables-save`'s output without Kubernetes' and CNI's chains and rules; everybody else's stay as they are."""
    return "".join(line for line in saved.splitlines(keepends=True) if line.startswith("#") or not CHAINS.search(line))


def mounts_below(mounts: str, directory: str) -> list[str]:
    """What is still mounted below a directory. Deleting would reach through it, into data that is elsewhere."""
    return [point for point in _points(mounts) if point.startswith(directory.rstrip("/") + "/")]


def _points(mounts: str) -> list[str]:
    return [line.split()[1].replace("\\040", " ") for line in mounts.splitlines() if len(line.split()) > 1]


def has_own_rules(saved: str) -> bool:
    return any(CHAINS.search(line) for line in saved.splitlines() if not line.startswith("#"))
