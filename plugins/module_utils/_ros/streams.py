# SPDX-License-Identifier: GPL-3.0-or-later
"""Connections that carry ROS 1's data: a service's handshake, and a topic's messages, counted or handed on one by one.

None of them is registered: nobody's list of subscribers changes, and no service is called.
"""

from __future__ import annotations

import contextlib
import selectors
import socket
import threading
import time
from functools import partial
from typing import Any, Callable, Collection, Mapping, Tuple

from .._common.errors import RosError
from .arrivals import LOOK_INTERVALS, Arrivals
from .graph import NodeKey, Rate
from .rpc import Api, Deadline, TimedSocket, address_of, connect, in_parallel, reason
from .tcpros import STATUS_TYPE, FrameCounter, decode_header, decode_status, encode_header

MAX_HEADER = 1024 * 1024  # a handshake carries the message definition
MAX_STATUS = 4 * 1024 * 1024
TICK = 0.005  # read a stream in batches: waking up for each message would cost the robot's CPU
MAX_MESSAGE = 64 * 1024 * 1024
SILENCE = 86400.0  # a stream that is silent for a day is connected anew


def read_exactly(sock: TimedSocket, size: int) -> bytes:
    data = bytearray()
    while len(data) < size:
        part = sock.recv(min(size - len(data), 1 << 16))
        if not part:
            raise RosError("the connection was closed" + (" in the middle of a message" if data else ""))
        data += part
    return bytes(data)


def read_frame(sock: TimedSocket, limit: int) -> bytes:
    size = int.from_bytes(read_exactly(sock, 4), "little")
    if size > limit:
        raise RosError(f"a message of {size} bytes, more than {limit}")
    return read_exactly(sock, size)


def handshake(sock: TimedSocket, fields: Mapping[str, str]) -> dict[str, str]:
    """Send our header and read the peer's. A peer that does not know what we ask for says so in a field `error`."""
    sock.sendall(encode_header(fields))
    reply = decode_header(read_frame(sock, MAX_HEADER))
    if "error" in reply:
        raise RosError(f"refused: {reply['error'][:200]}")
    return reply


def greet(service: str, uri: str, caller: str, deadline: Deadline) -> dict[str, str]:
    """Shake hands as a client does before a call; the service's header. The service itself is not called."""
    with connect(*address_of(uri, "rosrpc"), deadline) as sock:
        return handshake(sock, {"callerid": caller, "service": service, "md5sum": "*", "probe": "1"})


def subscribe(topic: str, uri: str, caller: str, deadline: Deadline) -> tuple[TimedSocket, dict[str, str]]:
    """A connection on which the node at `uri` sends the topic's messages from now on, and its header."""
    with Api(uri, caller, deadline) as api:
        transport = api.call("requestTopic", topic, [["TCPROS"]])
    if not (isinstance(transport, list) and transport[:1] == ["TCPROS"] and len(transport) >= 3):
        raise RosError(f"it offers no TCPROS for {topic}")
    host, port = transport[1:3]
    if not isinstance(host, str) or not isinstance(port, int) or not 0 < port < 65536:
        raise RosError(f"it offers {topic} at {host!r}, port {port!r}")
    sock = connect(host, port, deadline)
    try:
        fields = {"callerid": caller, "topic": topic, "md5sum": "*", "type": "*", "tcp_nodelay": "1"}
        header = handshake(sock, fields)
        sock.opened = time.monotonic()
        return sock, header
    except BaseException:
        sock.close()
        raise


def subscribe_status(action: str, uri: str, caller: str, deadline: Deadline) -> TimedSocket:
    """A connection on which an action server sends its status: the latched one, and then 5 a second."""
    sock, header = subscribe(f"{action}/status", uri, caller, deadline)
    found = header.get("type", STATUS_TYPE)
    if found != STATUS_TYPE:
        sock.close()
        raise RosError(f"{action}/status carries {found}, not {STATUS_TYPE}")
    return sock


def read_states(sock: TimedSocket) -> tuple[int, ...]:
    """The goals' states in the next status."""
    return tuple(state for _goal, state in decode_status(read_frame(sock, MAX_STATUS)))


# ---- messages one by one


class TopicStream(threading.Thread):
    """The messages of one publisher, handed to `receive` one by one, until it ends or is closed."""

    def __init__(self, caller: str, topic: str, uri: str, receive: Callable[[bytes], None]) -> None:
        super().__init__(daemon=True, name=f"{topic} {uri}")
        self.caller, self.topic, self.uri, self.receive = caller, topic, uri, receive
        self.header: dict[str, str] = {}
        self.open = False
        self.sock: TimedSocket | None = None

    def connect(self, seconds: float) -> None:
        """Shake hands; after that, the publisher sends us everything."""
        self.sock, self.header = subscribe(self.topic, self.uri, self.caller, Deadline(seconds))
        self.open = True
        self.start()

    def run(self) -> None:
        if self.sock is None:  # only for the type checker: start() comes after the connection
            return
        try:
            while self.open:
                self.sock.deadline = Deadline(SILENCE)
                self.receive(read_frame(self.sock, MAX_MESSAGE))
        except (OSError, RosError):
            pass
        finally:
            self.open = False
            self.sock.close()

    def close(self) -> None:
        self.open = False
        if self.sock is not None:
            with contextlib.suppress(OSError):
                self.sock.shutdown(socket.SHUT_RDWR)


