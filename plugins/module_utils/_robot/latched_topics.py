# SPDX-License-Identifier: GPL-3.0-or-later
"""What stopped nodes had latched, taken from them and given to who comes later: what `latched` decides, done.

Messages lie in files beside the keeper's kept ones. Nothing is asked, and no thread runs, while none is kept.
"""

from __future__ import annotations

import contextlib
import os
import selectors
import socket
import threading
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Callable

from .._common.errors import RosError
from .._ros.backend import MasterState
from .._ros.latched import Ear, give, take
from .._ros.raw_node import SEND_SECONDS, Publication, Slave
from .._ros.registrar import Registrar
from .._ros.replies import connections, topic_types
from .._ros.rpc import Api, Deadline, Request, in_parallel, reason
from .latched import DROP, OFFER, Value, as_kept, from_kept, worth_keeping
from .memory import KeptFiles, boot_of_host

PART = "latched"  # of the kept files
MESSAGE, TOTAL = 8 << 20, 32 << 20  # bytes; their volume has 64 MiB
LOOK = 1.0  # seconds between looks at the master; or so many times as long as a look took, up to these seconds:
SHARE, MOST = 10, 10.0
CONNECT = 2.0


@dataclass(eq=False)
class LatchedTopics:
    """All values that are kept."""

    ros: Registrar
    slave: Slave
    files: KeptFiles
    log: Callable[[str], None]
    now: Callable[[], float] = time.monotonic

    def __post_init__(self) -> None:
        self.caller = f"{self.slave.name}_latched"
        self.directory = self.files.directory / PART
        self.values: dict[tuple[str, str], Value] = {}
        self.ears: dict[tuple[str, str], Ear] = {}
        self.given: set[str] = set()  # topics that we have at the master, as far as it was told
        self.taking: dict[Path, int] = {}  # files that are written just now, with their sizes
        self.thread: threading.Thread | None = None
        self.lock = threading.RLock()

    def resume(self) -> None:
        """Go on after a restart; files that nobody knows of go."""
        content = self.files.load(PART)
        known = from_kept(content)
        kept = {value.file: value for value in known if content.get("boot") == boot_of_host()}
        for file in self.directory.glob("*"):
            value = kept.get(file.name)
            if value is not None and value.size == file.stat().st_size:
                self.values[value.key] = value
            else:
                file.unlink()
        self.given = {value.topic for value in known}
        if self.values:
            self.log(f"still keeps what was latched on {', '.join(sorted(topic for topic, _node in self.values))}")
        if known:
            self._begin()

    # ---- the call

    def keep(self, node: str, uri: str, seconds: float) -> list[Any]:
        """Keep what the node, which is about to end, has latched; how many topics, or why not all of them."""
        try:
            deadline = Deadline(seconds)
            with Api(uri, self.caller, deadline) as api:
                published = topic_types(api.call("getPublications"))
                topics = worth_keeping(published, topic_types(api.call("getSubscriptions")))
                found, problems = self._take(topics, uri, deadline.left())
                edges = connections(api.call("getBusInfo")) if found else ()
        except Exception as error:  # of a node that ends just now, or answers nonsense
            return [0, reason(error, uri, seconds), 0]
        for topic, (header, file) in found.items():
            had = {edge.peer: "" for edge in edges if edge.topic == topic and edge.direction == "o"}
            size = file.stat().st_size
            self._add(Value(topic, str(node), uri, header, file.name, size, had))
            self.log(f"keeps what {node} latched on {topic}, {size} bytes")
        if found:
            self._save()
            self._begin()
        return [0 if problems else 1, "; ".join(problems), len(found)]

    def _take(
        self, topics: list[str], uri: str, seconds: float
    ) -> tuple[dict[str, tuple[dict[str, str], Path]], list[str]]:
        """Topic -> header and file of what is latched; and what went wrong."""
        if not topics:
            return {}, []
        self.directory.mkdir(exist_ok=True)
        files = {topic: self.directory / os.urandom(8).hex() for topic in topics}
        with self.lock:
            self.taking.update(dict.fromkeys(files.values(), 0))
        tasks: dict[Any, Callable[[], Any]] = {
            topic: partial(take, topic, uri, self.caller, file, partial(self._reserve, file), seconds)
            for topic, file in files.items()
        }
        results = in_parallel(tasks, seconds, lambda topic, error: f"{topic}: {reason(error, uri, seconds)}")
        with self.lock:
            self.taking = {file: size for file, size in self.taking.items() if file not in files.values()}
        found = {topic: (result, files[topic]) for topic, result in results.items() if isinstance(result, dict)}
        for topic in set(files) - set(found):
            with contextlib.suppress(OSError):
                files[topic].unlink()
        return found, [result for result in results.values() if isinstance(result, str)]

    def _reserve(self, file: Path, _topic: str, size: int) -> None:
        with self.lock:
            if file not in self.taking:
                raise RosError("it came too late")
            used = sum(self.taking.values()) + sum(value.size for value in self.values.values())
            if size > MESSAGE or used + size > TOTAL:
                raise RosError(f"{size} bytes, of {MESSAGE} for a message and {TOTAL - used} left for all")
            self.taking[file] = size

    def _add(self, value: Value) -> None:
        with self.lock:
            before = self.values.get(value.key)
            if before is not None:
                self._forget(before)
            self.values[value.key] = value

    def _forget(self, value: Value) -> None:
        del self.values[value.key]
        with contextlib.suppress(OSError):
            (self.directory / value.file).unlink()

    def _save(self) -> None:
        with self.lock:  # a call that keeps more must not write the file at the same time
            self.files.save(PART, as_kept(self.values.values(), boot_of_host()))

    def of(self, topic: str) -> list[Value]:
        return [value for value in self.values.values() if value.topic == topic]

    # ---- the loop

    def _begin(self) -> None:
        with self.lock:
            if self.thread is None:
                self.thread = threading.Thread(target=self._run, daemon=True, name=PART)
                self.thread.start()

    def _run(self) -> None:
        due = 0.0
        with selectors.DefaultSelector() as selector:
            while not self._is_done():
                try:
                    began = self.now()
                    if began < due:
                        self.hear(selector, due - began)
                        continue
                    due = began + LOOK
                    self.look(selector)
                    due = self.now() + max(LOOK, min(SHARE * (self.now() - began), MOST))
                except RosError:
                    pass  # the keeper says so itself, and brings back what was registered
                except Exception as error:  # whatever one look brings, the next one may be better
                    self.log(f"latched topics: {type(error).__name__}: {error}")
                    time.sleep(LOOK)

    def _is_done(self) -> bool:
        with self.lock:
            done = not (self.values or self.ears or self.given)
            if done:
                self.thread = None
            return done

    def look(self, selector: selectors.BaseSelector) -> None:
        """At who publishes and subscribes now, and what follows from that."""
        state = self.ros.state()
        with self.lock:
            values = list(self.values.values())
            had = {one for value in values for one in value.had}
        names = {value.topic: set(state.publishers.get(value.topic, ())) - {self.slave.name} for value in values}
        uris = self.ros.addresses(sorted(had.union(*names.values())))[0]
        publishers = {topic: {one: uris[one] for one in found if one in uris} for topic, found in names.items()}
        with self.lock:
            for value in values:
                value.place(publishers[value.topic], uris)
        going = {value.uri for value in values}
        self._listen(selector, {(topic, uri) for topic in names for uri in {*publishers[topic].values()} - going})
        self._judge()
        with self.lock:
            for value in values:
                if self.values.get(value.key) is not value:
                    continue
                order = value.step(publishers[value.topic], state.subscribers.get(value.topic, ()), self.now())
                value.offered = order == OFFER
                if order == DROP:
                    self.log(f"lets go what {value.node} latched on {value.topic}: nobody came in its place")
                    self._forget(value)
        self._offer(state)
        self._save()

    def _listen(self, selector: selectors.BaseSelector, wanted: set[tuple[str, str]]) -> None:
        """Be connected to these publishers, by topic and address, and to no others."""
        for key in [key for key in self.ears if key not in wanted]:
            self._close(selector, key)
        missing = wanted - self.ears.keys()
        tasks: dict[Any, Callable[[], Any]] = {key: partial(Ear, *key, self.caller, CONNECT) for key in missing}
        for key, ear in in_parallel(tasks, CONNECT, lambda _key, _error: None).items():
            if ear is not None:
                self.ears[key] = ear
                selector.register(ear.sock, selectors.EVENT_READ, key)

    def _close(self, selector: selectors.BaseSelector, key: tuple[str, str]) -> None:
        ear = self.ears.pop(key)
        selector.unregister(ear.sock)
        ear.sock.close()

    def hear(self, selector: selectors.BaseSelector, seconds: float) -> None:
        for ready, _events in selector.select(seconds):
            if not self.ears[ready.data].listen():
                self._close(selector, ready.data)
        self._judge()

    def _judge(self) -> None:
        """Let go what has been followed by something newer; at once, as two of it would be there else."""
        with self.lock:
            for ear in self.ears.values():
                for value in self.of(ear.topic):
                    other = ear.md5sum not in ("*", value.header["md5sum"])
                    if value.is_over(ear.uri, ear.heard or other, ear.news):
                        self.log(f"lets go what {value.node} latched on {value.topic}: {ear.uri} has its own")
                        self._forget(value)
            followed = not all(map(self.of, self.given))
        if followed:
            self._offer(None)

    def _offer(self, state: MasterState | None) -> None:
        """Publish what is offered, and nothing else. `state`: where it is to be seen whether the master knows."""
        with self.lock:
            offered = {value.topic: value for value in self.values.values() if value.offered}
            new = [topic for topic in offered if topic not in self.slave.publications]
            for topic in new:
                self.slave.add(LatchedPublication(offered[topic], self))
            over = sorted(self.given - offered.keys())
            self.given.update(offered)
        for topic in new:
            self.log(f"gives what {offered[topic].node} latched on {topic} to who subscribes to it from now on")
        own, uri = self.slave.name, self.slave.uri
        unlisted = [topic for topic in offered if state is not None and own not in state.publishers.get(topic, ())]
        calls: list[Request] = [
            ("registerPublisher", own, topic, offered[topic].header["type"], uri) for topic in unlisted
        ]
        calls += [("unregisterPublisher", own, topic, uri) for topic in over]
        try:
            self.ros.calls(calls)
            self.given -= set(over)
        finally:
            for topic in over:
                self.slave.unadvertise(topic)


class LatchedPublication(Publication):
    """A topic on which each subscriber, in a thread of its own, gets what is kept, and nothing more."""

    def __init__(self, value: Value, owner: LatchedTopics) -> None:
        super().__init__(value.topic, {**value.header, "latching": "1"})
        self.owner = owner

    def welcome(self, sock: socket.socket, caller: str) -> None:
        owner, uri = self.owner, ""
        with contextlib.suppress(RosError):
            uri = owner.ros.addresses([caller])[0].get(caller, "")
        with owner.lock:
            values = [value for value in owner.of(self.topic) if value.offered]
            due = [value for value in values if value.is_due(caller, uri) and not self.refusal(value.header)]
            for value in values:
                value.had[caller] = uri or value.had.get(caller, "")
        try:
            for value in due:
                give(owner.directory / value.file, sock, SEND_SECONDS)
        except OSError:
            self.left(caller)
            raise

    def left(self, caller: str) -> None:
        """Who subscribes again has it no more."""
        with self.owner.lock:
            for value in self.owner.of(self.topic):
                value.had.pop(caller, None)
