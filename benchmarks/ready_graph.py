# SPDX-License-Identifier: GPL-3.0-or-later
# ruff: noqa: PLC0415, S603 - only the nodes need ROS's Python; every command line is our own
"""The part of bench_ready.py that runs where ROS is: 20 rospy nodes, and ros_ready against them.

A module run is `python3 -m` of the module with its options on standard input, a process of its own as on a robot;
what Ansible adds (SSH, the transfer) is not in it. `elapsed` is what the module itself reports.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time
import xmlrpc.client
from collections.abc import Callable
from pathlib import Path
from typing import Any

CHECKOUT = Path(__file__).resolve().parents[1]
COLLECTIONS = CHECKOUT / ".ansible" / "collections"
MODULE = "ansible_collections.rosops.fleet.plugins.modules.ros_ready"
ME = "/bench"
PAIRS = 8  # publisher and subscriber each; with a service, an action server, and two more: 20 nodes
INTERVAL = 0.5
COLUMNS = {"elapsed_median": 9, "elapsed_max": 7, "process_median": 9, "process_max": 7, "cpu_median": 7}
LIMITS = {"live": 0.5, "three hung": 3.0, "true to return": INTERVAL + 0.2}

# The module's own time and the delay are limited run by run. A process also has to start: on a busy machine one of many
# starts late, which says nothing of the module, so of the processes it is the median.
LIMITED = ("elapsed_max", "process_median", "delay_max")


# ---- nodes, each a process of its own: `ready_graph.py node KIND NUMBER`


def node(kind: str, number: str) -> None:
    import rospy
    from std_msgs.msg import String
    from std_srvs.srv import Trigger

    rospy.init_node(f"{kind}_{number}")
    if kind == "talker":
        out = rospy.Publisher(f"/topic_{number}", String, queue_size=1000)
        rate = rospy.Rate(500 if number == "0" else 10)
        while not rospy.is_shutdown():
            out.publish("x" * 100)
            rate.sleep()
    elif kind == "listener":
        rospy.Subscriber(f"/topic_{number}", String, lambda _: None)
    elif kind == "helper":
        rospy.Service("/helper", Trigger, lambda _: (True, ""))
    elif kind == "worker":
        import actionlib
        from actionlib.msg import TestAction

        actionlib.SimpleActionServer("/work", TestAction, lambda _: None, auto_start=False).start()
    elif kind == "waiter":  # listens to topics that come one by one
        for i in range(int(os.environ["BENCH_TRIALS"])):
            rospy.Subscriber(f"/late_{i}", String, lambda _: None)
    elif kind == "late":  # publishes the next topic at each line that it reads
        kept = [
            rospy.Publisher(f"/late_{i}", String, queue_size=10)
            for i, _line in enumerate(iter(sys.stdin.readline, ""))
        ]  # fmt: skip
        del kept
    rospy.spin()


# ---- the graph


class Scene:
    """A master and 20 nodes on loopback, ended together."""

    def __init__(self, trials: int) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        self.uri = f"http://127.0.0.1:{port}/"
        self.home = tempfile.mkdtemp()
        self.trials = trials
        self.nodes: dict[str, subprocess.Popen[str]] = {}
        self.master = self.start("/usr/bin/rosmaster", "--core", "-p", str(port), "-t", "2", "-w", "16")
        self.api = xmlrpc.client.ServerProxy(self.uri)
        until("the master", lambda: bool(self.api.getPid(ME)))
        for i in range(PAIRS):
            self.node("talker", i)
            self.node("listener", i)
        for kind in ("helper", "worker", "waiter", "late"):
            self.node(kind, 0)
        until("20 nodes", lambda: len(self.registered()) == len(self.nodes) == 20, 120)
        until("the action", lambda: "/work/status" in [row[0] for row in self.system_state()[0]], 60)

    def start(self, *command: str) -> subprocess.Popen[str]:
        env = {**os.environ, "ROS_MASTER_URI": self.uri, "ROS_IP": "127.0.0.1", "ROS_LOG_DIR": self.home,
               "ROS_HOME": self.home, "BENCH_TRIALS": str(self.trials)}  # fmt: skip
        return subprocess.Popen(
            command, env=env, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, text=True
        )

    def node(self, kind: str, number: int) -> None:
        command = ("/usr/bin/python3", str(Path(__file__).resolve()), "node", kind, str(number))
        self.nodes[f"/{kind}_{number}"] = self.start(*command)

    def system_state(self) -> Any:
        reply: Any = self.api.getSystemState(ME)
        return reply[2]

    def registered(self) -> set[str]:
        return {name for part in self.system_state() for row in part for name in row[1]}

    def slave(self, name: str) -> Any:
        reply: Any = self.api.lookupNode(ME, name)
        return xmlrpc.client.ServerProxy(reply[2])

    def sent(self) -> int:
        """Messages that the 500 Hz publisher itself counts on its connection to its subscriber."""
        publishers = self.slave("/talker_0").getBusStats(ME)[2][0]
        return max(int(row[2]) for topic, _size, rows in publishers if topic == "/topic_0" for row in rows)

    def end(self) -> None:
        for process in [*self.nodes.values(), self.master]:
            process.send_signal(signal.SIGCONT)
            process.kill()
            process.wait()


def until(what: str, true: Callable[[], bool], seconds: float = 30, pause: float = 0.05) -> float:
    """Wait for something to be true; when it was seen."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        try:
            if true():
                return time.monotonic()
        except OSError:
            pass
        time.sleep(pause)
    raise SystemExit(f"{what} did not come within {seconds:.0f} s")


