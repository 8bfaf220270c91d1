# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What of a host stands between pods and their network: firewalls, SELinux, kernel modules. Reads only; judges nothing.

Runs on the host: Python 3.8 and the standard library.
"""

from __future__ import annotations

import os
import re

from .facts import Facts
from .files import Host

# flannel's overlay, and the sets of k3s's network policies
MODULES = ("vxlan", "ip_set")
POLICIES = ("/usr/share/selinux/packages/k3s.pp", "/etc/selinux/targeted/active/modules/200/k3s")
UFW_ON = re.compile(r"^ENABLED=yes\b", re.MULTILINE)


def network(host: Host) -> Facts:
    """`firewalls` that are on, `selinux` (mode, and whether k3s's policy is there), `lacking` kernel modules."""
    return {"firewalls": firewalls(host), "selinux": selinux(host), "lacking": lacking(host, os.uname().release)}


def firewalls(host: Host) -> list[str]:
    """Those that drop what nobody allowed."""
    found = ["ufw"] if UFW_ON.search(host.read("/etc/ufw/ufw.conf")) else []
    for pid in (name for name in host.names("/proc") if name.isdigit()):
        # a Python program: its name alone says python3
        if "firewalld" in (host.read(f"/proc/{pid}/comm").strip(), *_words(host, pid)):
            return [*found, "firewalld"]
    return found


def _words(host: Host, pid: str) -> list[str]:
    try:
        text = host.path(f"/proc/{pid}/cmdline").read_bytes().decode("utf-8", "replace")
    except OSError:
        return []
    return [word.rpartition("/")[2] for word in text.split("\0")[:3]]


def selinux(host: Host) -> Facts:
    mode = {"1": "enforcing", "0": "permissive"}.get(host.read("/sys/fs/selinux/enforce").strip(), "")
    return {"mode": mode, "policy": any(host.exists(name) for name in POLICIES)}


def lacking(host: Host, release: str) -> list[str]:
    """Modules that the kernel neither has nor could load. Without a list of what it has nothing is known to lack."""
    lists = [host.read(f"/lib/modules/{release}/{name}") for name in ("modules.dep", "modules.builtin")]
    if not any(lists):
        return []
    known = "\n".join(lists)
    return [
        name for name in MODULES if not host.exists(f"/sys/module/{name}") and not re.search(rf"/{name}\.ko\b", known)
    ]
