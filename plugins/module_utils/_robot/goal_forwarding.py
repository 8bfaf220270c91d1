# SPDX-License-Identifier: GPL-3.0-or-later
"""Goal forwarding: the keeper's calls hold, release and state, and what `goal_rules` decides, done on the network.

docs/goal-forwarding.md is its manual.
"""

from __future__ import annotations

import math
import threading
import time
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Callable, Iterable, Mapping, Sequence

from .._common.errors import RosError
from .._ros import tcpros
from .._ros.backend import MasterState
from .._ros.latched import FIELDS
from .._ros.raw_node import Slave
from .._ros.registrar import Registrar
from .._ros.replies import connections
from .._ros.rpc import Api, Deadline, in_parallel, reason, tell_publishers
from .._ros.streams import TopicStream
from . import goal_rules as rules
from .goal_rules import Goal, Hold, Order, Sight
from .memory import boot_of_host

TICK = 0.05
LOOK = 0.1  # between looks at the master while goals are held
STAYS = 0.3  # between looks whether a server's version may still go back
CONNECT = 2.0
AGAIN = 0.3  # between attempts to connect to the same publisher
AWAY = 1.0  # before the next look at a master that does not answer
KEEP = 5.0  # between writes of a hold of which nothing is new but the seconds to go
INTRODUCE = 1.0  # between tellings of a server that is not connected to all of its clients, or to us
RETRY = 1.0  # seconds between attempts to write what could not be written
FIRST = 3.0  # seconds for all clients to be connected before a hold is confirmed
CANCEL_HEADER = dict(zip(FIELDS, (tcpros.CANCEL_TYPE, tcpros.CANCEL_MD5SUM, tcpros.CANCEL_DEFINITION)))

# what a stream is for
GOALS, CANCELS, STATUS, TAKEN = "goal", "cancel", "status", "taken"  # a part of the action; its goals once more
DECODERS: Mapping[str, Callable[[bytes], Any]] = {STATUS: tcpros.decode_status, CANCELS: tcpros.cancel_id}  # else goals

Calls = Mapping[str, Callable[..., "list[Any]"]]  # each answers [code, message, value], as the slave API does
OFF = "goal forwarding is switched off (ros_master_goal_forwarding)"
# It holds nothing and says so: whoever asked goes on without.
SWITCHED_OFF: Calls = {"hold": lambda *_: [0, OFF, 0], "release": lambda _: [1, OFF, 0], "state": lambda: [1, OFF, {}]}


class Participants:
    """By the master's word: name -> address of clients, who cancels, who publishes a status, and whole servers."""

    def __init__(self, action: str, ros: Registrar, own: str, state: MasterState) -> None:
        names = {part: state.publishers.get(f"{action}/{part}", ()) for part in (GOALS, CANCELS, STATUS)}
        uris = ros.addresses(sorted({name for found in names.values() for name in found} - {own}))[0]
        self.nodes = {part: {name: uris[name] for name in found if name in uris} for part, found in names.items()}
        self.clients, self.cancellers, self.status = self.nodes.values()
        self.servers = {name: self.status[name] for name in state.servers(action) if name in self.status}
        self.listed = own in names[GOALS]
        answers = (f"{action}/result", f"{action}/status")
        self.hears = {topic: set(state.subscribers.get(topic, ())) & set(self.clients) for topic in answers}


