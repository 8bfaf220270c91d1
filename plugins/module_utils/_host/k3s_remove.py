# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Take k3s off a host, in an order that leaves nothing running on what goes next.

Runs on the host: Python 3.8 and the standard library. What belongs to k3s is decided in `_k3s_cleanup`.
"""

from __future__ import annotations

import os
import shutil
import signal
from pathlib import Path
from typing import Any, Callable

from .._common.errors import FleetError
from .._common.poll import PASS, WAIT, Seen, poll
from .k3s_leftovers import (
    OPERATORS_MOUNTS,
    Process,
    has_own_rules,
    mounts_below,
    own_interfaces,
    own_mounts,
    own_processes,
    without_own_rules,
)

UNITS = ("k3s", "k3s-agent")
UNIT_DIR = "/etc/systemd/system"
BINARY = "/usr/local/bin/k3s"
LINKS = ("/usr/local/bin/kubectl", "/usr/local/bin/crictl", "/usr/local/bin/ctr")
DATA = "/var/lib/rancher/k3s"
STORAGE = "storage"
PATHS = (
    "/run/k3s",
    "/run/flannel",
    "/run/rosops-fleet-k3s.started",
    "/run/rosops-fleet-k3s-agent.started",
    "/var/lib/kubelet",
    "/var/lib/cni",
    "/var/log/pods",
    "/var/log/containers",
    "/etc/rancher/k3s",
    BINARY,
)
IDENTITY = "/etc/rancher/node"
END_TIMEOUT = 10.0


class Remover:
    """Every step returns what it found; with `dry` that is all it does."""

    def __init__(self, run: Callable[..., Any], find: Callable[[str], str | None], dry: bool, root: str = "/") -> None:
        self.run = run
        self.find = find
        self.dry = dry
        self.root = Path(root)

    def everything(self, volumes: bool, identity: bool) -> dict[str, list[Any]]:
        units = self.units()
        removed: dict[str, list[Any]] = {
            "units": units,
            "processes": self.processes(),
            "mounts": self.mounts(),
            "interfaces": self.interfaces(),
            "firewalls": self.firewalls(),
            "paths": self.paths(volumes, identity),
        }
        if units and not self.dry:
            self.must("systemctl", "daemon-reload")
        return removed

    def path(self, name: str) -> Path:
        return self.root / name.lstrip("/")

    def must(self, *command: str, data: str | None = None) -> str:
        code, out, err = self.run(list(command), data=data)
        if code != 0:
            raise FleetError(f"{' '.join(command)}: {(err or out).strip()}")
        return str(out)

    def units(self) -> list[str]:
        """Stop and delete the units: nothing may start a pod again."""
        found = [unit for unit in UNITS if self.path(f"{UNIT_DIR}/{unit}.service").exists()]
        for unit in found if not self.dry else []:
            self.must("systemctl", "disable", "--now", f"{unit}.service")
            self.path(f"{UNIT_DIR}/{unit}.service").unlink()
        return found

    def running(self) -> list[int]:
        listed = []
        for entry in (entry for entry in self.path("/proc").iterdir() if entry.name.isdigit()):
            try:
                parent = int(
                    (entry / "stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()[1]
                )
                command = (entry / "cmdline").read_text(encoding="utf-8", errors="replace").replace("\0", " ")
                cgroup = (entry / "cgroup").read_text(encoding="utf-8", errors="replace")
            except OSError:
                continue  # ended while we looked
            listed.append(Process(int(entry.name), parent, command, cgroup))
        return own_processes(listed)

    def processes(self) -> list[int]:
        """End the pods' processes and wait until they are gone: they hold mounts."""
        found = self.running()
        if not found or self.dry:
            return found

        def end() -> Seen:
            left = self.running()
            for pid in left:
                try:
                    os.kill(pid, signal.SIGKILL)
                except ProcessLookupError:
                    continue
            return Seen(WAIT if left else PASS, left)

        polled = poll(end, END_TIMEOUT, 0.1)
        if polled.verdict != PASS:
            raise FleetError(f"processes {polled.last} do not end")
        return found

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
        for entry in sorted(self.path("/sys/class/net").iterdir()):
            master = entry / "master"
            links.append((entry.name, os.readlink(str(master)).rpartition("/")[2] if master.exists() else ""))
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
            if code != 0 or not has_own_rules(rules):
                continue
            found.append(family)
            if not self.dry:
                self.must(f"{save[: -len('-save')]}-restore", data=without_own_rules(rules))
        return found

    def paths(self, volumes: bool, identity: bool) -> list[str]:
        found = [name for name in PATHS if self.removable(name)]
        found += [name for name in LINKS if self.links_to_k3s(name)]
        found += self.data_paths(volumes)
        if identity and self.path(IDENTITY).exists():
            found.append(IDENTITY)
        for name in found if not self.dry else []:
            self.delete(name)
        return found

    def removable(self, name: str) -> bool:
        """Whether it is there; a mount point of the operator's counts only with something in it."""
        path = self.path(name)
        return any(path.iterdir()) if self.kept_by_operator(name) else os.path.lexists(str(path))

    def links_to_k3s(self, name: str) -> bool:
        path = self.path(name)
        return path.is_symlink() and Path(os.readlink(str(path))).name == "k3s"

    def data_paths(self, volumes: bool) -> list[str]:
        """The data directory piece by piece if the volumes stay, so that theirs is never touched."""
        data = self.path(DATA)
        if not data.exists():
            return []
        names = sorted(entry.name for entry in data.iterdir())
        if not volumes and STORAGE in names:
            return [f"{DATA}/{name}" for name in names if name != STORAGE]
        return [DATA] if self.removable(DATA) else []

    def kept_by_operator(self, name: str) -> bool:
        """Whether it is a mount point of the operator's: emptied, not deleted."""
        return name in OPERATORS_MOUNTS and self.path(name).is_mount()

    def delete(self, name: str) -> None:
        path = self.path(name)
        if path.is_symlink() or not path.is_dir():
            path.unlink()
            return
        below = [
            point
            for point in mounts_below(self.path("/proc/self/mounts").read_text(encoding="utf-8"), name)
            if point not in OPERATORS_MOUNTS
        ]
        if below:
            raise FleetError(f"{', '.join(below)} is still mounted below {name}")
        if self.kept_by_operator(name):
            for entry in path.iterdir():
                self.delete(f"{name}/{entry.name}")
            return
        shutil.rmtree(str(path))
