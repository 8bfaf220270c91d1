# SPDX-License-Identifier: GPL-3.0-or-later
"""What pods hold in memory: by their cgroups and by their processes, read on the hosts."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from typing import Any, NamedTuple

# Runs on the host: the processes of each pod with their resident memory, and what each pod's cgroup counts: its working
# set, which is what the kubelet acts upon (all that is charged, less file pages that could go at once).
LOOK = r"""
import json, pathlib, re
def read(path):
    try:
        return pathlib.Path(path).read_text()
    except OSError:
        return ""
def pod_of(text):
    found = re.search(r"pod([0-9a-f]{8}[-_][0-9a-f_-]{27})", text)
    return found.group(1).replace("_", "-") if found else ""
pods = {}
for process in pathlib.Path("/proc").glob("[0-9]*"):
    pod = pod_of(read(process / "cgroup"))
    status = dict(line.split(":", 1) for line in read(process / "status").splitlines() if ":" in line)
    if pod and "VmRSS" in status:
        one = pods.setdefault(pod, {"rss": 0, "own": 0})
        one["rss"] += int(status["VmRSS"].split()[0]) * 1024
        one["own"] += (int(status["RssAnon"].split()[0]) + int(status["RssShmem"].split()[0])) * 1024
for kind in ("memory.stat", "memory.current"):
    for path in pathlib.Path("/sys/fs/cgroup").glob("**/kubepods*/**/" + kind):
        if path.parent.name.count("pod") and pod_of(path.parent.name) in pods:
            one = pods[pod_of(path.parent.name)]
            stat = dict(line.split() for line in read(path.parent / "memory.stat").splitlines())
            used = read(path.parent / "memory.current") or read(path.parent / "memory.usage_in_bytes")
            if used.strip():
                idle = int(stat.get("total_inactive_file", stat.get("inactive_file", 0)))
                one["cgroup"] = int(used) - idle
print(json.dumps(pods))
"""


class Held(NamedTuple):
    """Bytes of one pod. `rss` is what `ps` shows. `own` of it is the processes' own; the rest are pages of programs and
    libraries as they are on disk, which the kernel drops when somebody needs the room."""

    namespace: str
    pod: str
    app: str
    cgroup: int
    rss: int
    own: int


def parse(text: str, pods: Iterable[Any]) -> list[Held]:
    """What LOOK printed, with the names that the API has for the pods."""
    known = {}
    for pod in pods:
        # a mirror pod's files and cgroups carry the UID of the file that it comes from
        known[(pod.metadata.annotations or {}).get("kubernetes.io/config.mirror", pod.metadata.uid)] = pod
        known[pod.metadata.uid] = pod
    found = []
    for uid, seen in json.loads(text).items():
        pod = known.get(uid)
        if pod is not None:
            labels = pod.metadata.labels or {}
            app = labels.get("rosops.fleet/app", re.sub(r"-[a-z0-9]+(-[a-z0-9]{5})?$", "", pod.metadata.name))
            bytes_of = (int(seen.get(key, 0)) for key in Held._fields[3:])
            found.append(Held(pod.metadata.namespace, pod.metadata.name, app, *bytes_of))
    return sorted(found)


def said(what: str, *sums: int) -> str:
    """For people."""
    cgroup, rss, own = (size / 1e6 for size in sums)
    return f"{what:<16} cgroup {cgroup:6.1f} MB   own {own:6.1f} MB   RSS {rss:6.1f} MB"
