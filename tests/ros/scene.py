# SPDX-License-Identifier: GPL-3.0-or-later
"""A ROS master, nodes and the keeper as processes on loopback, ended together.

All of a scene end with it: those that a name was given to twice, too, and those that they started themselves.
"""

from __future__ import annotations

import http.client
import json
import os
import signal
import socket
import subprocess
import time
import uuid
import xmlrpc.client
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._ros.registrar import Registrar
from ansible_collections.rosops.fleet.plugins.module_utils._ros.registrations import Entry
from pod_code import write_code
from started import kill, marked

NODES = Path(__file__).with_name("nodes.py")
PYTHON = "/usr/bin/python3"  # Debian's ROS packages are for this one
SUCCEEDED, RECALLED, LOST = 3, 8, 9
LAST_LINES = 40
MARK = "ROSOPS_TEST_SCENE"


def until(what: str, true: Callable[[], Any], seconds: float = 30.0) -> Any:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        try:
            found = true()
            if found:
                return found
        except (OSError, LookupError, xmlrpc.client.Error):  # not there yet
            pass
        time.sleep(0.02)
    raise AssertionError(f"{what} did not happen within {seconds:g} s")


class Scene:
    def __init__(self, directory: Path) -> None:
        self.directory, self.mark = directory, uuid.uuid4().hex
        self._reserved: list[socket.socket] = []
        self.port, self.keeper_port = self.reserve_port(), self.reserve_port()
        self.uri = f"http://127.0.0.1:{self.port}/"
        self.ros = Registrar(self.uri, 2.0, "/tester")
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self.environment: dict[str, str] = {}  # what processes get besides
        self.keeper_uri = f"http://127.0.0.1:{self.keeper_port}/"
        self.keeper_api = xmlrpc.client.ServerProxy(self.keeper_uri)

    def reserve_port(self) -> int:
        """One that nobody else is given: two scenes would have one master. Who sets SO_REUSEADDR can listen there."""
        held = socket.socket()
        held.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        held.bind(("127.0.0.1", 0))
        self._reserved.append(held)
        return int(held.getsockname()[1])

    # ---- processes

    def _start(self, name: str, *command: str) -> subprocess.Popen[bytes]:
        env = {
            "PATH": os.environ["PATH"],
            "ROS_MASTER_URI": self.uri,
            "ROS_IP": "127.0.0.1",
            "ROS_LOG_DIR": str(self.directory / "roslog"),
            "HOME": str(self.directory),
            MARK: self.mark,
            **self.environment,
        }
        with (self.directory / f"{name.strip('/')}.out").open("ab") as out:
            process = subprocess.Popen(command, env=env, stdout=out, stderr=out, cwd="/")  # noqa: S603 - our own
        self.processes[name] = process
        return process

    def start_master(self) -> None:
        self._start("master", PYTHON, "/usr/bin/rosmaster", "--core", "-p", str(self.port), "-t", "2", "-w", "16")
        until("the master", lambda: xmlrpc.client.ServerProxy(self.uri).getPid("/tester"))

    def start_keeper(self, *options: str) -> subprocess.Popen[bytes]:
        more = ("--record", str(self.directory / "record"), "--port", str(self.keeper_port), *options)
        process = self.start_code("keeper", *more)
        until("the keeper", self.keeper_api.state)
        return process

    def start_code(self, word: str, *options: str) -> subprocess.Popen[bytes]:
        """A command of what runs in pods, as their objects start it."""
        code = self.directory / "hooks"
        code.mkdir(exist_ok=True)
        write_code(code)
        python = ("/usr/bin/env", "MALLOC_ARENA_MAX=1", os.environ.get("KEEPER_PYTHON", PYTHON), "-I", "-S")
        return self._start(word, *python, str(code / "run.py"), word, *options)

    def run_stop_hook(self, name: str) -> str:
        """That of the node's pod; what it said."""
        settings = {"node": name, "expect_node": True, "stop_deadline": 20, "keeper": self.keeper_uri}
        self.environment = {"ROSOPS_SETTINGS": json.dumps(settings)}
        hook = self.start_code("stop")
        self.environment = {}
        assert hook.wait(30) == 0
        self.processes[name].wait(10)
        return self.said("stop")

    def start(self, kind: str, name: str, *words: str, log: str = "") -> subprocess.Popen[bytes]:
        path = self.directory / f"{log or name.strip('/')}.jsonl"
        return self._start(name, PYTHON, str(NODES), kind, name.strip("/"), str(path), *words)

    def until_registered(self, *names: str) -> None:
        """Each has said something, which a node does once its publisher or subscriber is made.

        A publisher and its subscriber are not to register at the same time: rospy (impl/registration.py) queues the
        list of publishers that the answer of `registerSubscriber` holds behind a `publisherUpdate` that came
        meanwhile, takes the last one of the queue, and never connects.
        """
        until(f"{names} to be registered", lambda: all(self.log(name) for name in names))

    def until_published(self, topic: str, *names: str) -> None:
        """These are its publishers, by the master: as for `until_registered`."""
        until(f"{names} to publish {topic}", lambda: set(names) <= set(self.ros.state().publishers.get(topic, ())))

    def kill(self, name: str, number: int = signal.SIGKILL) -> None:
        self.processes[name].send_signal(number)
        if number == signal.SIGKILL:
            self.processes[name].wait()

    def stop(self, name: str) -> int:
        process = self.processes.pop(name)
        process.terminate()
        return process.wait(20)

    def end(self) -> None:
        for held in self._reserved:
            held.close()
        kill(lambda: marked(MARK, self.mark))
        for process in self.processes.values():
            process.wait()

    # ---- what is there

    def log(self, name: str) -> list[dict[str, Any]]:
        path = self.directory / f"{name.strip('/')}.jsonl"
        if not path.exists():
            return []
        return [json.loads(line) for line in path.read_text().splitlines() if line.endswith("}")]

    def said(self, name: str = "keeper") -> str:
        return (self.directory / f"{name}.out").read_text()

    def last_words(self) -> list[tuple[str, str]]:
        """The end of each process' log, with where the threads of those nodes are that still run."""
        for name, process in self.processes.items():
            if name.startswith("/") and process.poll() is None:
                process.send_signal(signal.SIGUSR2)  # nodes.py answers it so
        time.sleep(0.5)
        logs = sorted(path for path in self.directory.iterdir() if path.suffix in (".out", ".jsonl"))
        last = ((path.name, path.read_text().splitlines()[-LAST_LINES:]) for path in logs)
        return [(name, "\n".join(lines)) for name, lines in last if lines]

    def registered(self) -> dict[str, Entry]:
        """Without the keeper's own."""
        return {name: entry for name, entry in self.ros.snapshot().items() if name != "/ros_keeper"}

    def recorded(self) -> dict[str, Any]:
        try:
            content: dict[str, Any] = json.loads((self.directory / "record" / "registrations.json").read_text())
        except (OSError, ValueError):
            return {"nodes": {}, "removed": {}}
        return content

    def keeper_ready(self) -> bool:
        """As its startup probe asks it."""
        link = http.client.HTTPConnection("127.0.0.1", self.keeper_port, timeout=2)
        link.request("GET", "/ready")
        status = link.getresponse().status
        link.close()
        return status == 200

    def until_recorded(self, *nodes: str) -> None:
        """The keeper has all that the master has of these nodes, with their process ids."""

        def true() -> bool:
            there, on_record = self.registered(), self.recorded()["nodes"]
            return all(
                node in there
                and node in on_record
                and on_record[node]["pid"]
                and {**there[node].as_dict(), "pid": 0} == {**on_record[node], "pid": 0}
                for node in nodes
            )

        until(f"a record of {nodes}", true)
