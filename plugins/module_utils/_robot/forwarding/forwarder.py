# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""One action's hold on the network: what `rules` decides, done; docs/goal-forwarding.md tells how."""

from __future__ import annotations

import threading
import time
from dataclasses import replace
from functools import partial
from typing import Any, Iterable, Mapping, Protocol

from ..._common.errors import RosError
from ..._ros.raw_node import Slave
from ..._ros.registrar import Registrar
from ..._ros.replies import connections
from ..._ros.rpc import Api, Deadline, in_parallel, reason, tell_publishers
from ..._ros.streams import TopicStream
from ..._ros.tcpros import (
    CANCEL_DEFINITION,
    CANCEL_MD5SUM,
    CANCEL_TYPE,
    cancel_id,
    decode_status,
    encode_cancel,
    goal_id,
)
from . import rules
from .rules import Goal, Hold, Order, Sight

TICK = 0.05
LOOK = 0.1  # between looks at the master while goals are held
STAYS = 0.3  # between looks whether a server's version may still go back
CONNECT = 2.0
AGAIN = 0.3  # between attempts to connect to the same publisher
AWAY = 1.0  # before the next look at a master that does not answer
KEEP = 5.0  # between writes of a hold of which nothing is new but the seconds to go
INTRODUCE = 1.0  # between tellings of a server that is not connected to all of its clients, or to us
FIELDS = ("type", "md5sum", "message_definition")
CANCEL_HEADER = dict(zip(FIELDS, (CANCEL_TYPE, CANCEL_MD5SUM, CANCEL_DEFINITION)))

# what a stream is for
GOALS, TAKEN, CANCELS, STATUS = "goals", "taken", "cancels", "status"


class Participants:
    """By the master's word: name -> address of clients, who cancels, who publishes a status, and whole servers."""

    def __init__(self, action: str, ros: Registrar, own: str) -> None:
        state = ros.state()
        published, subscribed = state.publishers, state.subscribers
        names = {part: published.get(f"{action}/{part}", ()) for part in ("goal", "cancel", "status")}
        everyone = sorted({name for found in names.values() for name in found} - {own})
        uris = ros.addresses(everyone)[0]
        self.clients, self.cancellers, self.status = (
            {name: uris[name] for name in names[part] if name in uris} for part in ("goal", "cancel", "status")
        )
        whole = set(subscribed.get(f"{action}/goal", ())) & set(subscribed.get(f"{action}/cancel", ()))
        self.servers = {name: uri for name, uri in self.status.items() if name in whole}
        self.listed = own in published.get(f"{action}/goal", ())
        self.hears = {
            topic: set(subscribed.get(topic, ())) & set(self.clients)
            for topic in (f"{action}/result", f"{action}/status")
        }


class Owner(Protocol):
    """Whom a hold belongs to: calls.GoalForwarding."""

    ros: Registrar
    slave: Slave
    name: str
    lock: Any

    def log(self, text: str, /) -> None: ...

    def save(self) -> None: ...

    def stays(self, action: str, server: str, /) -> bool: ...

    def ended(self, forwarder: Forwarder) -> None: ...