class Forwarder(threading.Thread):
    """One action's hold, from its begin to its end."""

    def __init__(self, hold: Hold, header: Mapping[str, str], keeper: GoalForwarding) -> None:
        super().__init__(daemon=True, name=f"hold {hold.action}")
        self.hold, self.header, self.keeper = hold, dict(header), keeper
        self.topics = f"{hold.action}/goal", f"{hold.action}/cancel"
        self.ros, self.slave = keeper.ros, keeper.slave
        self.lock = keeper.lock  # one for all: whoever saves reads every hold
        self.wake = threading.Event()
        self.streams: dict[tuple[str, str], TopicStream] = {}
        self.due: dict[tuple[str, str], float] = {}  # from when on to try again; what is being tried: inf
        self.complained: set[tuple[str, str]] = set()
        self.scene = Participants(hold.action, self.ros, self.slave.name, MasterState())
        self.advertised = False
        self.over = self.dirty = False
        self.introduced = self.asked = self.kept = 0.0
        self.stayer = ""  # the address of the server that stays
        self.senders: frozenset[str] = frozenset()  # clients that the server of now is connected to

    def log(self, text: str) -> None:
        self.keeper.log(f"goals of {self.hold.action}: {text}")

    # ---- streams

    def wanted(self) -> dict[tuple[str, str], tuple[str, str]]:
        """Streams that there should be: (role, address) -> caller id and topic."""
        scene, action = self.scene, self.hold.action
        every = [(part, uri) for part, nodes in scene.nodes.items() for uri in nodes.values()]
        found = {(part, uri): (self.slave.name, f"{action}/{part}") for part, uri in every}
        # first in our own name: from then on nothing can pass us by
        taken = [uri for uri in scene.clients.values() if self.hold.taking and self.is_open((GOALS, uri))]
        return {**found, **{(TAKEN, uri): (self.hold.node, f"{action}/goal") for uri in taken}}

    def is_open(self, key: tuple[str, str]) -> bool:
        return key in self.streams and self.streams[key].open

    def connect(self) -> int:
        """Start to open what is missing, forget what has ended; how many clients are not wholly connected yet."""
        wanted, now = self.wanted(), time.monotonic()
        for key in [key for key, stream in self.streams.items() if not stream.open]:
            del self.streams[key]
        for key, (caller, topic) in wanted.items():
            if key not in self.streams and now >= self.due.get(key, 0.0):
                self.due[key] = math.inf
                threading.Thread(target=self._connect, args=(key, caller, topic), daemon=True).start()
        clients = self.scene.clients.values()
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
            self.due[key] = 0.0 if stream.open else time.monotonic() + AGAIN
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
            found = DECODERS.get(role, tcpros.goal_id)(body)
        except RosError as error:
            self.log(f"{uri} sent what is none of actionlib's messages: {error}")
            return
        with self.lock:
            if role == STATUS:
                changed = bool(self.hold.status(uri, found, now))
            elif role == CANCELS:
                meant = self.hold.cancel(*found)
                changed = bool(meant)
                for goal in meant:
                    self.log(f"{goal} was cancelled while it is held")
            else:
                identity, stamp = found
                alone = bool(self.hold.server) and uri not in self.senders
                changed = self.hold.goal(Goal(identity, stamp, body, now, uri, alone))
            self.dirty = self.dirty or changed

    # ---- the server

    def sight(self, now: float) -> Sight:
        """What the network shows of the server that goals should go to."""
        scene, action = self.scene, self.hold.action
        living = {name: uri for name, uri in scene.servers.items() if self.is_open((STATUS, uri))}
        server = self.hold.pick(living, now)
        if not server:
            return Sight()
        name = next(name for name, uri in living.items() if uri == server)
        listening = all(name in self.slave.callers(topic) for topic in self.topics)
        try:
            with Api(server, self.slave.name, Deadline(CONNECT)) as api:
                edges = connections(api.call("getBusInfo"))
        except Exception as error:
            self.log(f"{name} does not say whom it is connected to: {reason(error, server, CONNECT)}")
            return Sight(server, listening, stays=False)
        out = {(edge.topic, edge.peer) for edge in edges if edge.direction != "i" and edge.connected}
        into = {edge.peer for edge in edges if edge.direction == "i" and edge.topic == f"{action}/goal"}
        living_clients = {client for client, uri in scene.clients.items() if self.is_open((GOALS, uri))}
        ready = all((topic, peer) in out for topic, peers in scene.hears.items() for peer in peers & living_clients)
        uris = set(scene.clients.values())
        ready = ready and math.inf not in [self.due.get((TAKEN, uri)) for uri in uris]
        direct = bool(self.hold.opened) and uris <= into and uris <= self._sending(uris, name)
        return Sight(server, listening, ready, direct, frozenset(into), self._stays(name, server))

    def _sending(self, clients: Iterable[str], server: str) -> set[str]:
        """The clients that have a connection to the server, by their own word: a subscriber says so before it has one.

        Ours in its name is listed there, too.
        """
        topic = f"{self.hold.action}/goal"

        def connected(uri: str) -> bool:
            ours = server == self.hold.node and self.is_open((TAKEN, uri))
            with Api(uri, self.slave.name, Deadline(CONNECT)) as api:
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
        listed = self.advertised and self.scene.listed  # not by a master that was restarted meanwhile
        if listed or not self.header.get("md5sum"):
            return
        self.advertised = True
        calls = []
        for topic, header in zip(self.topics, (self.header, CANCEL_HEADER)):
            self.slave.advertise(topic, header)
            calls.append(("registerPublisher", self.slave.name, topic, header["type"], self.slave.uri))
        self.ros.calls(calls)

    def _unadvertise(self) -> None:
        if not self.advertised:
            return
        self.advertised = False
        try:
            self.ros.calls([("unregisterPublisher", self.slave.name, topic, self.slave.uri) for topic in self.topics])
        except RosError as error:
            self.log(f"not unregistered: {error}")
        for topic in self.topics:
            self.slave.unadvertise(topic)

    def _introduce(self) -> None:
        """Give the clients back: the server connects to whom it is told publishes."""
        self.introduced = time.monotonic()
        scene, own = self.scene, [self.slave.uri] if self.advertised else []
        try:
            for topic, nodes in zip(self.topics, (scene.clients, scene.cancellers if own else {})):
                if nodes or own:
                    tell_publishers(self.hold.server, topic, [*nodes.values(), *own], CONNECT)
        except Exception as error:
            self.log(f"the server was not told of its clients: {reason(error, self.hold.server, CONNECT)}")

    def do(self, todo: Order) -> None:
        goal, (goals, cancels) = todo.goal, self.topics
        if todo.kind == rules.ADVERTISE:
            self._advertise()
        elif todo.kind == rules.OPEN:
            self.log(f"a server is up at {self.hold.server}, {len(self.hold.goals)} goals to forward")
            self._introduce()
        elif todo.kind == rules.CANCEL and goal is not None:
            self.slave.publish(cancels, tcpros.encode_cancel(goal.id))
            self.log(f"told the server that {goal.id} is cancelled")
        elif todo.kind == rules.SEND and goal is not None:
            if self.slave.publish(goals, goal.body):
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
        scene = Participants(self.hold.action, self.ros, self.slave.name, self.ros.state())
        with self.lock:  # a tick sees one scene from its beginning to its end
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
            except Exception as error:  # whatever one look brings: without us nobody gives the goals back
                away = isinstance(error, RosError)
                self.log(f"{'the master is away' if away else f'error: {type(error).__name__}'}: {error}")
                time.sleep(AWAY)
        with self.lock:
            for stream in self.streams.values():
                stream.close()
        self.keeper.ended(self)

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
            self._introduce()