# ---- module runs


class Run:
    """One run of the module as a process."""

    def __init__(self, uri: str, **options: Any) -> None:
        path = os.pathsep.join([str(COLLECTIONS), os.environ.get("PYTHONPATH", "")])
        self.began = time.monotonic()
        self.process = subprocess.Popen(
            ["/usr/bin/python3", "-m", MODULE], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            env={**os.environ, "PYTHONPATH": path},
        )  # fmt: skip
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps({"ANSIBLE_MODULE_ARGS": {"master_uri": uri, **options}}))
        self.process.stdin.close()

    def result(self) -> dict[str, Any]:
        assert self.process.stdout is not None
        text = self.process.stdout.read()
        usage = os.wait4(self.process.pid, 0)[2]
        self.process.returncode = 0
        self.ended = time.monotonic()
        self.cpu = usage.ru_utime + usage.ru_stime
        found: dict[str, Any] = json.loads(text)
        return found


def measured(label: str, scene: Scene, trials: int, expected: str, **options: Any) -> dict[str, Any]:
    """Runs of one kind: seconds in the module, of the whole process, and of CPU."""
    elapsed, whole, cpu, last = [], [], [], {}
    for _trial in range(trials):
        run = Run(scene.uri, timeout=0, **options)
        last = run.result()
        if last["verdict"] != expected:
            raise SystemExit(f"{label}: {last['verdict']} instead of {expected}: {last.get('msg')}")
        elapsed.append(last["elapsed"])
        whole.append(run.ended - run.began)
        cpu.append(run.cpu)
    return {
        "row": label,
        "runs": trials,
        "elapsed_median": round(statistics.median(elapsed), 3),
        "elapsed_max": round(max(elapsed), 3),
        "process_median": round(statistics.median(whole), 3),
        "process_max": round(max(whole), 3),
        "cpu_median": round(statistics.median(cpu), 3),
        "checks": last["checks"],
    }


