# SPDX-License-Identifier: GPL-3.0-or-later
"""A minimal ROS 1 node: a slave API, and publications of raw messages. Only what the keeper needs."""

from __future__ import annotations

import contextlib
import http.server
import os
import socket
import socketserver
import struct
import threading
import xmlrpc.client
from typing import Any, Callable, Mapping, NamedTuple
from urllib.parse import parse_qsl

from .._common.errors import RosError
from .replies import loads
from .rpc import Deadline, TimedSocket
from .streams import MAX_HEADER, hang_up, read_frame
from .tcpros import decode_header, encode_header

SEND_SECONDS = 5.0
MAX_CALL = 4 * 1024 * 1024  # bytes of a call
ANSWERED = 120.0  # seconds for an answer to be taken, which a graph over a radio may need
MOST, MOST_OF_ONE = 1024, 128  # connections at once, each with its thread: of all peers, and of one address
POLL = 1.0  # between looks at whether it is to stop


class Asked(NamedTuple):
    """A request that is no XML-RPC. `path` has no query, `method` is in capitals, headers are named `Content-Type`."""

    method: str
    path: str
    query: Mapping[str, str] = {}
    headers: Mapping[str, str] = {}
    body: bytes = b""


class Said(NamedTuple):
    """What is answered to it."""

    status: int
    body: bytes = b""
    kind: str = "text/plain"
    headers: Mapping[str, str] = {}


Page = Callable[[Asked], Said]


class _Handler(http.server.BaseHTTPRequestHandler):
    """XML-RPC, and pages. The library's own server loads its documentation with it, a megabyte."""

    protocol_version = "HTTP/1.1"  # as rospy's: clients keep their connection
    timeout = 30
    disable_nagle_algorithm = True
    wbufsize = -1  # an answer is one packet
    server: _Server
    connection: TimedSocket

    def handle_one_request(self) -> None:
        """From the first byte of the line to the last one of the body, for whoever drips them, too."""
        self.connection.deadline = Deadline(self.timeout)
        super().handle_one_request()

    def do_GET(self) -> None:
        self._say(self._shown(self._page() or (lambda _asked: Said(404))))

    def do_POST(self) -> None:
        page = self._page()
        if page:
            self._say(self._shown(page))
            return
        try:
            params, method = loads(self.rfile.read(self._size()))
            reply: Any = (self.server.methods[str(method)](*params),)
        except Exception as error:  # of whoever calls; the node works on
            reply = xmlrpc.client.Fault(1, f"{type(error).__name__}: {error}")
        self._say(Said(200, xmlrpc.client.dumps(reply, methodresponse=True, allow_none=True).encode(), "text/xml"))

    def _page(self) -> Page | None:
        """That of the path, or of the longest directory above it."""
        path = self.path.partition("?")[0]
        fitting = [one for one in self.server.pages if one == path or (one.endswith("/") and path.startswith(one))]
        return self.server.pages[max(fitting, key=len)] if fitting else None

    def _shown(self, page: Page) -> Said:
        try:
            return page(self._asked())
        except Exception as error:  # of whoever asks; the node works on
            return Said(400 if isinstance(error, RosError) else 500, f"{type(error).__name__}: {error}".encode())

    def _asked(self) -> Asked:
        path, _mark, query = self.path.partition("?")
        headers = {name.title(): text for name, text in self.headers.items()}
        return Asked(self.command, path, dict(parse_qsl(query)), headers, self.rfile.read(self._size()))

    def _size(self) -> int:
        """The bytes of the call."""
        said = self.headers.get("Content-Length") or "0"
        if not said.isdecimal() or len(said) > len(str(MAX_CALL)) or int(said) > MAX_CALL:
            self.close_connection = True  # what comes is no further call
            raise RosError(f"a call has 0 to {MAX_CALL} bytes")
        return int(said)

    def _say(self, said: Said) -> None:
        self.connection.deadline = Deadline(ANSWERED)
        self.send_response(said.status)
        if said.body:
            self.send_header("Content-Type", said.kind)
        for name, value in said.headers.items():
            self.send_header(name, value)
        if self.close_connection:
            self.send_header("Connection", "close")
        self.send_header("Content-Length", str(len(said.body)))
        self.end_headers()
        self.wfile.write(said.body)

    def log_message(self, format: str, *args: Any) -> None:
        """Probes and calls are not worth a line."""


