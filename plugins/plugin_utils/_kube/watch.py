# SPDX-License-Identifier: GPL-3.0-or-later
"""Follow many lists of one cluster at once: a thread per list, one queue for what they have to tell."""

from __future__ import annotations

import contextlib
import queue
import socket
import threading
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from ...module_utils._common.documents import json_of
from ...module_utils._step.objects import Object
from .access import BROKEN
from .cache import Ref
from .connection import FIRST_PAUSE, LONGEST_PAUSE, ApiConnection, ApiError

# The server ends a watch after that time and it begins anew. So a link that died without a word is noticed READ_SLACK
# later, and not after the operating system's quarter of an hour.
WATCH_SECONDS = 25
READ_SLACK = 10.0
JOIN_SECONDS = 1.0
MAX_EVENT = 16 * 1024 * 1024  # bytes; etcd takes no object of a tenth of it
# A server that is coming up may refuse what it accepts a moment later (403 before its roles are loaded). So credentials
# that have worked are given up only after that many refusals in a row, which takes about 11 seconds.
REFUSALS_BORNE = 8


@dataclass(frozen=True)
class StreamEvent:
    """What a stream has to tell.

    `listed`: these are all objects of the target now, and the connection is up; `set`, `gone`: one object; `lost`: the
    connection is down and being retried; `refused`: this stream is over.
    """

    what: str
    target: Ref
    objects: list[Object] = field(default_factory=list)
    error: ApiError | None = None


def _hang_up(answer: Any) -> None:
    """Wake a thread that reads from this answer. Closing it from here would wait for that very read."""
    with contextlib.suppress(OSError, AttributeError, ValueError):  # already over
        answer.connection.sock.shutdown(socket.SHUT_RDWR)


def _lines(answer: Any) -> Iterator[bytes]:
    rest = b""
    for chunk in answer.stream(65536):
        *whole, rest = (rest + chunk).split(b"\n")
        yield from (line for line in whole if line.strip())
        if len(rest) > MAX_EVENT:
            raise ValueError(f"an event has more than {MAX_EVENT} bytes")


class Watch:
    """Follows all targets at once, each in a thread of its own, and hands their changes over one queue.

    A target is listed and then watched from there. Whatever ends that, be it time, a connection that broke or a place
    that the server has forgotten (410 Gone), it begins anew with a list. Use it as a context, which ends the threads.
    """

    def __init__(self, kube: ApiConnection, targets: Iterable[Ref]) -> None:
        self._kube = kube
        self._changes: queue.Queue[StreamEvent] = queue.Queue()
        self._over = threading.Event()
        self._answers: dict[Ref, Any] = {}
        self._threads: list[threading.Thread] = []
        self._targets = list(targets)

    def __enter__(self) -> Watch:
        for target in self._targets:
            thread = threading.Thread(target=self._run, args=(target,), name=f"watch {target.path}", daemon=True)
            self._threads.append(thread)
            thread.start()
        return self

    def __exit__(self, *unused: object) -> None:
        self._over.set()
        for answer in list(self._answers.values()):
            _hang_up(answer)
        for thread in self._threads:
            thread.join(JOIN_SECONDS)

    def changes(self, timeout: float) -> list[StreamEvent]:
        """Everything that is new; waits for the first change, at most `timeout` seconds."""
        with contextlib.suppress(queue.Empty):
            first = self._changes.get(timeout=max(timeout, 0.0))
            return [first, *(self._changes.get() for _more in range(self._changes.qsize()))]  # nobody else takes any
        return []

    def _tell(self, what: str, target: Ref, *objects: Object, error: ApiError | None = None) -> None:
        self._changes.put(StreamEvent(what, target, list(objects), error))

    def _run(self, target: Ref) -> None:
        """A thread that dies without a word would leave the wait blind, so whatever ends it is told."""
        try:
            self._follow(target)
        except Exception as exc:
            if not self._over.is_set():
                error = exc if isinstance(exc, ApiError) else ApiError(f"Watching {target.path} broke: {exc!r}")
                self._tell("refused", target, error=error)

    def _follow(self, target: Ref) -> None:
        pause, worked, refusals = FIRST_PAUSE, False, 0
        while not self._over.is_set():
            try:
                items, version = self._kube.page(target.path)
                worked = True
                self._tell("listed", target, *items)
                answer = self._open(target, version)
                pause, refusals = FIRST_PAUSE, 0
                self._stream(target, answer)
                self._over.wait(pause)  # a server that ends each watch at once must not make us spin
            except ApiError as exc:
                refusals += exc.status in (401, 403)
                borne = worked and 0 < refusals <= REFUSALS_BORNE
                if not (exc.transient or borne):
                    raise
                if not self._over.is_set():
                    self._tell("lost", target, error=exc)
                self._over.wait(pause)
                pause = min(pause * 2, LONGEST_PAUSE)

    def _open(self, target: Ref, version: str) -> Any:
        query = {"watch": "1", "resourceVersion": version, "timeoutSeconds": str(WATCH_SECONDS)}
        answer = self._kube.request("GET", target.path, query, read_seconds=WATCH_SECONDS + READ_SLACK)
        self._answers[target] = answer
        if self._over.is_set():
            _hang_up(answer)
        return answer

    def _stream(self, target: Ref, answer: Any) -> None:
        """Tell what comes in, to its end. What breaks it is not worth a word: the list that follows tells the truth."""
        try:
            with contextlib.suppress(*BROKEN, ValueError, KeyError, TypeError):  # cut off, or no watch event at all
                for line in _lines(answer):
                    event = json_of(line)
                    kind, obj = event["type"], event["object"]
                    if kind == "ERROR" and obj.get("code") != 410:
                        raise ApiError(f"Watching {self._kube.host}{target.path}: {obj.get('message')}", transient=True)
                    if kind not in ("ADDED", "MODIFIED", "DELETED"):
                        return
                    self._tell("gone" if kind == "DELETED" else "set", target, obj)
        finally:
            self._answers.pop(target, None)
            answer.close()
