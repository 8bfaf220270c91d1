# SPDX-License-Identifier: GPL-3.0-or-later
"""Asking the master, and peers that may be dead, hung or wrong: connections and XML-RPC calls, each with an end.

A peer gets one deadline for everything that is asked of it, from the connection to the last byte. Peers are asked at
the same time, and what they send is limited in size.
"""

from __future__ import annotations

import hashlib
import http.client
import math
import os
import queue
import socket
import threading
import time
import xmlrpc.client
from functools import partial
from typing import Any, Callable, Iterable, Mapping, Sequence, Tuple, TypeVar
from urllib.parse import urlsplit

from .._common.documents import Data
from .._common.errors import RosError
from .backend import MasterState
from .replies import loads, master_state, unwrap

MAX_REPLY = 64 * 1024 * 1024  # XML of one reply: that of a graph of 100 robots with 12 nodes each is about 6 MB
MASTER = "/master"  # the caller id that the master itself uses towards nodes
MAX_THREADS = 128
GRACE = 0.1  # for a peer's own time-out, whose reason says more than ours, to come first

_Result = TypeVar("_Result")
Request = Tuple[Any, ...]  # method, caller id, arguments


class Memo:
    """Parsed replies by their questions: one that is byte for byte the same as the last is not parsed again.

    What it gives is shared by all who ask, so nobody may change it.
    """

    LEAST = 16 * 1024  # bytes of a reply that is worth it
    KEPT = 4  # questions

    def __init__(self) -> None:
        self._kept: dict[bytes, tuple[bytes, Any]] = {}
        self._lock = threading.Lock()

    def parsed(self, question: bytes, reply: bytes) -> Any:
        if len(reply) < self.LEAST:
            return _parsed(reply)
        asked, said = hashlib.blake2b(question).digest(), hashlib.blake2b(reply).digest()
        with self._lock:
            before = self._kept.pop(asked, None)
        kept = before if before and before[0] == said else (said, _parsed(reply))
        with self._lock:
            self._kept[asked] = kept
            while len(self._kept) > self.KEPT:
                del self._kept[next(iter(self._kept))]
        return kept[1]


def _parsed(reply: bytes) -> Any:
    return loads(reply)[0][0]


class Deadline:
    """A point in time that all steps of one task share."""

    def __init__(self, seconds: float) -> None:
        self.end = time.monotonic() + seconds

    def left(self) -> float:
        left = self.end - time.monotonic()
        if left <= 0:
            raise socket.timeout("timed out")
        return left


class TimedSocket(socket.socket):
    """A socket whose every step ends at one deadline, so that a peer that drips bytes cannot hold us."""

    deadline: Deadline
    opened: float  # when a stream of messages began to come, by time.monotonic

    def recv(self, *args: Any) -> bytes:
        self.settimeout(self.deadline.left())
        return super().recv(*args)

    def recv_into(self, *args: Any) -> int:
        self.settimeout(self.deadline.left())
        return super().recv_into(*args)

    def send(self, *args: Any) -> int:
        self.settimeout(self.deadline.left())
        return super().send(*args)

    def sendall(self, *args: Any) -> None:
        self.settimeout(self.deadline.left())
        super().sendall(*args)


def connect(host: str, port: int, deadline: Deadline) -> TimedSocket:
    """A TCP connection within the deadline."""
    error: OSError = socket.timeout("timed out")
    for family, kind, protocol, _name, address in _addresses(host, port, deadline):
        sock = TimedSocket(family, kind, protocol)
        sock.deadline = deadline
        try:
            sock.settimeout(deadline.left())
            sock.connect(address)
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return sock
        except OSError as caught:
            error = caught
            sock.close()
    raise error


def _addresses(host: str, port: int, deadline: Deadline) -> list[Any]:
    """What a name stands for. A look-up cannot be ended, so it is left behind in a thread where it takes too long."""
    look_up = partial(socket.getaddrinfo, host, port, type=socket.SOCK_STREAM)
    try:
        return look_up(flags=socket.AI_NUMERICHOST)  # a pod's address: nobody has to be asked
    except socket.gaierror:
        tasks: dict[Any, Callable[[], Any]] = {host: look_up}
        found = in_parallel(tasks, deadline.left(), lambda _host, error: error)[host]
    if isinstance(found, BaseException):
        raise found
    return list(found)


def address_of(uri: str, scheme: str) -> tuple[str, int]:
    """Host and port of an http:// or rosrpc:// URI as ROS registers them."""
    try:
        parts = urlsplit(uri)
        host, port = parts.hostname, parts.port
    except ValueError:
        host, port, parts = None, None, urlsplit("")
    if parts.scheme != scheme or not host or not port:
        raise RosError(f"{uri!r} is not {scheme}://host:port")
    return host, port


