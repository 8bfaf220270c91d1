# SPDX-License-Identifier: GPL-3.0-or-later
"""Take k3s off a host, in an order that leaves nothing running on what goes next.

The functions decide from text what of the processes, mounts, interfaces and firewall chains is k3s's own; nothing else
may be touched, whatever else runs on the robot.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
import time
from pathlib import Path
from typing import Any, Callable, Iterable, NamedTuple

from .._common.errors import FleetError
from .._common.poll import PASS, WAIT, Seen, poll
from . import k3s
from .k3s import K3sHost, Run

UNITS = tuple(k3s.SERVICES.values())
# the binary, the one before it, one that was to come, what a download that was cut off has left of one
BINARIES = tuple(f"{k3s.BINARY}{kept}" for kept in (".next", ".next.part", ".part", ".previous", ""))
LINKS = ("/usr/local/bin/kubectl", "/usr/local/bin/crictl", "/usr/local/bin/ctr")
STORAGE = "storage"
OURS = (
    "/run/rosops-fleet-k3s.started",
    "/run/rosops-fleet-k3s-agent.started",
    "/var/lib/rosops-fleet/log-shipper",
    "/var/lib/rosops-fleet/k3s-change.json",
    "/var/lib/rancher/rosops-fleet-images.tar",  # an archive whose transfer was cut off
    *(f"{k3s.UNIT_DIRECTORY}/{unit}.service{kept}" for unit in UNITS for kept in (".next", ".previous")),
    *(f"{k3s.SYSCTLS}{kept}" for kept in ("", ".next", ".previous")),
    k3s.NEIGHBOURS,
)
# Other Kubernetes have these places, too, and other container engines the directories around them. So they go only from
# a host on which k3s is, and before what shows that it is: a removal that was cut off is gone on with.
PLACES = (
    "/run/k3s", "/run/flannel", "/var/lib/kubelet", "/var/lib/cni/flannel", "/var/lib/cni/networks/cbr0",
    "/var/log/pods", "/var/log/containers",
)  # fmt: skip
CNI_RESULTS = "/var/lib/cni/results"
IDENTITY = "/etc/rancher/node"
STOP_TIMEOUT = 30.0  # what a pod has to stop by itself if it says nothing
END_TIMEOUT = 10.0
# A pod's processes are children of a shim that serves k3s's own containerd; one of Docker has another socket.
SHIM = re.compile(r"containerd-shim\S*\s.*-address\s+/run/k3s/containerd/")
MOUNTS = re.compile(r"^((/run/k3s|/var/lib/rancher/k3s|/var/lib/kubelet)/|/run/netns/cni-)")
OPERATORS_MOUNTS = ("/var/lib/rancher/k3s", "/var/lib/rancher/k3s/storage", "/var/lib/kubelet", "/run/k3s")
INTERFACES = ("cni0", "flannel.1", "flannel-wg", "flannel-wg-v6", "flannel-v6.1", "kube-ipvs0", "kube-bridge")
CHAINS = re.compile(r"\b(KUBE-|CNI-|FLANNEL-|flannel|cni0|kube-router)")


class Process(NamedTuple):
    """What /proc says about one."""

    pid: int
    parent: int
    command: str
    cgroup: str


def own_processes(processes: Iterable[Process]) -> dict[int, bool]:
    """What is left in the units' cgroups, the pods' shims and everything below them, the youngest first.

    Of each whether it is in a container: these get the time that a pod has to stop. A shim is nobody's to ask.
    """
    listed = list(processes)
    engines = {one.pid for one in listed if SHIM.search(one.command) or k3s.UNIT_CGROUP.search(one.cgroup)}
    found = set(engines)
    while below := {one.pid for one in listed if one.parent in found} - found:
        found |= below
    return {pid: pid not in engines for pid in sorted(found, reverse=True)}


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
    return "".join(line for line in saved.splitlines(keepends=True) if not CHAINS.search(line))


def _points(mounts: str) -> list[str]:
    return [line.split()[1].replace("\\040", " ") for line in mounts.splitlines() if len(line.split()) > 1]


class Remover(K3sHost):
    """Every step returns what it found; with `dry` that is all it does."""

    def __init__(self, run: Run, find: Callable[[str], str | None], dry: bool, root: str = "/") -> None:
        super().__init__(run, root)
        self.find, self.dry = find, dry
        self.kill: Callable[[int, int], None] = os.kill
        self.now, self.sleep = time.monotonic, time.sleep

    def everything(self, volumes: bool, identity: bool) -> dict[str, list[Any]]:
        installed = self.installed()
        return {
            "units": self.units(),
            "processes": self.processes(),
            "mounts": self.mounts(),
            "interfaces": self.interfaces(),
            "firewalls": self.firewalls(),
            "paths": self.paths(volumes, identity, installed),
        }

    def units(self) -> list[str]:
        """Stop and delete the units: nothing may start a pod again."""
        found = [unit for unit in UNITS if self.path(f"{k3s.UNIT_DIRECTORY}/{unit}.service").exists()]
        for unit in found if not self.dry else []:
            self.must("systemctl", "disable", "--now", f"{unit}.service")
            self.path(f"{k3s.UNIT_DIRECTORY}/{unit}.service").unlink()
        if found and not self.dry:
            self.must("systemctl", "daemon-reload")
        return found

    def installed(self) -> bool:
        """Whether k3s is on this host, or what a removal that was cut off has left of it."""
        signs = [*(f"{k3s.UNIT_DIRECTORY}/{unit}.service" for unit in UNITS), k3s.CONFIG_DIR, k3s.BINARY]
        return any(self.path(name).exists() for name in signs) or bool(self.data_paths(volumes=False))

    def running(self) -> list[Process]:
        listed = []
        for entry in (entry for entry in self.path("/proc").iterdir() if entry.name.isdigit()):
            try:
                texts = [(entry / name).read_bytes() for name in ("stat", "cmdline", "cgroup")]
            except OSError:
                continue  # ended while we looked
            stat, command, cgroup = (text.decode("utf-8", "replace") for text in texts)
            parent = int(stat.rpartition(")")[2].split()[1])
            listed.append(Process(int(entry.name), parent, command.replace("\0", " "), cgroup))
        return listed

    def processes(self) -> list[int]:
        """End the pods' processes and wait until they are gone: they hold mounts.

        Each is asked once, and has the time that a pod has: a robot that moves may have to come to rest.
        """
        found = own_processes(self.running())
        if not found or self.dry:
            return list(found)

        def stop() -> Seen:
            return Seen(WAIT if any(own_processes(self.running()).values()) else PASS)

        self.send((pid for pid, in_pod in found.items() if in_pod), signal.SIGTERM)
        poll(stop, STOP_TIMEOUT, 0.1, now=self.now, sleep=self.sleep)

        def end() -> Seen:
            left = list(own_processes(self.running()))
            self.send(left, signal.SIGKILL)
            return Seen(WAIT if left else PASS, left)

        polled = poll(end, END_TIMEOUT, 0.1, now=self.now, sleep=self.sleep)
        if polled.verdict != PASS:
            raise FleetError(f"processes {polled.last} do not end")
        return list(found)

    def send(self, processes: Iterable[int], number: int) -> None:
        for pid in processes:
            with contextlib.suppress(ProcessLookupError):
                self.kill(pid, number)

    def mounts(self) -> list[str]:
        found = own_mounts(self.path("/proc/self/mounts").read_text(encoding="utf-8"))
        for point in found if not self.dry else []:
            code = self.run(["umount", point])[0]
            if code != 0:
                # A network volume whose server is away never lets go; detached, nothing below it can be deleted.
                self.must("umount", "--lazy", point)
        return found

    def interfaces(self) -> list[str]:
        links = []
        for name in self.names("/sys/class/net"):
            master = self.path(f"/sys/class/net/{name}/master")
            links.append((name, os.readlink(str(master)).rpartition("/")[2] if master.exists() else ""))
        found = own_interfaces(links)
        for name in found if not self.dry else []:
            code, out, err = self.run(["ip", "link", "delete", name])
            # The kernel takes a pod's interface away by itself some time after the pod's end; both may meet.
            if code != 0 and self.path(f"/sys/class/net/{name}").exists():
                raise FleetError(f"ip link delete {name}: {(err or out).strip()}")
        return found

    def firewalls(self) -> list[str]:
        found = []
        for family in ("iptables", "ip6tables"):
            save = self.find(f"{family}-save")
            if not save:
                continue  # k3s then used its own copy of the tools, and the rules end with the next boot
            code, rules, _err = self.run([save])
            others = without_own_rules(rules)
            if code != 0 or others == rules:
                continue
            found.append(family)
            if not self.dry:
                self.must(f"{save[: -len('-save')]}-restore", data=others)
        return found

    def paths(self, volumes: bool, identity: bool, installed: bool) -> list[str]:
        # what the CNI plugins remember of k3s's network; that of other engines is beside it
        results = [f"{CNI_RESULTS}/{name}" for name in self.names(CNI_RESULTS) if name.startswith("cbr0-")]
        found = [name for name in [*OURS, *([*PLACES, *results] if installed else [])] if self.removable(name)]
        links = [name for name in LINKS if self.path(name).is_symlink()]
        found += [name for name in links if Path(os.readlink(str(self.path(name)))).name == "k3s"]
        found += self.data_paths(volumes)
        found += [name for name in (k3s.CONFIG_DIR, *BINARIES) if self.removable(name)]
        if identity and self.path(IDENTITY).exists():
            found.append(IDENTITY)
        for name in found if not self.dry else []:
            self.delete(name)
        return found

    def removable(self, name: str) -> bool:
        """Whether it is there; a place of the operator's counts only with something in it."""
        return bool(self.names(name)) if self.kept_by_operator(name) else self.exists(name)

    def data_paths(self, volumes: bool) -> list[str]:
        """The data directory piece by piece if the volumes' place stays, so that what stays is never touched."""
        names = self.names(k3s.DATA_DIR)
        if STORAGE in names and (not volumes or self.kept_by_operator(f"{k3s.DATA_DIR}/{STORAGE}")):
            places = [f"{k3s.DATA_DIR}/{name}" for name in names if volumes or name != STORAGE]
            return [place for place in places if self.removable(place)]
        return [k3s.DATA_DIR] if self.removable(k3s.DATA_DIR) else []

    def kept_by_operator(self, name: str) -> bool:
        """Whether it is a mount point of the operator's, or his link to another disk: emptied, not deleted."""
        return name in OPERATORS_MOUNTS and (self.path(name).is_mount() or self.path(name).is_symlink())

    def delete(self, name: str) -> None:
        path, kept = self.path(name), self.kept_by_operator(name)
        if not kept and (path.is_symlink() or not path.is_dir()):
            path.unlink()
            return
        # what is still mounted below, deleting would reach through, into data that is elsewhere
        points = _points(self.path("/proc/self/mounts").read_text(encoding="utf-8"))
        below = [point for point in points if point.startswith(f"{name}/") and point not in OPERATORS_MOUNTS]
        if below:
            raise FleetError(f"{', '.join(below)} is still mounted below {name}")
        if kept:
            for entry in path.iterdir():
                self.delete(f"{name}/{entry.name}")
            return
        shutil.rmtree(str(path))
