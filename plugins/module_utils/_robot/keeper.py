# SPDX-License-Identifier: GPL-3.0-or-later
"""The keeper at work: look at the master again and again, do what its memory says.

It is ready once it has read all that there is, or has it from before: until then a master that is replaced would lose
what nobody else knows.
"""

from __future__ import annotations

import contextlib
import math
import queue
import socket
import threading
import time
from dataclasses import dataclass
from typing import Any, Callable, Iterable, Mapping

from .._common.errors import RosError
from .._ros import registrations
from .._ros.backend import MasterState
from .._ros.graph import host_of
from .._ros.names import is_meant
from .._ros.registrar import Registrar
from .._ros.registrations import Call, Entry, Liveness
from .._ros.rpc import Request
from . import memory
from .memory import KeptFiles, Silence

LOOK = 1.0  # seconds between looks at the master,
AWAY = 0.2  # while it does not answer,
REST = 5.0  # once nothing has changed for QUIET seconds, and its end would be noticed without a look
QUIET = 30.0
# A master that took long to say all that is registered (that of a large fleet) is left alone for so many times as long,
# but not longer than these seconds: it has other work to do.
SHARE, MOST = 10, 10.0
ADDRESSES = 15.0  # seconds after which addresses are looked up although no name has changed
PARAMETERS, CHANGED = 60.0, 2.0  # seconds between two reads of all parameters; after the master told of a change
ASK = 1.0  # seconds for nodes to answer before a replay: one that is late is asked again, the others do not wait for it
PROBE = 5.0  # an address that is no more: its host finds that out by three ARP requests, one second each
TOGETHER = 3  # names in a line of the log
AT_ONCE = 0.5  # seconds for a connection, which takes milliseconds: one that waits has lost the master meanwhile
LEAST = 1.0  # seconds between connections: one that hangs up at once would be connected to all the time


