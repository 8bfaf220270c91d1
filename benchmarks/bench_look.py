# SPDX-License-Identifier: GPL-3.0-or-later
"""What a look at a graph costs whoever looks, on one master that many robots share.

    python benchmarks/bench_look.py --robots 10 30 100

The master and its nodes are simulated in another process: 12 nodes a robot, which all register ten topics and three
services. CPU time of the one who looks, not wall time, for the first look, for one more at the same graph, and for one
after something has changed. The last line printed is the result as JSON; the exit status is 1 where a look failed, or
one at an unchanged graph costs more than its limit.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
import xmlrpc.client
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

CHECKOUT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(CHECKOUT / ".ansible" / "collections")]

from ansible_collections.rosops.fleet.plugins.module_utils._exporter.observer import Observer  # noqa: E402
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.snapshot import History, next_poll  # noqa: E402
from ansible_collections.rosops.fleet.plugins.module_utils._pod.judge import first_questions  # noqa: E402
from ansible_collections.rosops.fleet.plugins.module_utils._robot.keeper import PROBE, Keeper  # noqa: E402
from ansible_collections.rosops.fleet.plugins.module_utils._robot.memory import PERIOD, KeptFiles  # noqa: E402
from ansible_collections.rosops.fleet.plugins.module_utils._ros.client import Ros1Client  # noqa: E402
from ansible_collections.rosops.fleet.plugins.module_utils._ros.conditions import conditions_from  # noqa: E402
from ansible_collections.rosops.fleet.plugins.module_utils._ros.gate import look  # noqa: E402
from ansible_collections.rosops.fleet.plugins.module_utils._ros.registrar import Registrar  # noqa: E402
from published import HELP, Table, publish  # noqa: E402

APPS, TOPICS = 12, 10
LIMIT = 60.0  # ms of CPU of one more look at an unchanged graph, of whoever does not ask all nodes
AGAIN = 5
Look = Callable[[], Any]


# ---- the fleet


def node_name(robot: int, app: int) -> str:
    return f"/robot{robot:03d}/app_{app:02d}_{(robot * 7919 + app * 104729) % 2**32:08x}"


def registrations(robots: int, changed: int) -> tuple[list[Any], list[Any]]:
    """getSystemState's and getTopicTypes' values. `changed`: how many topics came since the beginning."""
    publishers: dict[str, list[str]] = {"/rosout": []}
    subscribers: dict[str, list[str]] = {"/rosout": ["/rosout"]}
    services: dict[str, list[str]] = {}
    for robot in range(robots):
        names = [node_name(robot, app) for app in range(APPS)]
        for app, name in enumerate(names):
            publishers["/rosout"].append(name)
            for topic in range(TOPICS):
                publishers[f"/robot{robot:03d}/app_{app:02d}/topic_{topic}"] = [name]
                subscribers[f"/robot{robot:03d}/app_{app:02d}/topic_{topic}"] = [names[app - 1], names[app - 5]]
            for service in ("get_loggers", "set_logger_level", "set_parameters"):
                services[f"{name}/{service}"] = [name]
    publishers.update({f"/new_{number}": [node_name(0, 0)] for number in range(changed)})
    state = [[[name, nodes] for name, nodes in part.items()] for part in (publishers, subscribers, services)]
    return state, [[name, "sensor_msgs/PointCloud2"] for name in publishers]


class Fleet(ThreadingHTTPServer):
    """The master and every node, all at one address."""

    daemon_threads = True
    request_queue_size = 256

    def __init__(self, robots: int) -> None:
        self.robots, self.changed = robots, 0
        self.known: dict[bytes, bytes] = {}
        super().__init__(("127.0.0.1", 0), Handler)
        self.uri = f"http://127.0.0.1:{self.server_address[1]}/"

    def reply(self, question: bytes) -> bytes:
        if question not in self.known:
            params, method = xmlrpc.client.loads(question)
            if method == "change":
                self.changed += 1
                self.known.clear()
                return xmlrpc.client.dumps((self.changed,), methodresponse=True).encode()
            value = self.value(str(method), *params)
            self.known[question] = xmlrpc.client.dumps((value,), methodresponse=True, allow_none=True).encode()
        return self.known[question]

    def value(self, method: str, *params: Any) -> Any:
        if method == "system.multicall":
            return [[self.value(one["methodName"], *one["params"])] for one in params[0]]
        state, types = (
            registrations(self.robots, self.changed) if method.startswith(("getSystem", "getTopic")) else ([], [])
        )
        known: dict[str, Any] = {
            "getSystemState": state, "getTopicTypes": types, "getPid": 7, "getUri": self.uri, "getParam": {"a": 1},
            "lookupNode": self.uri, "lookupService": "rosrpc://127.0.0.1:9",
            "getBusInfo": [], "getBusStats": [[], [], []], "getPublications": [], "getSubscriptions": [],
        }  # fmt: skip
        return [1, "", known[method]]


class Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    wbufsize = -1
    server: Fleet

    def do_POST(self) -> None:
        body = self.server.reply(self.rfile.read(int(self.headers["Content-Length"])))
        self.send_response(200)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Nobody reads it."""


# ---- who looks


def gate(uri: str) -> Look:
    """ros_ready, and the looks of an update at one app."""
    ros = Ros1Client(uri, 5.0)
    name = node_name(0, 3)
    wanted = conditions_from({"nodes": [name], "topics": [{"name": "/robot000/app_03/topic_1", "publishers": 1}]})
    return lambda: look(ros, wanted)