class Forwarder(threading.Thread):
    """One action's hold, from its begin to its end."""

    def __init__(self, hold: Hold, header: Mapping[str, str], keeper: Owner) -> None:
        super().__init__(daemon=True, name=f"hold {hold.action}")
        self.hold, self.header, self.keeper = hold, dict(header), keeper
        self.ros, self.slave = keeper.ros, keeper.slave
        self.lock = keeper.lock  # one for all: whoever saves reads every hold
        self.wake = threading.Event()
        self.streams: dict[tuple[str, str], TopicStream] = {}
        self.tried: dict[tuple[str, str], float] = {}
        self.pending: set[tuple[str, str]] = set()
        self.complained: set[tuple[str, str]] = set()
        self.scene: Participants | None = None
        self.advertised = False
        self.over = self.dirty = False
        self.introduced = self.asked = self.kept = 0.0
        self.stayer = ""  # the address of the server that stays
        self.senders: frozenset[str] = frozenset()  # clients that the server of now is connected to

    def log(self, text: str) -> None:
        self.keeper.log(f"goals of {self.hold.action}: {text}")

    # ---- streams

    def wanted(self) -> dict[tuple[str, str], tuple[str, str, str]]:
        """Streams that there should be: (role, address) -> caller id, topic, publisher's name."""
        scene, action = self.scene, self.hold.action
        if scene is None:
            return {}
        own, found = self.keeper.name, {}
        for name, uri in scene.clients.items():
            found[GOALS, uri] = (own, f"{action}/goal", name)
            # first in our own name: from then on nothing can pass us by
            if self.hold.taking and self.is_open((GOALS, uri)):
                found[TAKEN, uri] = (self.hold.node, f"{action}/goal", name)
        found.update({(CANCELS, uri): (own, f"{action}/cancel", name) for name, uri in scene.cancellers.items()})
        found.update({(STATUS, uri): (own, f"{action}/status", name) for name, uri in scene.status.items()})
        return found

    def is_open(self, key: tuple[str, str]) -> bool:
        return key in self.streams and self.streams[key].open

    def connect(self) -> int:
        """Start to open what is missing, forget what has ended; how many clients are not wholly connected yet."""
        wanted, now = self.wanted(), time.monotonic()
        for key in [key for key, stream in self.streams.items() if not stream.open]:
            del self.streams[key]
            self.tried.pop(key, None)
        for key, (caller, topic, _name) in wanted.items():
            if key in self.streams or key in self.pending or now - self.tried.get(key, -AGAIN) < AGAIN:
                continue
            self.pending.add(key)
            self.tried[key] = now
            threading.Thread(target=self._connect, args=(key, caller, topic), daemon=True).start()
        clients = self.scene.clients.values() if self.scene else ()
        return sum(not (self.is_open((GOALS, uri)) and self.is_open((TAKEN, uri))) for uri in clients)

    def _connect(self, key: tuple[str, str], caller: str, topic: str) -> None:
        role, uri = key
        stream = TopicStream(caller, topic, uri, partial(self._received, role, uri))
        try:
            stream.connect(CONNECT)
        except Exception as error:  # whatever a publisher provokes, the next look tries it again
            if key not in self.complained:
                self.complained.add(key)
                self.log(f"{topic} of {uri} is not to be had: {reason(error, uri, CONNECT)}")
        with self.lock:
            self.pending.discard(key)
            if self.over:
                stream.close()
            elif stream.open:
                self.streams[key] = stream
                if role == GOALS:
                    self.header = {field: stream.header.get(field, "") for field in FIELDS}
                if role == TAKEN and not self.hold.taking:
                    self.introduced = 0.0  # too late, and the server has just lost this client: tell it again
        self.wake.set()

    def _received(self, role: str, uri: str, body: bytes) -> None:
        """A message: decoded before the lock is taken, as a busy server's status is long."""
        now = time.monotonic()
        try:
            if role == STATUS:
                listed = decode_status(body)
            elif role == CANCELS:
                identity, stamp = cancel_id(body)
            else:
                identity, stamp = goal_id(body)
        except RosError as error:
            self.log(f"{uri} sent what is none of actionlib's messages: {error}")
            return
        with self.lock:
            if role == STATUS:
                changed = bool(self.hold.status(uri, listed, now))
            elif role == CANCELS:
                meant = self.hold.cancel(identity, stamp)
                changed = bool(meant)
                for goal in meant:
                    self.log(f"{goal} was cancelled while it is held")
            else:
                alone = bool(self.hold.server) and uri not in self.senders
                changed = self.hold.goal(Goal(identity, stamp, body, now, uri, alone))
            self.dirty = self.dirty or changed

    # ---- the server

    def sight(self, now: float) -> Sight:
        """What the network shows of the server that goals should go to."""
        scene, action = self.scene, self.hold.action
        if scene is None:
            return Sight()
        living = {name: uri for name, uri in scene.servers.items() if self.is_open((STATUS, uri))}
        server = self.hold.pick(living, now)
        if not server:
            return Sight()
        name = next(name for name, uri in living.items() if uri == server)
        listening = all(name in self.slave.callers(f"{action}/{part}") for part in ("goal", "cancel"))
        try:
            with Api(server, self.keeper.name, Deadline(CONNECT)) as api:
                edges = connections(api.call("getBusInfo"))
        except Exception as error:
            self.log(f"{name} does not say whom it is connected to: {reason(error, server, CONNECT)}")
            return Sight(server, listening, stays=False)
        out = {(edge.topic, edge.peer) for edge in edges if edge.direction != "i" and edge.connected}
        into = {edge.peer for edge in edges if edge.direction == "i" and edge.topic == f"{action}/goal"}
        living_clients = {client for client, uri in scene.clients.items() if self.is_open((GOALS, uri))}
        ready = all((topic, peer) in out for topic, peers in scene.hears.items() for peer in peers & living_clients)
        ready = ready and not any(role == TAKEN for role, _uri in self.pending)
        uris = set(scene.clients.values())
        direct = bool(self.hold.opened) and uris <= into and uris <= self._sending(uris, name)
        return Sight(server, listening, ready, direct, frozenset(into), self._stays(name, server))

    def _sending(self, clients: Iterable[str], server: str) -> set[str]:
        """The clients that have a connection to the server, by their own word: a subscriber says so before it has one.

        Ours in its name is listed there, too.
        """
        topic = f"{self.hold.action}/goal"

        def connected(uri: str) -> bool:
            ours = server == self.hold.node and self.is_open((TAKEN, uri))
            with Api(uri, self.keeper.name, Deadline(CONNECT)) as api:
                edges = connections(api.call("getBusInfo"))
            return sum((edge.topic, edge.peer, edge.direction) == (topic, server, "o") for edge in edges) > ours

        found = in_parallel({uri: partial(connected, uri) for uri in clients}, CONNECT, lambda _uri, _error: False)
        return {uri for uri, good in found.items() if good}

    def _stays(self, name: str, uri: str) -> bool:
        if uri != self.stayer and time.monotonic() - self.asked >= STAYS:
            self.asked = time.monotonic()
            self.stayer = uri if self.keeper.stays(self.hold.action, name) else self.stayer
        return uri == self.stayer

    def _advertise(self) -> None:
        """Let the server come: it hears of us through the master, as of any client."""
        listed = self.scene is not None and self.scene.listed  # not by a master that was restarted meanwhile
        if (self.advertised and listed) or not self.header.get("md5sum"):
            return
        self.advertised = True
        topics = {f"{self.hold.action}/goal": self.header, f"{self.hold.action}/cancel": CANCEL_HEADER}
        for topic, header in topics.items():
            self.slave.advertise(topic, header)
        own = self.keeper.name
        self.ros.calls([("registerPublisher", own, topic, topics[topic]["type"], self.slave.uri) for topic in topics])

    def _unadvertise(self) -> None:
        if not self.advertised:
            return
        self.advertised = False
        topics = [f"{self.hold.action}/{part}" for part in ("goal", "cancel")]
        try:
            self.ros.calls([("unregisterPublisher", self.keeper.name, topic, self.slave.uri) for topic in topics])
        except RosError as error:
            self.log(f"not unregistered: {error}")
        for topic in topics:
            self.slave.unadvertise(topic)

    def _introduce(self, server: str) -> None:
        """Give the clients back: the server connects to whom it is told publishes."""
        scene = self.scene
        self.introduced = time.monotonic()
        if scene is None:
            return
        own = [self.slave.uri] if self.advertised else []
        told = {"goal": [*scene.clients.values(), *own], "cancel": [*scene.cancellers.values(), *own] if own else []}
        try:
            for topic, uris in told.items():
                if uris:
                    tell_publishers(server, f"{self.hold.action}/{topic}", uris, CONNECT)
        except Exception as error:
            self.log(f"the server was not told of its clients: {reason(error, server, CONNECT)}")

    def do(self, todo: Order) -> None:
        goal, action = todo.goal, self.hold.action
        if todo.kind == rules.ADVERTISE:
            self._advertise()
        elif todo.kind == rules.OPEN:
            self.log(f"a server is up at {self.hold.server}, {len(self.hold.goals)} goals to forward")
            self._introduce(self.hold.server)
        elif todo.kind == rules.CANCEL and goal is not None:
            self.slave.publish(f"{action}/cancel", encode_cancel(goal.id))
            self.log(f"told the server that {goal.id} is cancelled")
        elif todo.kind == rules.SEND and goal is not None:
            reached = self.slave.publish(f"{action}/goal", goal.body)
            if reached:
                self.log(f"forwarded {goal.id}, {time.monotonic() - goal.arrived:.2f} s after it came")
            else:
                goal.sent = None
        elif todo.kind == rules.WARN:
            self.log(f"no new server yet; {len(self.hold.goals)} goals are kept for {rules.KEEP:.0f} s more")
        elif todo.kind == rules.GIVE_UP and goal is not None:
            self.log(f"gave up {goal.id}: no server came")
        elif todo.kind == rules.FINISH:
            self.log(f"let go, {self.hold.forwarded} forwarded")
            self._unadvertise()  # under the lock: the next hold of this action may begin right after
            self.over = True

    # ---- the loop

    def look(self) -> None:
        scene = Participants(self.hold.action, self.ros, self.keeper.name)
        with self.lock:
            self.scene = scene

    def run(self) -> None:
        looked = 0.0
        while not self.over:
            self.wake.wait(TICK)
            self.wake.clear()
            try:
                if time.monotonic() - looked >= LOOK:
                    looked = time.monotonic()
                    self.look()
                self.tick()
            except RosError as error:
                self.log(f"the master is away: {error}")
                time.sleep(AWAY)
            except Exception as error:  # whatever one look brings: without us nobody gives the goals back
                self.log(f"error: {type(error).__name__}: {error}")
                time.sleep(AWAY)
        self.finish()

    def tick(self) -> None:
        with self.lock:
            self.connect()
        sight = self.sight(time.monotonic())
        now = time.monotonic()  # what a look has seen was not so before its end
        with self.lock:
            if sight.server != self.hold.server:
                self._unadvertise()  # connections of a former server are no way to this one
                sight = replace(sight, connected=False)
            self.senders = sight.senders
            for todo in self.hold.step(sight, now):
                self.do(todo)
            if self.dirty or now - self.kept > KEEP:
                self.dirty, self.kept = False, now
                self.keeper.save()
        whole = sight.direct and (sight.connected or not self.advertised)
        if self.hold.opened and not whole and time.monotonic() - self.introduced > INTRODUCE:
            self._introduce(self.hold.server)

    def finish(self) -> None:
        with self.lock:
            for stream in self.streams.values():
                stream.close()
        self.keeper.ended(self)
