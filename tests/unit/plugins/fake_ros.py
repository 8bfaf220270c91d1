# SPDX-License-Identifier: GPL-3.0-or-later
"""The recorded graph, and peers on loopback that answer what a test tells them to."""

from __future__ import annotations

import contextlib
import json
import socket
import socketserver
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import MasterState
from ansible_collections.rosops.fleet.plugins.module_utils._ros.replies import NodeAnswer, master_state
from ansible_collections.rosops.fleet.plugins.module_utils._ros.tcpros import decode_header

RECORDED = Path(__file__).resolve().parents[1] / "fixtures" / "ros"
DEAD = "/listener_dead"


def recorded(name: str) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((RECORDED / f"{name}.json").read_text())
    return content


def recorded_state() -> MasterState:
    master = recorded("master")
    return master_state(master["getSystemState with a client"][2], master["getTopicTypes"][2])


def recorded_answers() -> dict[str, NodeAnswer]:
    answers = {
        name: NodeAnswer(
            replies["lookupNode"][2],
            replies["getPid"][2],
            bus=replies["getBusInfo"][2],
            publications=replies["getPublications"][2],
            subscriptions=replies["getSubscriptions"][2],
        )
        for name, replies in recorded("nodes").items()
    }
    answers[DEAD] = NodeAnswer("http://127.0.0.1:9/", error="nothing listens at http://127.0.0.1:9/", refused=True)
    return answers


def frames(part: str, key: str) -> list[bytes]:
    """Recorded TCPROS frames without their length."""
    entry = recorded(part)[key]
    return [bytes.fromhex(frame)[4:] for frame in entry.get("frames", [entry.get("reply", "")])]


# ---- peers


def until(true: Callable[[], Any]) -> None:
    """What others do in threads of their own is seen when it is so."""
    end = time.monotonic() + 60  # other tests, a lab's hosts and their builds may have the processors
    while not true():
        assert time.monotonic() < end
        time.sleep(0.005)


def read_request(sock: socket.socket) -> None:
    """Read a whole HTTP request: a socket that is closed with unread bytes resets the connection."""
    stream = sock.makefile("rb")
    length = 0
    for line in iter(stream.readline, b"\r\n"):
        if line.lower().startswith(b"content-length:"):
            length = int(line.split(b":")[1])
    stream.read(length)


class _Handler(SimpleXMLRPCRequestHandler):
    protocol_version = "HTTP/1.1"  # as rospy's
    rpc_paths = ()


class _Server(socketserver.ThreadingMixIn, SimpleXMLRPCServer):
    daemon_threads = True
    block_on_close = False


class Peers:
    """Starts peers and ends them all."""

    def __init__(self) -> None:
        self.calls: list[tuple[str, str]] = []  # (label, method)
        self._ends: list[Callable[[], None]] = []

    def close(self) -> None:
        while self._ends:
            self._ends.pop()()

    def api(self, label: str, replies: dict[str, Any], multicall: bool = False, caller: bool = True) -> str:
        """An XML-RPC server; a reply is a value or a function of the call's arguments, after the caller's name where
        there is one. Its URI."""
        server = _Server(("127.0.0.1", 0), _Handler, logRequests=False, allow_none=True)

        def dispatch(method: str, params: tuple[Any, ...]) -> Any:
            self.calls.append((label, method))
            if method not in replies:
                raise LookupError(f"{method}: unknown method name")
            reply = replies[method]
            return reply(*params[caller:]) if callable(reply) else reply

        if multicall:
            server.register_multicall_functions()
            server.register_instance(type("_Instance", (), {"_dispatch": staticmethod(dispatch)})())
        else:
            server._dispatch = dispatch  # type: ignore[method-assign,assignment]
        threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()
        self._ends += [server.server_close, server.shutdown]
        return f"http://127.0.0.1:{server.server_address[1]}/"

    def tcp(self, talk: Callable[[socket.socket], Any]) -> int:
        """A TCP server that talks to each connection in a thread of its own; its port."""
        listener = socket.create_server(("127.0.0.1", 0))

        def one(sock: socket.socket) -> None:
            with sock, contextlib.suppress(OSError):
                talk(sock)

        def serve() -> None:
            with contextlib.suppress(OSError):
                while True:
                    threading.Thread(target=one, args=(listener.accept()[0],), daemon=True).start()

        threading.Thread(target=serve, daemon=True).start()
        # close() alone would leave accept() waiting
        self._ends += [listener.close, partial(listener.shutdown, socket.SHUT_RDWR)]
        return int(listener.getsockname()[1])

    def tcpros(self, answers: Callable[[dict[str, str]], Iterator[bytes] | list[bytes]]) -> int:
        """A TCPROS server: reads the header, sends what `answers` gives for its fields, then waits for the end."""

        def talk(sock: socket.socket) -> None:
            stream = sock.makefile("rb")
            fields = decode_header(stream.read(int.from_bytes(stream.read(4), "little")))
            for data in answers(fields):
                sock.sendall(data)
            stream.read()

        return self.tcp(talk)

    def hung(self) -> int:
        """Accepts, as the kernel does for a stopped process, and never answers."""
        listener = socket.create_server(("127.0.0.1", 0))
        self._ends.append(listener.close)
        return int(listener.getsockname()[1])

    def dead(self) -> int:
        """A port where nothing listens. It stays bound, else a test that runs at the same time might get it."""
        holder = socket.socket()
        holder.bind(("127.0.0.1", 0))
        self._ends.append(holder.close)
        return int(holder.getsockname()[1])