def started(uri: str) -> Look:
    """The startup probe of one app."""
    ros = Ros1Client(uri, 5.0)

    def seen() -> None:
        state = ros.state(types=True)
        ros.ask(state, first_questions(state, [node_name(0, 3)]))

    return seen


def keeper(uri: str) -> Look:
    """A whole look of the keeper. It asks all nodes at the first one; with time standing still, at no other."""
    told: list[str] = []
    found = Keeper(
        Registrar(uri, 5.0, "/ros_keeper"), KeptFiles(tempfile.mkdtemp(), told.append), told.append, lambda: 0.0
    )

    def step() -> None:
        found.due, found.addresses_due = 0.0, float("inf")
        found.step()
        if found.probing is not None:
            found.probing.join()
        if told:
            raise SystemExit(told)

    return step


def keepers_nodes(uri: str) -> Look:
    """What the keeper asks all nodes beside its looks, every memory.PERIOD seconds."""
    ros = Registrar(uri, 5.0, "/ros_keeper")
    entries = ros.snapshot()
    return lambda: ros.ask(entries, PROBE, own_word=False)


def exporter(uri: str) -> Look:
    """A poll for the metrics, which asks every node."""
    observer, memory = Observer(uri, 5.0), [History()]

    def poll() -> None:
        graph, _launched = observer.look()
        _metrics, memory[0] = next_poll(graph, observer.wrong.values(), memory[0])

    return poll


LOOKS = {"gate": gate, "started": started, "keeper": keeper, "keeper-nodes": keepers_nodes, "exporter": exporter}
ASK_ALL = {"keeper-nodes", "exporter"}


def cost(seen: Look, times: int = 1) -> float:
    """Milliseconds of CPU of one look."""
    began = time.process_time()
    for _look in range(times):
        seen()
    return round((time.process_time() - began) * 1000 / times, 1)


def measure(robots: int, kinds: list[str]) -> dict[str, Any]:
    command = [sys.executable, __file__, "--fleet", str(robots)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:  # noqa: S603 - our own
        assert process.stdout is not None
        uri = process.stdout.readline().strip()
        try:
            master = xmlrpc.client.ServerProxy(uri)
            size = len(xmlrpc.client.dumps((master.getSystemState("/bench"),), methodresponse=True))
            found: dict[str, Any] = {"robots": robots, "nodes": robots * APPS, "reply_bytes": size}
            for kind in kinds:
                seen = LOOKS[kind](uri)
                first, again = cost(seen), cost(seen, AGAIN)
                master.change()
                found[kind] = {"first_ms": first, "again_ms": again, "changed_ms": cost(seen)}
        finally:
            process.terminate()
    return found


def dear(kinds: list[str], rows: list[dict[str, Any]]) -> list[str]:
    """Looks at an unchanged graph that cost more than they may."""
    return [
        f"{kind} with {row['robots']} robots"
        for kind in kinds
        for row in rows
        if kind not in ASK_ALL and row[kind]["again_ms"] > LIMIT
    ]


def section(kinds: list[str], rows: list[dict[str, Any]]) -> Table:
    """The result as a section of docs/benchmarks.md."""
    missed = dear(kinds, rows)
    about = (
        f"Milliseconds of processor time of whoever looks, {os.cpu_count()} cores, {platform.machine()}: the first "
        f"look, one more at the same graph, and one after something has changed. {APPS} nodes a robot, {TOPICS} topics "
        f"a node. The keeper asks its nodes beside its looks, every {PERIOD:g} s, the exporter at each. One more look "
        f"of who does not ask every node may cost {LIMIT:g} ms: "
        + (f"**MISS** ({', '.join(missed)})." if missed else "**PASS**.")
    )
    cells = [
        [kind, str(row["robots"]), str(row["nodes"]), f"{row['reply_bytes'] / 1e6:.1f}"]
        + [f"{row[kind][f'{when}_ms']:.1f}" for when in ("first", "again", "changed")]
        for kind in kinds
        for row in rows
    ]
    heads = ["look", "robots", "nodes", "MB of the master's reply", "first", "again", "changed"]
    return Table("A look at a master that many robots share", about, heads, cells)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, nargs="+", default=[10, 30, 100])
    parser.add_argument("--looks", nargs="+", choices=list(LOOKS), default=list(LOOKS))
    parser.add_argument("--publish", action="store_true", help=HELP)
    parser.add_argument("--fleet", type=int, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.fleet:
        server = Fleet(arguments.fleet)
        print(server.uri, flush=True)
        server.serve_forever()
    rows = [measure(robots, arguments.looks) for robots in arguments.robots]
    print(f"{'CPU ms of a look':<18}{'robots':>7}{'nodes':>7}{'MB':>6}{'first':>9}{'again':>9}{'changed':>9}")
    for kind in arguments.looks:
        for row in rows:
            here = f"{kind:<18}{row['robots']:>7}{row['nodes']:>7}{row['reply_bytes'] / 1e6:>6.1f}"
            print(here + "".join(f"{row[kind][f'{when}_ms']:>9.1f}" for when in ("first", "again", "changed")))
    missed = dear(arguments.looks, rows)
    if arguments.publish:
        publish("look", section(arguments.looks, rows))
    result = {"bench": "look", "passed": not missed, "rows": rows, "limit_ms": LIMIT}
    print(json.dumps({**result, "cores": os.cpu_count(), "machine": platform.machine(), "load": os.getloadavg()[0]}))
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