@dataclass(eq=False)
class Keeper:
    """Keeps one graph's registrations and parameters."""

    ros: Registrar
    kept: KeptFiles
    log: Callable[[str], None]
    now: Callable[[], float] = time.monotonic  # a clock that nobody sets
    uri: str = ""  # where the master can tell us of parameters that change
    boot: str = ""  # of this host, what tells it from another
    keeps: bool = True  # else the master is somebody else's: it is only looked at, and given nothing back by itself

    def __post_init__(self) -> None:
        self.restarted_at = -math.inf  # when another master was seen than before in this boot, by `now`
        self.held: Callable[[], bool] = bool  # whether the master's end would be noticed without a look
        self.restless = self.now()
        self.memory = memory.from_dict(self.kept.load("registrations"), self.now())
        self.booted, self.memory.boot = self.memory.boot != self.boot, self.boot  # since what is on record
        self.params: str = str(self.kept.load("parameters") or "")
        self.params_at = 0.0
        self.changed = False  # since they were read
        self.told_by: tuple[Any, ...] = ()  # the master that tells us of changes
        self.whole_at: tuple[Any, ...] = ()  # the master that has all that was registered with the one before,
        self.whole_since = math.inf
        self.ended: queue.SimpleQueue[tuple[str, str]] = queue.SimpleQueue()  # addresses of pods, and spaces
        self.complete = bool(self.memory.master and self.params) or not self.keeps
        self.away = ""
        self.present: dict[str, Entry] = {}
        self.seen: MasterState | None = None  # as the last look had it; None: look up all of it next time
        self.due = 0.0  # when to look at all that is registered again,
        self.addresses_due = 0.0  # and at the addresses
        self.silence = Silence()
        self.probing: threading.Thread | None = None
        self.probed: tuple[dict[str, Entry], dict[str, Liveness]] = ({}, {})

    def step(self) -> float:
        """One look; seconds until the next one."""
        try:
            self._look()
        except RosError as error:
            if not self.away:
                self.log(f"the master is away: {error}")
            self.away = str(error)
            self.seen = None
            return AWAY
        self.complete = bool(self.params) or not self.keeps
        held, quiet = self.held(), self.now() - self.restless >= QUIET
        return REST if held and quiet and not (self.memory.missed or self.memory.suspects) else LOOK

    def parameter_changed(self, _caller: str, _key: str, _value: Any) -> list[Any]:
        """The master's call, of the slave API."""
        self.changed = True
        return [1, "", 0]

    def has_ended(self, address: str, space: str) -> None:
        """The pod with this address of its own ends: to its nodes, which are below `space`, nothing is given back.

        From any thread.
        """
        self.ended.put((address, f"{space.rstrip('/')}/"))

    def _forget_ended(self) -> None:
        while not self.ended.empty():
            address, space = self.ended.get()
            for node, entry in [*self.memory.nodes.items()]:
                if host_of(entry.uri) == address and node.startswith(space):
                    self.memory.forget(node)

    def is_whole(self, since: float) -> bool:
        """Whether the master that answers now had, at that time by `now`, been given back what the one before had.

        Until then a node that it does not know may still be there.
        """
        try:
            known = not self.away and self.whole_since <= since
            return known and _identity(self.ros.calls(self._who)) == self.whole_at
        except RosError:
            return False

    def was_whole(self, age: float) -> list[Any]:
        """A pod's call: whether it was so many seconds ago."""
        return [1, "", self.is_whole(self.now() - age)]

    @property
    def _who(self) -> list[Request]:
        caller = self.ros.caller
        return [("getPid", caller), ("getUri", caller), ("getParam", caller, "/run_id")]

    def take_back(self, nodes: Iterable[str]) -> None:
        """Point the services of these nodes to them again, where they live: whoever has them now is about to go."""
        names = {*nodes}
        wanted = {node: entry for node, entry in [*self.memory.nodes.items()] if is_meant(node, names)}
        present = self.ros.snapshot() if wanted else {}
        need = registrations.missing(wanted, present, take_services=True)
        if need:
            calls = registrations.restore(need, present, self.ros.ask(need, ASK))
            self.ros.apply(calls)
            self.log(f"gave back {in_words(calls)}")

    # ---- the look

    def _look(self) -> None:
        self._forget_ended()
        began = self.now()
        rests = self.seen is not None and began < self.due
        if rests and _identity(self.ros.calls(self._who)) == self.memory.master:  # nobody restarted it
            self._keep_params(began)
            return
        *parts, system = self.ros.calls([*self._who, ("getSystemState", self.ros.caller)])
        if isinstance(system, RosError):
            raise system
        now = self.now()
        took = now - began
        self.due = now + min(SHARE * took, MOST) - LOOK
        master = _identity(parts)
        if self.away:
            self.log("the master is back")
            self.away = ""
        restarted = bool(self.memory.master) and master != self.memory.master
        news = self._register(system, now, restarted) or bool(self.memory.missed)
        if restarted and not self.booted:
            self.restarted_at = now
        if not self.keeps:
            self._has_all(master)
            self.memory.nodes = {node: entry for node, entry in self.memory.nodes.items() if node in self.present}
            return
        if restarted:
            self._replay(now)
        else:
            # what the master lost without a restart, as a service whose last provider left while an earlier lives
            calls = self._restore(self.memory.lost(self.present, now)) if news else ()
            if calls:
                self.log(f"restored {in_words(calls)}")
            news = self._probe(now) or news
        self._has_all(master)  # not before: one that broke off in the middle is given all of it once more
        self._keep_params(now)
        if news:
            self.kept.save("registrations", self.memory.as_dict())

    def _has_all(self, master: tuple[Any, ...]) -> None:
        if master != self.whole_at:
            self.memory.master = self.whole_at = master
            self.whole_since = self.now()
            self.booted = False

    def _register(self, system: Any, now: float, anew: bool) -> bool:
        """Take up what the master has; addresses and types are asked for only where names changed, or now and then.

        False: nothing was, so nothing can be missing, or worth keeping, that was not at the last look.
        """
        state = self.ros.state_of(system)
        changed = anew or state != self.seen
        self.restless = now if changed else self.restless
        if not (changed or now >= self.addresses_due):
            return False
        types = self.ros.calls([("getTopicTypes", self.ros.caller)])[0]
        if isinstance(types, RosError):
            raise types
        self.present = self._without_us(self.ros.snapshot(self.ros.state_of(system, types)))
        self.seen, self.addresses_due = state, now + ADDRESSES
        unknown = self.memory.unknown(self.present)
        answers = self.ros.ask(unknown, ASK, own_word=False) if unknown else {}
        self.memory.learn(self.present, {node: answer.pid for node, answer in answers.items()})
        return True

    def _without_us(self, entries: Mapping[str, Entry]) -> dict[str, Entry]:
        return {node: entry for node, entry in entries.items() if node != self.ros.caller}

    # ---- what was lost

    def _replay(self, now: float) -> None:
        """After a restart of the master: parameters first, which nodes that start now will read.

        Nodes that do not answer in time get back what they had, as the master would have it without a restart: who
        looks for a peer of a new version must not take it for one that has left. Not after a boot of the host: that
        ended the pods of before.
        """
        start = time.monotonic()
        wanted = memory.parameters_of(self.params)
        tree = self.ros.calls([("getParam", self.ros.caller, "/")])[0]
        todo = list(memory.absent_parameters(wanted, tree))
        results = self.ros.calls([("setParam", self.ros.caller, name, value) for name, value in todo])
        for (name, _value), result in zip(todo, results):
            if isinstance(result, RosError):
                self.log(f"parameter {name} was not set: {result}")
        calls = self._restore(self.memory.lost(self.present, now, at_once=True), now, not self.booted)
        nodes = {call.node for call in calls}
        self.log(
            f"the master was restarted: {len(calls)} registrations of {len(nodes)} nodes and {len(todo)} parameters "
            f"restored in {(time.monotonic() - start) * 1000:.0f} ms"
        )

    def _restore(self, need: Mapping[str, Entry], restarted: float = 0, late: bool = False) -> tuple[Call, ...]:
        answers = self.ros.ask(need, ASK)
        if late:  # a process that came meanwhile has its name
            self._forget_ended()
            need = {node: entry for node, entry in need.items() if node in self.memory.nodes}
            self.present = self._without_us(self.ros.snapshot())
        calls = self.memory.settle(need, self.present, answers, restarted, late)
        if calls:
            self.ros.apply(calls)
            self.seen = None
        return calls

    # ---- who is gone

    def _probe(self, now: float) -> bool:
        """Nodes are looked at beside the loop: one that hangs must not delay it. Whether one went or came back."""
        if self.probing and self.probing.is_alive():
            return False
        (asked, answers), self.probed = self.probed, ({}, {})
        gone, back = self.memory.judge(asked, answers, now)
        self.silence = self.memory.silence() if asked else self.silence
        for node in gone:
            self._reap(node, answers[node], now)
        self._correct(self.memory.doubtful(answers))
        for node in back:
            self.present = self._without_us(self.ros.snapshot())
            calls = self._restore(registrations.missing({node: self.memory.revive(node)}, self.present))
            self.log(f"{node} is back, process {answers[node].pid}: restored {in_words(calls)}")
        due = self.memory.due(self.present, now)
        if due:
            self.probing = threading.Thread(target=self._ask, args=(due,), daemon=True)
            self.probing.start()
        return bool(gone or back)

    def _correct(self, doubtful: Mapping[str, Entry]) -> None:
        """Take back what nodes were given back without a word of theirs, and do not have."""
        answers = self.ros.ask(doubtful, ASK)
        calls = registrations.denied(doubtful, answers)
        if calls:
            self.ros.apply(calls)
            self.log(f"took back {in_words(calls)}: by its own word it has that no more")
        self.memory.correct(answers, calls)

    def _ask(self, entries: dict[str, Entry]) -> None:
        self.probed = (entries, self.ros.ask(entries, PROBE, own_word=False))

    def _reap(self, node: str, answer: Liveness, now: float) -> None:
        entry = self.memory.nodes[node]
        registered = self.ros.snapshot().get(node)
        if registered is None:  # it left by itself, or the master has lost it
            self.memory.bury(node, now)
            return
        if registered.uri != entry.uri:
            return  # a newer process has the name
        calls = registrations.remove({node: registered}, [{node: Liveness(registrations.DEAD)}])
        self.ros.apply(calls)
        self.memory.bury(node, now)
        self.seen = None
        self.log(f"removed {in_words(calls)}: {registrations.alive(entry, answer)}")

    # ---- parameters, and what is kept

    def _keep_params(self, now: float) -> None:
        """Read all of them; and have this master tell of changes, which one that does not know the call never does."""
        master, due = self.memory.master, now - self.params_at >= (CHANGED if self.changed else PARAMETERS)
        if not (self.keeps and (due or self.told_by != master)):
            return
        self.changed = False  # first: what changes while they are read is news
        caller = self.ros.caller
        news = [("subscribeParam", caller, self.uri, "/")] if self.uri and self.told_by != master else []
        *who, tree = self.ros.calls([*self._who, *news, ("getParam", caller, "/")])
        # a master that came within this look has not been given back what is on record
        if isinstance(tree, RosError) or _identity(who[:3]) != master:
            self.changed = True
            return
        self.params_at, self.told_by = now, master
        self.params = memory.parameters_text(tree)
        self.kept.save("parameters", self.params)