def delays(scene: Scene, trials: int) -> dict[str, Any]:
    """From "true in the graph", seen by a watch of its own on the publisher, to the end of the module's process."""
    late = scene.nodes["/late_0"]
    slave = scene.slave("/late_0")
    found = []
    for i in range(trials):
        topic = f"/late_{i}"

        def connected(topic: str = topic) -> bool:
            return any(row[1:3] == ["/waiter_0", "o"] and row[4] == topic for row in slave.getBusInfo(ME)[2])

        run = Run(scene.uri, timeout=30, interval=INTERVAL, topics=[{"name": topic, "connected": True}])
        time.sleep(0.6 + INTERVAL * i / trials)  # another phase of the interval each time
        assert late.stdin is not None
        late.stdin.write("next\n")
        late.stdin.flush()
        true_at = until(topic, connected, pause=0.002)
        result = run.result()
        if not result["ready"]:
            raise SystemExit(f"{topic}: {result['msg']}")
        found.append(run.ended - true_at)
    return {
        "row": "true to return",
        "runs": trials,
        "delay_median": round(statistics.median(found), 3),
        "delay_max": round(max(found), 3),
    }


def bench(trials: int) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    scene = Scene(trials)
    try:
        names = sorted(scene.nodes)
        pairs = [{"name": f"/topic_{i}", "type": "std_msgs/String", "connected": True} for i in range(PAIRS)]
        rest = {"topics": pairs, "services": [{"name": "/helper"}]}
        idle = {"actions": [{"name": "/work", "state": "idle"}]}
        rated = [{"name": "/topic_0", "min_rate": 50}]
        measured("warm-up", scene, 1, "pass", nodes=names, **rest)
        rows = [
            measured("live", scene, trials, "pass", nodes=names, **rest),
            measured("live, and an idle action", scene, trials, "pass", nodes=names, **rest, **idle),
            delays(scene, trials),
        ]
        before, began = scene.sent(), time.monotonic()
        rows.append(measured("live, and a 500 Hz rate", scene, max(3, trials // 3), "pass", nodes=names, topics=rated))
        rate = {"own_count": round((scene.sent() - before) / (time.monotonic() - began), 1)}
        rate["measured"] = next(c["observed"]["rate"] for c in rows[-1]["checks"] if c["kind"] == "rate")
        hung = ["/listener_1", "/talker_2", "/helper_0"]
        for name in hung:
            scene.nodes[name].send_signal(signal.SIGSTOP)
        row = measured("three hung", scene, max(3, trials // 3), "wait", nodes=names, **rest)
        down = [check["name"] for check in row["checks"] if check["kind"] == "node" and check["verdict"] != "pass"]
        if sorted(down) != sorted(hung):
            raise SystemExit(f"hung were {hung}, found were {down}")
        rows.append(row)
        others = [name for name in names if name not in hung]
        rows.append(measured("three hung, not asked for", scene, trials, "pass", nodes=others))
    finally:
        scene.end()
    return rows, {"rate": rate}


def main() -> int:
    if sys.argv[1:2] == ["node"]:
        node(*sys.argv[2:4])
        return 0
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=10)
    parser.add_argument("--where", default="local")
    arguments = parser.parse_args()
    rows, more = bench(arguments.trials)
    print(f"{'seconds':28}{'runs':>5}{'elapsed':>9}{'max':>7}{'process':>9}{'max':>7}{'CPU':>7}{'limit':>7}")
    missed = []
    for row in rows:
        limit = LIMITS.get(row["row"])
        shown = {key.replace("delay", "process"): value for key, value in row.items()}
        cells = [f"{shown[key]:.3f}".rjust(width) if key in shown else " " * width for key, width in COLUMNS.items()]
        print(f"{row['row']:28}{row['runs']:>5}{''.join(cells)}{'' if limit is None else f'{limit:.1f}':>7}")
        if limit is not None and max(row[key] for key in LIMITED if key in row) > limit:
            missed.append(row["row"])
        row.pop("checks", None)
    print(
        "500 Hz topic: {measured:.1f} Hz measured, {own_count:.1f} Hz by its publisher's count".format(**more["rate"])
    )
    for row_name in missed:
        print(f"over its limit: {row_name}")
    result = {
        "bench": "ready",
        "passed": not missed,
        "where": arguments.where,
        "nodes": 20,
        "interval": INTERVAL,
        "limits": LIMITS,
        "rows": rows,
        **more,
        "cores": len(os.sched_getaffinity(0)),
        "load": round(os.getloadavg()[0], 1),
        "python": platform.python_version(),
    }
    print(json.dumps(result))
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
