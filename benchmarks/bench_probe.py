# SPDX-License-Identifier: GPL-3.0-or-later
"""What ours costs a robot, beside real rospy nodes: at rest per part, and per call of a start and a stop.

    python benchmarks/bench_probe.py

Needs Debian's ROS 1 packages on this machine. CPU time, not wall time: it is what probes take from a robot, and
it hardly depends on what else runs. Without the container runtime's own part of an exec. The last line printed is the
result as JSON; the exit status is 1 where ours together costs more at rest than its limit (at_rest.py).
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

CHECKOUT = Path(__file__).resolve().parents[1]
sys.path[:0] = [
    str(CHECKOUT / ".ansible" / "collections"),
    *(str(CHECKOUT / "tests" / name) for name in ("ros", "tools")),
]

from at_rest import measure as measure_rest  # noqa: E402 - found through the lines above
from at_rest import report, verdict  # noqa: E402
from exporter_scene import ExporterScene  # noqa: E402
from pod_code import write_code  # noqa: E402
from scene import PYTHON, Scene, until  # noqa: E402

PUBLISHED = CHECKOUT / "benchmarks" / "update" / "results" / "at_rest.json"
MD5SUM = "1b2a79973e8bf53d7b53acb71299cb57"  # of std_msgs/UInt64
SETTINGS = {
    "expect_node": True, "handoff": "overlap", "actions": [], "stop_deadline": 5, "command": None, "min_rates": {},
    "keeper": None,
}  # fmt: skip


class Pod:
    """A node's name, its settings and the mounted code; calls are made as the kubelet makes them."""

    def __init__(self, scene: Scene, python: str) -> None:
        self.scene, self.python = scene, python
        self.name = f"bench_{scene.port}"
        self.hooks = scene.directory / "hooks"
        self.hooks.mkdir()
        self.given = "{}"
        write_code(self.hooks)

    def settings(self, contract: dict[str, Any] | None = None, **changes: Any) -> None:
        self.given = json.dumps({**SETTINGS, "node": "/bench", **changes})
        (self.hooks / "contract.json").write_text(json.dumps(contract or {}))

    def call(self, word: str) -> tuple[float, float, str]:
        """CPU seconds of the call with its children, wall seconds, and what it said."""
        env = {
            "PATH": os.environ["PATH"], "ROS_MASTER_URI": self.scene.uri, "ROSOPS_SETTINGS": self.given,
            "ROSOPS_NODE_NAME": self.name, "ROSOPS_REVISION": "0a1b2c3d",
        }  # fmt: skip
        began = time.monotonic()
        command = [self.python, "-I", "-S", str(self.hooks / "run.py"), word]
        process = subprocess.Popen(command, env=env, stdout=subprocess.PIPE, text=True)  # noqa: S603 - our own
        assert process.stdout is not None
        said = process.stdout.read().strip()
        _pid, _status, usage = os.wait4(process.pid, 0)
        return usage.ru_utime + usage.ru_stime, time.monotonic() - began, said


def measure(pod: Pod, word: str, trials: int, expected: str = "") -> dict[str, Any]:
    calls = [pod.call(word) for _trial in range(trials)]
    wrong = [said for _cpu, _wall, said in calls if not said.startswith(expected) or bool(said) != bool(expected)]
    if wrong:
        raise SystemExit(f"{word} said: {wrong[0]}")
    cpu, wall = [call[0] * 1000 for call in calls], [call[1] * 1000 for call in calls]
    return {
        "calls": trials,
        "cpu_ms_median": round(statistics.median(cpu), 1),
        "cpu_ms_max": round(max(cpu), 1),
        "wall_ms_median": round(statistics.median(wall), 1),
    }


def rows(scene: Scene, pod: Pod, trials: int) -> dict[str, dict[str, Any]]:
    node = f"/{pod.name}"
    scene.start_master()
    scene.start("listener", "/listener")
    scene.start("talker", node)
    pod.settings()
    until("the probe to pass", lambda: pod.call("started")[2] == "")
    found = {"started": measure(pod, "started", trials)}
    pod.settings(command=["/bin/sh", "-c", "test -d /"])
    found["started, with a command"] = measure(pod, "started", trials)
    pod.settings(min_rates={"/numbers": 450})
    found["started, with a rate of 500 Hz"] = measure(pod, "started", trials)
    pod.settings(contract={
        "revision": "0a1b2c3d", "tolerance": 0.1, "nodes": [node], "subscriptions": {}, "services": {}, "edges": [],
        "actions": [], "topics": {"/numbers": {"type": "std_msgs/UInt64", "md5sum": MD5SUM, "rate": 500.0}},
    })  # fmt: skip
    found["started, with a contract"] = measure(pod, "started", trials)
    (scratch := Path(f"/tmp/rosops-fleet-{os.getuid()}/{pod.name}.json")).unlink()  # noqa: S108
    pod.settings(command=["false"])
    found["started, first call in vain (10 s)"] = measure(pod, "started", 1, "not ready")
    found["started, later calls in vain (10 s)"] = measure(pod, "started", 1, "not ready")
    pod.settings()
    found["stop"] = measure(pod, "stop", 1)
    scratch.unlink(missing_ok=True)
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=10, help="calls per row")
    parser.add_argument("--seconds", type=float, default=60, help="how long to watch the robot at rest")
    parser.add_argument("--publish", action="store_true", help=f"keep the result in {PUBLISHED} for docs/benchmarks.md")
    parser.add_argument("--python", default=PYTHON, help="the pod's Python")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as directory:
        scene = Scene(Path(directory))
        try:
            found = rows(scene, Pod(scene, arguments.python), arguments.trials)
        finally:
            scene.end()
    with tempfile.TemporaryDirectory() as directory:
        robot = ExporterScene(Path(directory))
        try:
            rest = measure_rest(robot, arguments.seconds)
        finally:
            robot.end()
    total = verdict(rest)
    print(f"{'call':<38} {'calls':>5} {'CPU ms median':>14} {'max':>8} {'wall ms':>8}")
    for name, row in found.items():
        print(
            f"{name:<38} {row['calls']:>5} {row['cpu_ms_median']:>14} {row['cpu_ms_max']:>8} {row['wall_ms_median']:>8}"
        )
    print(f"\n{report(rest)}")
    version = subprocess.run([arguments.python, "-V"], capture_output=True, text=True, check=True).stdout.strip()  # noqa: S603
    parts = [row.as_dict() for row in rest["rows"]]
    result = {
        "calls": found,
        "rest": parts,
        **total,
        "earlier": round(rest["earlier"], 1),
        "python": version,
        "machine": platform.machine(),
    }
    result = {**result, "cores": os.cpu_count(), "load": round(os.getloadavg()[0], 1)}
    if arguments.publish:
        PUBLISHED.parent.mkdir(exist_ok=True)
        PUBLISHED.write_text(json.dumps(result, indent=1, sort_keys=True) + "\n")
    print(json.dumps(result))
    return 0 if total["passed"] else 1


if __name__ == "__main__":
    sys.exit(main())