def _identity(parts: Iterable[Any]) -> tuple[Any, ...]:
    """What tells this run of the master from another."""
    return tuple(part if isinstance(part, (int, str)) else None for part in parts)


def in_words(calls: Iterable[Call]) -> str:
    """Registrations in words, the first few."""
    words = [f"{call.node} {call.kind} {call.name}" for call in calls]
    more = f" and {len(words) - TOGETHER} more" if len(words) > TOGETHER else ""
    return (", ".join(words[:TOGETHER]) or "nothing") + more


class Lifeline:
    """A connection to the master over which nothing is said: its end, with the master's process, is noticed at once.

    A master that hangs up on whoever says nothing (`roscore -t 2`: after two seconds) is connected to again: where that
    fails, it has ended, and `wake` is called in a thread of its own. A host that loses its power closes no connection.
    """

    def __init__(self, address: tuple[str, int], wake: Callable[[], None]) -> None:
        self.address, self.wake = address, wake
        self.stands = False
        self._thread: threading.Thread | None = None

    def hold(self) -> bool:
        """Whether it stands now; where not, it is begun anew beside the caller."""
        if self._thread is None or not self._thread.is_alive():
            self._thread = threading.Thread(target=self._run, daemon=True)
            self._thread.start()
        return self.stands

    def _run(self) -> None:
        try:
            while True:
                with socket.create_connection(self.address, AT_ONCE) as sock:
                    began = time.monotonic()
                    sock.settimeout(None)
                    self.stands = True
                    with contextlib.suppress(OSError):
                        sock.recv(1)
                time.sleep(max(0.0, LEAST - (time.monotonic() - began)))
        except OSError:
            if self.stands:
                self.wake()
        finally:
            self.stands = False
