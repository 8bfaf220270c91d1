# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs on a lab host: once a second the CPU time and memory of every pod and of the host, one JSON line each time.

From the cgroups, so that probes and hooks are in it: the kubelet runs them inside the pod. Standard library only; it
ends when nobody reads it any more. CPU in nanoseconds since the cgroup was made, memory in bytes without inactive
pages of files.
"""

from __future__ import annotations

import json
import os
import re
import sys
import time
from pathlib import Path

ROOT = "/sys/fs/cgroup"
POD = re.compile(r"pod([0-9a-f]{8}[-_][0-9a-f_-]{27})(?:\.slice)?$")
V2 = Path(ROOT, "cgroup.controllers").exists()


def text(path: str) -> str:
    with open(path) as file:  # noqa: PTH123 - once a second for every pod: as cheap as it can be
        return file.read()


def field(content: str, name: str) -> int:
    for line in content.splitlines():
        key, _space, value = line.partition(" ")
        if key == name:
            return int(value)
    return 0


def cpu(group: str) -> int:
    if V2:
        return field(text(f"{ROOT}{group}/cpu.stat"), "usage_usec") * 1000
    return int(text(f"{ROOT}/cpuacct{group}/cpuacct.usage"))


def memory(group: str) -> int:
    base = f"{ROOT}{group}" if V2 else f"{ROOT}/memory{group}"
    used = int(text(base + ("/memory.current" if V2 else "/memory.usage_in_bytes")))
    return used - field(text(base + "/memory.stat"), "inactive_file" if V2 else "total_inactive_file")


def pods() -> dict[str, str]:
    """Pod's uid -> its cgroup."""
    base = ROOT if V2 else ROOT + "/cpuacct"
    found = {}
    for top in ("kubepods", "kubepods.slice"):
        for directory, names, _files in os.walk(f"{base}/{top}"):
            for name in list(names):
                match = POD.search(name)
                if match:
                    found[match.group(1).replace("_", "-")] = f"{directory}/{name}"[len(base) :]
                    names.remove(name)  # its containers are in it
    return found


def sample() -> dict[str, object]:
    measured = {}
    for uid, group in pods().items():
        try:
            measured[uid] = [cpu(group), memory(group)]
        except OSError:
            continue  # it went away meanwhile
    return {"time": round(time.time(), 3), "host": [cpu(""), memory("")], "pods": measured}


def main() -> None:
    due = time.monotonic()
    while True:
        sys.stdout.write(json.dumps(sample(), separators=(",", ":")) + "\n")
        sys.stdout.flush()
        due += 1.0
        time.sleep(max(0.0, due - time.monotonic()))


if __name__ == "__main__":
    main()