Source = Tuple[str, str, Any]  # topic, publisher, and its address or the error that stands in its place


class Streams:
    """The streams of many publishers, which stay open from look to look until their publisher goes."""

    def __init__(
        self,
        caller: str,
        seconds: float,
        took: Callable[[Source, Mapping[str, str], bytes], None],
        left: Callable[[Source], None] = lambda _source: None,
    ) -> None:
        """`took` gets each message, with its publisher's header, `left` whose stream is over; `seconds` to open one."""
        self.caller, self.seconds, self.took, self.left = caller, seconds, took, left
        self.open: dict[Source, TopicStream] = {}
        self.wanted: Collection[Source] = ()

    def keep(self, sources: Collection[Source]) -> dict[Source, str]:
        """Have one of each of these, and no others; who cannot be heard, and why.

        Where nothing listens any more nobody speaks, so of that nothing is said.
        """
        self.wanted = sources
        for source, stream in list(self.open.items()):  # to which one that answers late may still be added
            if source not in sources or not stream.open:
                self.open.pop(source).close()
                self.left(source)

        def failed(source: Source, error: BaseException) -> str:
            return "" if isinstance(error, ConnectionRefusedError) else reason(error, str(source[2]), self.seconds)

        tasks = {source: partial(self._connect, source) for source in sources if source not in self.open}
        return {source: why for source, why in in_parallel(tasks, self.seconds, failed).items() if why}

    def _connect(self, source: Source) -> str:
        topic, _publisher, uri = source
        if isinstance(uri, RosError):
            raise uri
        stream = TopicStream(self.caller, topic, uri, lambda body: self.took(source, stream.header, body))
        stream.connect(self.seconds)
        if self.open.setdefault(source, stream) is not stream or source not in self.wanted:
            stream.close()  # it came late
        return ""


# ---- messages counted

Opened = Tuple[TimedSocket, Mapping[str, str]]  # a topic's stream and the publisher's header


def count_messages(
    streams: Mapping[tuple[str, NodeKey], Opened], seconds: Mapping[str, float], patient: bool = False
) -> dict[tuple[str, NodeKey], Rate]:
    """Read all streams, by topic and publisher, until each topic's time is over. One thread; messages are skipped.

    A stream's time begins when it was opened: what it sent while others were still being opened (one dead peer takes
    its whole time-out) waits here and belongs to that time. If `patient`, a stream whose messages come slowly, but do
    come, is read until they are enough to know a rate.
    """
    counted = {key: _Counted(*opened) for key, opened in streams.items()}
    buffer = memoryview(bytearray(1 << 18))
    rates: dict[tuple[str, NodeKey], Rate] = {}
    with selectors.DefaultSelector() as selector:
        for key, stream in counted.items():
            stream.sock.setblocking(False)
            selector.register(stream.sock, selectors.EVENT_READ, key)
            if not stream.drain(buffer):
                _leave(selector, stream.sock)
        start = time.monotonic()
        while True:
            at = time.monotonic()
            for key in [key for key in counted if key not in rates and start + seconds[key[0]] <= at]:
                stream = counted[key]
                if not (patient and stream.arrivals.undecided(stream.sock.opened, at)):
                    rates[key] = stream.rate(start, at)
                    _leave(selector, stream.sock)
            if len(rates) == len(counted):
                return rates
            for ready, _events in selector.select(timeout=TICK * 4):
                stream = counted[ready.data]
                if not stream.drain(buffer):
                    _leave(selector, stream.sock)  # the rest of its window is silence
            time.sleep(TICK)


class _Counted:
    """A stream whose messages are counted."""

    def __init__(self, sock: TimedSocket, header: Mapping[str, str]) -> None:
        self.sock = sock
        self.frames = FrameCounter()
        # both client libraries say it, with 0 or 1
        self.arrivals = Arrivals(header["latching"] == "1" if "latching" in header else None)

    def drain(self, buffer: memoryview) -> bool:
        """Take what has arrived; False at the stream's end."""
        for _read in range(16):  # one fast stream must not keep the others waiting
            try:
                size = socket.socket.recv_into(self.sock, buffer)
            except (BlockingIOError, InterruptedError):
                return True
            except OSError:
                return False
            if not size:
                return False
            self.arrivals.add(time.monotonic(), self.frames.feed(buffer[:size]))
            if size < len(buffer):
                return True
        return True

    def rate(self, start: float, end: float) -> Rate:
        """What came until `end`; nobody read before `start`."""
        found, began = self.arrivals, self.sock.opened
        latched, few = bool(found.latching and found.times), len(found.counted) <= LOOK_INTERVALS
        counted = found.hz(began, end), len(found.times), end - began
        return Rate(*counted, known=found.known(start, end), latched=latched, few=few)


def _leave(selector: selectors.BaseSelector, sock: TimedSocket) -> None:
    if sock.fileno() >= 0:
        selector.unregister(sock)
        sock.close()


def hang_up(sock: socket.socket) -> None:
    """End a connection, or a listener, that another thread may be waiting on."""
    with contextlib.suppress(OSError):
        sock.shutdown(socket.SHUT_RDWR)
    sock.close()