def reason(error: BaseException, where: str, seconds: float) -> str:
    """Why a peer could not be asked, in words that say what to look at."""
    reasons: list[tuple[Any, Callable[[Any], str]]] = [
        (RosError, str),
        (xmlrpc.client.Fault, lambda fault: f"refused: {str(fault.faultString)[:200]}"),
        # two classes before Python 3.10
        ((socket.timeout, TimeoutError), lambda _: f"no answer from {where} within {seconds:g} s"),
        ((socket.gaierror, UnicodeError), lambda _: f"the name in {where} does not resolve here"),
        (ConnectionRefusedError, lambda _: f"nothing listens at {where}"),
        (OSError, lambda os_error: f"{where}: {os_error.strerror or os_error}"),
        (BaseException, lambda other: f"{where} answered nonsense ({type(other).__name__}: {str(other)[:100]})"),
    ]
    return next(say(error) for kinds, say in reasons if isinstance(error, kinds))


def in_parallel(
    tasks: Mapping[Any, Callable[[], _Result]],
    seconds: float,
    failed: Callable[[Any, BaseException], _Result],
    at_once: int = MAX_THREADS,
) -> dict[Any, _Result]:
    """Run the tasks at the same time, no more than so many `at_once`, each within these seconds from its turn on.

    One that raises, or is not done in time, becomes `failed(key, error)`.

    Daemon threads rather than an executor: an executor joins its threads at exit, and a name look-up cannot be
    interrupted, so one dead resolver would hold the whole module.
    """
    todo: queue.SimpleQueue[Any] = queue.SimpleQueue()
    done: queue.SimpleQueue[Any] = queue.SimpleQueue()
    over = threading.Event()
    for key in tasks:
        todo.put(key)

    def work() -> None:
        while not over.is_set():  # a thread that is late begins nothing more
            try:
                key = todo.get_nowait()
            except queue.Empty:
                return
            try:
                done.put((key, tasks[key]()))
            except Exception as error:  # whatever an untrusted peer provokes is that peer's result
                done.put((key, failed(key, error)))

    for _thread in range(min(len(tasks), at_once)):
        threading.Thread(target=work, daemon=True).start()
    end = time.monotonic() + seconds * -(-len(tasks) // at_once) + GRACE
    results: dict[Any, _Result] = {}
    while len(results) < len(tasks):
        try:
            key, result = done.get(timeout=max(0.0, end - time.monotonic()))
        except queue.Empty:
            break
        results[key] = result
    over.set()
    late = socket.timeout("timed out")
    return {key: results[key] if key in results else failed(key, late) for key in tasks}


class Api:
    """The XML-RPC API of the master or of a node, over one connection that is kept for all calls."""

    def __init__(self, uri: str, caller: str, deadline: Deadline, memo: Memo | None = None) -> None:
        self.caller, self.deadline, self.memo = caller, deadline, memo
        self.path = urlsplit(uri).path or "/"
        self.http = http.client.HTTPConnection(*address_of(uri, "http"))

    def __enter__(self) -> Api:
        return self

    def __exit__(self, *_: object) -> None:
        self.http.close()

    def raw(self, method: str, *args: Any) -> Any:
        body = xmlrpc.client.dumps(args, method).encode()
        kept = self.http.sock is not None
        try:
            response = self._post(body)
        except ConnectionError:
            if not kept:
                raise
            self.http.close()  # the peer does not keep connections: once more on a new one
            response = self._post(body)
        text = response.read(MAX_REPLY + 1)
        if len(text) > MAX_REPLY:
            raise RosError(f"the reply to {method} is longer than {MAX_REPLY} bytes, which no graph of robots needs")
        if response.status != 200:
            raise RosError(f"{method} was answered with HTTP status {response.status}")
        if not text.lstrip().startswith((b"<?xml", b"<methodResponse")):
            raise RosError(f"the reply to {method} is not plain XML-RPC")
        return self.memo.parsed(body, text) if self.memo else _parsed(text)

    def _post(self, body: bytes) -> http.client.HTTPResponse:
        if self.http.sock is None:
            self.http.sock = connect(self.http.host, self.http.port, self.deadline)
        self.http.request("POST", self.path, body, {"Content-Type": "text/xml", "User-Agent": "rosops.fleet"})
        return self.http.getresponse()

    def call(self, method: str, *args: Any) -> Any:
        return unwrap(self.raw(method, self.caller, *args))

    def optional(self, method: str, failed: Callable[[Exception], None] = lambda _error: None) -> Any:
        """The value of a call; None where the node, which lives, does not know it: only that part is unknown then."""
        try:
            return self.call(method)
        except (RosError, xmlrpc.client.Fault) as error:
            failed(error)
            return None

    def process(self) -> int:
        """A node's process id, which is how it shows that it lives."""
        pid = self.call("getPid")
        if not isinstance(pid, int):
            raise RosError("its process id is not a number")
        return pid

    def calls(self, requests: Sequence[Request]) -> list[Any]:
        """Several requests at once where the server can (rosmaster does), one by one where not.

        Each result is the call's value, or the RosError that it gave.
        """
        wanted = [{"methodName": method, "params": list(params)} for method, *params in requests]
        try:
            replies = self.raw("system.multicall", wanted) if len(requests) > 1 else None
        except xmlrpc.client.Fault:
            replies = None
        if not isinstance(replies, list) or len(replies) != len(requests):
            return [_tried(partial(self._one, *request)) for request in requests]
        return [_tried(partial(_value, reply)) for reply in replies]

    def _one(self, method: str, *params: Any) -> Any:
        return unwrap(self.raw(method, *params))


def tell_publishers(uri: str, topic: str, publishers: Sequence[str], seconds: float, caller: str = MASTER) -> None:
    """Tell a subscriber who publishes a topic, as the master does: it connects to those, and leaves all others."""
    with Api(uri, caller, Deadline(seconds)) as api:
        api.call("publisherUpdate", topic, list(publishers))


def _tried(call: Callable[[], Any]) -> Any:
    try:
        return call()
    except RosError as error:
        return error
    except xmlrpc.client.Fault as fault:
        return RosError(f"refused: {str(fault.faultString)[:200]}")


def _value(reply: Any) -> Any:
    """A result of system.multicall is a list of one reply, or a fault."""
    if isinstance(reply, list) and len(reply) == 1:
        return unwrap(reply[0])
    text = reply.get("faultString") if isinstance(reply, dict) else ""
    raise RosError(f"refused: {str(text)[:200]}")


# ---- the master


class Master:
    """One master, by its URI. It is asked anew by every call, so a node that moved is found.

    What it says is read again only where it says something else: that of a large fleet takes a good part of a second.
    """

    def __init__(self, uri: str, timeout: float = 2.0, caller: str = "") -> None:
        self.uri = uri
        self.timeout = timeout
        # a caller id of its own: it shows up in the nodes' logs and connection lists
        self.caller = caller or f"/rosops_fleet_{os.getpid()}"
        self._memo = Memo()
        self._states: dict[bool, tuple[Any, Any, MasterState]] = {}  # with types, without
        self._rest = 0.0  # by time.monotonic; until then it is left alone
        address_of(uri, "http")
        if not (math.isfinite(timeout) and timeout > 0):
            raise RosError(f"a time-out of {timeout} s is not more than 0 s")

    def calls(self, requests: Sequence[Request]) -> list[Any]:
        """Requests (method, caller, *arguments) in one round trip; each result is a value or a RosError."""
        if not requests:
            return []
        try:
            with Api(self.uri, self.caller, Deadline(self.timeout), self._memo) as api:
                return api.calls(requests)
        except Exception as error:
            raise RosError(f"the ROS master does not answer: {reason(error, self.uri, self.timeout)}") from error

    def state(self, types: bool = False) -> MasterState:
        """Who registered what, with the topics' types where they are wanted.

        To say it all takes a master as long as it has to tell, so it is then left alone for as long: many who look at
        a large graph at the same time must not keep it from its work.
        """
        time.sleep(max(0.0, self._rest - time.monotonic()))
        began = time.monotonic()
        results = self.calls([("getSystemState", self.caller), ("getTopicTypes", self.caller)][: 2 if types else 1])
        ended = time.monotonic()
        self._rest = ended + min(ended - began, self.timeout)
        for result in results:
            if isinstance(result, RosError):
                raise RosError(f"the ROS master at {self.uri} is not one: {result}") from result
        return self.state_of(*results)

    def state_of(self, system_state: Any, types: Any = None) -> MasterState:
        """The state that these values of the master's replies are. The same values as before are the same object."""
        known = self._states.get(types is None)
        if known is None or known[0] is not system_state or known[1] is not types:
            known = self._states[types is None] = (system_state, types, master_state(system_state, types))
        return known[2]

    def look_up(self, nodes: Iterable[str], services: Iterable[str] = ()) -> tuple[Data, Data]:
        """Addresses of nodes and services; a RosError in place of one that is not to be had."""
        requests = [
            *(("lookupNode", self.caller, name) for name in nodes),
            *(("lookupService", self.caller, name) for name in services),
        ]
        found: dict[str, Data] = {"lookupNode": {}, "lookupService": {}}
        for (method, _caller, name), result in zip(requests, self.calls(requests)):
            found[method][name] = result if isinstance(result, (str, RosError)) else RosError("it has no address")
        return found["lookupNode"], found["lookupService"]

    def addresses(self, nodes: Iterable[str], services: Iterable[str] = ()) -> tuple[dict[str, str], dict[str, str]]:
        """The addresses that there are."""
        found = self.look_up(nodes, services)
        return tuple({name: uri for name, uri in part.items() if isinstance(uri, str)} for part in found)  # type: ignore[return-value] # two of them
