# SPDX-License-Identifier: GPL-3.0-or-later
"""The machine and the versions that the figures are from."""

from __future__ import annotations

import os
import platform
import re
import shlex
import subprocess
import time
from pathlib import Path
from typing import Any

from .cluster import EDGE, NICE, ROBOT, Cluster
from .cores import CONTROL_CORES, ROBOT_CORES, listed


def about(cluster: Cluster) -> dict[str, Any]:
    """Name and version of everything that a figure may hang on."""
    cpuinfo = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    meminfo = Path("/proc/meminfo").read_text(encoding="utf-8")
    model = re.search(r"^model name\s*:\s*(.+)$", cpuinfo, re.MULTILINE)
    total = re.search(r"^MemTotal:\s*(\d+) kB", meminfo, re.MULTILINE)
    return {
        "machine": f"{model.group(1) if model else platform.machine()}, {os.cpu_count()} cores, "
        f"{int(total.group(1)) / 1024**2 if total else 0:.0f} GiB",
        "kernel": platform.release(),
        "system": _system(),
        "k3s": cluster.ssh(EDGE, "k3s --version | head -n 1").decode().strip(),
        "containerd": cluster.ssh(ROBOT, "containerd --version").decode().strip(),
        "ros": _ros(cluster),
        "ansible": _first(["ansible", "--version"], cluster),
        "collection": _first(["git", "-C", str(cluster.checkout), "describe", "--always", "--dirty"], cluster),
        "hosts": f"{EDGE} and {ROBOT}: containers on this machine, which is the control node as well "
        f"(its own processes at nice {NICE}, in both arms); {ROBOT} on core {listed(ROBOT_CORES)}, all else on "
        f"{listed(CONTROL_CORES)}",
        "load_before": round(os.getloadavg()[0], 2),
        "date": time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime()),
    }


def _system() -> str:
    release = platform.freedesktop_os_release()
    return release.get("PRETTY_NAME", "unknown")


def _first(words: list[str], cluster: Cluster) -> str:
    done = subprocess.run(words, env=cluster.environment, capture_output=True, text=True, check=False)  # noqa: S603 - our own
    return done.stdout.splitlines()[0].strip() if done.returncode == 0 and done.stdout else "unknown"


def _ros(cluster: Cluster) -> str:
    """From a running master's pod, of either arm; the image's own packages."""
    script = "dpkg-query -W -f '${Package} ${Version}, ' python3-rospy libroscpp4d python3-actionlib 2>/dev/null"
    for namespace in ("plain", f"robot-{ROBOT}"):
        said = cluster.kubectl(f"-n {namespace} exec deployment/ros-master -- sh -c {shlex.quote(script)}", check=False)
        if said:
            return said.strip().rstrip(", ")
    return "unknown"