class _Subscriber(socketserver.BaseRequestHandler):
    server: _Server

    def handle(self) -> None:
        self.server.talk(self.request)


class _Server(socketserver.ThreadingMixIn, socketserver.TCPServer):
    daemon_threads = True
    block_on_close = False
    request_queue_size = 64
    allow_reuse_address = True

    def __init__(self, address: tuple[str, int], handler: type[socketserver.BaseRequestHandler]) -> None:
        super().__init__(address, handler)
        self.lock = threading.Lock()
        self.guests: list[str] = []  # the addresses of who is connected
        self.talk: Callable[[TimedSocket], None] = hang_up
        self.methods: dict[str, Callable[..., Any]] = {}
        self.pages: dict[str, Page] = {}

    def get_request(self) -> tuple[TimedSocket, tuple[str, int]]:
        plain, address = super().get_request()
        return TimedSocket(fileno=plain.detach()), address

    def verify_request(self, request: Any, client_address: Any) -> bool:  # noqa: ARG002 - the library's
        """Whether there is room. One address cannot take the place of all."""
        with self.lock:
            there = len(self.guests) < MOST and self.guests.count(client_address[0]) < MOST_OF_ONE
            self.guests += [client_address[0]] if there else []
        return there

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            with self.lock:
                self.guests.remove(client_address[0])

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A client that hung up is not our error."""


class Publication:
    """A topic that raw messages are sent on."""

    def __init__(self, topic: str, header: Mapping[str, str]) -> None:
        self.topic = topic
        self.header = dict(header)
        self.links: dict[socket.socket, str] = {}  # connection -> subscriber
        self.closed = False
        self.lock = threading.Lock()

    def refusal(self, fields: Mapping[str, str]) -> str:
        """Why a subscriber cannot have it; nothing if it can."""
        wanted = fields.get("md5sum", "*")
        if wanted not in ("*", self.header["md5sum"]):
            return f"{self.topic} is {self.header['type']}/{self.header['md5sum']}, not {wanted}"
        return ""

    def publish(self, body: bytes) -> list[str]:
        """Send one message to every subscriber; those that it went to."""
        frame = struct.pack("<I", len(body)) + body
        reached = []
        with self.lock:
            for sock, caller in list(self.links.items()):
                try:
                    sock.settimeout(SEND_SECONDS)
                    sock.sendall(frame)
                    reached.append(caller)
                except OSError:
                    self._drop(sock)
        return reached

    def callers(self) -> list[str]:
        with self.lock:
            return list(self.links.values())

    def serve(self, sock: socket.socket, caller: str) -> None:
        """Keep one connection until the peer ends it."""
        with self.lock:
            self.links[sock] = caller
            if self.closed:  # meanwhile: left open, it would wait for messages that go elsewhere, and not connect anew
                self._drop(sock)
                return
        with contextlib.suppress(OSError):
            self.welcome(sock, caller)
            while True:
                sock.settimeout(None)
                if not sock.recv(1024):
                    break
        with self.lock:
            left = not self.closed
            self._drop(sock)
        if left:
            self.left(caller)

    def welcome(self, sock: socket.socket, caller: str) -> None:
        """A subscriber has connected; in a thread of its own."""

    def left(self, caller: str) -> None:
        """A subscriber hung up by itself."""

    def close(self) -> None:
        with self.lock:
            self.closed = True
            for sock in list(self.links):
                self._drop(sock)

    def _drop(self, sock: socket.socket) -> None:
        self.links.pop(sock, None)
        hang_up(sock)


class Slave:
    """The node's servers."""

    def __init__(self, name: str, host: str, port: int, master_uri: str) -> None:
        self.name, self.host, self.master_uri = name, host, master_uri
        self.publications: dict[str, Publication] = {}
        self.server = _Server((host, port), _Handler)
        self.listener = _Server((host, 0), _Subscriber)
        self.listener.talk = self._talk
        address = host or socket.gethostname()
        self.uri = f"http://{address}:{self.server.server_address[1]}/"
        self.tcpros = ["TCPROS", address, self.listener.server_address[1]]
        own: dict[str, Callable[..., Any]] = {
            "getPid": lambda _caller: [1, "", os.getpid()],
            "getBusInfo": self._bus_info,
            "getBusStats": lambda _caller: [1, "", [[], [], []]],
            "getMasterUri": lambda _caller: [1, "", self.master_uri],
            "getPublications": self._publications,
            "getSubscriptions": lambda _caller: [1, "", []],
            "publisherUpdate": lambda _caller, _topic, _publishers: [1, "", 0],
            "paramUpdate": lambda _caller, _key, _value: [1, "", 0],
            "requestTopic": self._request_topic,
            # Kubernetes starts and stops it: a second one of its name, as at a change of pods, must not end it
            "shutdown": lambda _caller, _why="": [1, "", 0],
        }
        self.register(own)

    def register(self, methods: Mapping[str, Callable[..., Any]]) -> None:
        """Answer these XML-RPC methods, too; before start()."""
        self.server.methods.update(methods)

    def show(self, path: str, page: Page) -> None:
        """Answer there; a path that ends with `/` has all that are below it, too. Before start()."""
        self.server.pages[path] = page

    def start(self) -> None:
        threading.Thread(target=self.server.serve_forever, kwargs={"poll_interval": POLL}, daemon=True).start()
        threading.Thread(target=self._accept, daemon=True).start()

    def stop(self) -> None:
        self.server.shutdown()
        self.server.server_close()
        hang_up(self.listener.socket)
        for topic in list(self.publications):
            self.unadvertise(topic)

    # ---- publications

    def advertise(self, topic: str, header: Mapping[str, str]) -> None:
        self.add(Publication(topic, header))

    def add(self, publication: Publication) -> None:
        self.publications.setdefault(publication.topic, publication)

    def unadvertise(self, topic: str) -> None:
        publication = self.publications.pop(topic, None)
        if publication is not None:
            publication.close()

    def publish(self, topic: str, body: bytes) -> list[str]:
        publication = self.publications.get(topic)
        return publication.publish(body) if publication else []

    def callers(self, topic: str) -> list[str]:
        """The names of who listens to one of our topics."""
        publication = self.publications.get(topic)
        return publication.callers() if publication else []

    def _accept(self) -> None:
        with contextlib.suppress(OSError, ValueError):  # it was closed
            while True:
                self.listener.handle_request()

    def _talk(self, sock: TimedSocket) -> None:
        """A subscriber's connection: its header, ours, then messages."""
        sock.deadline = Deadline(SEND_SECONDS)
        try:
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            fields = decode_header(read_frame(sock, MAX_HEADER))
            publication = self.publications.get(fields.get("topic", ""))
            why = publication.refusal(fields) if publication else f"{self.name} does not publish that"
            if why or publication is None:
                sock.sendall(encode_header({"error": why}))
                sock.close()
                return
            reply = {"callerid": self.name, "topic": publication.topic, "latching": "0", **publication.header}
            sock.sendall(encode_header(reply))
        except (OSError, RosError):
            sock.close()
            return
        plain = socket.socket(fileno=sock.detach())
        publication.serve(plain, fields.get("callerid", ""))

    # ---- the slave API (wiki: ROS/Slave_API)

    def _bus_info(self, _caller: str) -> list[Any]:
        links = [(topic, caller) for topic, one in list(self.publications.items()) for caller in one.callers()]
        rows = [[number, caller, "o", "TCPROS", topic, True, ""] for number, (topic, caller) in enumerate(links)]
        return [1, "", rows]

    def _publications(self, _caller: str) -> list[Any]:
        return [1, "", [[topic, one.header["type"]] for topic, one in list(self.publications.items())]]

    def _request_topic(self, _caller: str, topic: str, protocols: list[Any]) -> list[Any]:
        if topic not in self.publications:
            return [-1, f"{self.name} does not publish {topic}", []]
        if not any(protocol and protocol[0] == "TCPROS" for protocol in protocols):
            return [0, "only TCPROS is spoken here", []]
        return [1, "", self.tcpros]