@dataclass(eq=False)
class GoalForwarding:
    """All holds. `stays` says of an action's server whether it will stay: only then it gets what is held."""

    ros: Registrar
    slave: Slave
    write: Callable[[Any], bool]
    log: Callable[[str], None]
    stays: Callable[[str, str], bool]

    def __post_init__(self) -> None:
        self.forwarders: dict[str, Forwarder] = {}
        self.lock, self.boot = threading.RLock(), boot_of_host()
        self.calls: Calls = {"hold": self.hold, "release": self.release, "state": self.state}

    def resume(self, kept: Sequence[Any]) -> None:
        """Go on after a restart; what was held before a boot of the host is nobody's wish any more."""
        for item in kept:
            if item.get("boot", self.boot) != self.boot:
                count = len(item["goals"])
                self.log(f"goals of {item['action']}: {count} goals go, which came before the host was booted")
                continue
            one = Forwarder(rules.from_dict(item, time.monotonic()), item["header"], self)
            self.forwarders[one.hold.action] = one
            one.log(f"{len(one.hold.goals)} goals are still held")
            one.start()

    def save(self) -> bool:
        """Keep it; whether that could be done."""
        with self.lock:
            now, every = time.monotonic(), self.forwarders.values()
            return self.write([{**one.hold.as_dict(now), "header": one.header, "boot": self.boot} for one in every])

    def ended(self, forwarder: Forwarder) -> None:
        """Until that is written: what an old file says is held would be forwarded a second time."""
        with self.lock:
            if self.forwarders.get(forwarder.hold.action) is forwarder:
                del self.forwarders[forwarder.hold.action]
        while not self.save():
            time.sleep(RETRY)

    # ---- the calls

    def hold(self, action: str, server: str, seconds: float) -> list[Any]:
        """Keep the goals of `action` until a server that is not the present `server` is up; how many clients."""
        action = str(action)  # a key of what is answered, whatever somebody has said
        try:
            old_uri = self.ros.addresses([server])[0].get(server, "")
        except RosError as error:
            return [0, str(error), 0]
        until = time.monotonic() + float(seconds)
        with self.lock:
            one = self.forwarders.get(action)
            if one is None or one.over:
                one = self.forwarders[action] = Forwarder(Hold(action, server, old_uri, until), {}, self)
            else:
                one.hold.again(server, old_uri, until)
        waiting = self._first(one)
        with self.lock:  # two of one action may come at the same time
            if not one.is_alive():
                one.start()
        self.save()
        clients = len(one.scene.clients)
        one.log(f"held for {float(seconds):g} s, from {clients} clients")
        missing = f"{waiting} of {clients} clients are not connected" if waiting else ""
        return [1, missing, clients - waiting]

    def _first(self, one: Forwarder) -> int:
        """Connect to all clients; the hold is true only then."""
        end = time.monotonic() + FIRST
        waiting = 0
        while time.monotonic() < end:
            try:
                one.look()
            except RosError as error:
                one.log(str(error))
            with one.lock:
                waiting = one.connect()
            if not waiting and all(one.is_open(key) for key in one.wanted()):
                break
            time.sleep(TICK / 5)
        return waiting

    def release(self, action: str) -> list[Any]:
        """Hand the goals to whatever server is there; how many were forwarded."""
        with self.lock:
            one = self.forwarders.get(action)
            if one is None:
                return [1, f"no goals of {action} are held", 0]
            one.hold.release(time.monotonic())
        one.wake.set()
        if one.is_alive():  # else its hold is still being made
            one.join(FIRST)
        kept = "" if one.over else f"{len(one.hold.goals)} goals are kept"
        return [1, kept, one.hold.forwarded]

    def state(self) -> list[Any]:
        """Action -> what is held of it, for how long yet, and the server that goals go to."""
        now = time.monotonic()
        with self.lock:
            holds = [one.hold for one in self.forwarders.values()]
        found = {
            hold.action: {
                "node": hold.node,
                "held": list(hold.goals),
                "forwarded": hold.forwarded,
                "seconds": round(hold.until - now, 1),
                "server": hold.server,
            }
            for hold in holds
        }
        return [1, "", found]
