# SPDX-License-Identifier: GPL-3.0-or-later
"""What becomes of an action's goals while its server is replaced. Pure: what happens is told to it, with the time.

That is a monotonic clock's, which nobody sets: how long a hold lasts must not follow a wall clock that is put right. It
begins anew with its computer, so what is kept has seconds to go and ages in its place. docs/goal-forwarding.md has the
order of a hand-over.
"""

from __future__ import annotations

import base64
import math
from dataclasses import dataclass, field
from typing import Any, Iterable, Mapping

from .._ros.tcpros import NO_STAMP, RECALLING

KEEP = 600.0  # seconds that goals are kept beyond the hold's own time
PATIENCE = 5.0  # seconds for clients to connect to the new server: one that does not is dead or has lost interest
LINGER = 1.0  # seconds to watch on after the server was connected to all clients
GRACE = 0.5  # seconds for a server to list a goal that it may have got directly
RECALL = 0.5  # seconds for a server to list a cancel
RESEND = 3.0
REMEMBERED = 5000  # goal ids

SEND, CANCEL, GIVE_UP = "send", "cancel", "give up"  # a goal
ADVERTISE, OPEN, FINISH, WARN = "advertise", "open", "finish", "warn"


@dataclass
class Goal:
    """A goal that no server has listed yet."""

    id: str
    stamp: tuple[int, int]
    body: bytes
    arrived: float
    client: str = ""  # the address that it came from
    alone: bool = False  # the server was not connected to that client when it came
    cancelled: bool = False
    cancel_sent: float | None = None
    recalling: bool = False
    sent: float | None = None


@dataclass(frozen=True)
class Sight:
    """What the network shows at one moment. `server` is the address of the one to forward to, where there is one."""

    server: str = ""
    connected: bool = False  # it listens to what we forward
    clients_ready: bool = False  # every client hears its results
    direct: bool = False  # it is connected to every client itself
    senders: frozenset[str] = frozenset()  # addresses of the clients that it is connected to itself
    stays: bool = True  # its version will not go back: goals that it gets are not taken away with it


@dataclass(frozen=True)
class Order:
    """What has to be done on the network; `kind` is one of the words above."""

    kind: str
    goal: Goal | None = None


@dataclass
class Hold:
    """The hold of one action's goals."""

    action: str
    node: str  # the server's name at the beginning
    old_uri: str
    until: float
    goals: dict[str, Goal] = field(default_factory=dict)
    shown: dict[str, bool] = field(default_factory=dict)  # ids that a server has listed, in the order of their coming
    forwarded: int = 0
    server: str = ""
    since: float = 0.0
    opened: float | None = None
    direct: float | None = None  # since when the server has been connected to all clients
    statuses: list[float] = field(default_factory=list)
    warned: bool = False

    # ---- what happens

    def again(self, node: str, uri: str, until: float) -> None:
        """Held once more, for the server of now; what is held stays."""
        self.node, self.old_uri, self.until = node, uri, until
        self.warned = False
        self._lose()

    def release(self, now: float) -> None:
        """Any server will do, and at once."""
        self.until = min(self.until, now)

    def goal(self, goal: Goal) -> bool:
        """A client sent a goal; whether it is news."""
        if not goal.id or goal.id in self.shown or goal.id in self.goals:
            return False
        self.goals[goal.id] = goal
        return True

    def cancel(self, goal_id: str, stamp: tuple[int, int]) -> list[str]:
        """A client cancelled one goal, all, or all up to a time; the goals here that are meant."""
        meant = [
            goal
            for goal in self.goals.values()
            if goal.id == goal_id or (not goal_id and stamp == NO_STAMP) or (stamp != NO_STAMP and goal.stamp <= stamp)
        ]
        for goal in meant:
            goal.cancelled = True
        return [goal.id for goal in meant]

    def status(self, uri: str, listed: Iterable[tuple[str, int]], now: float) -> list[str]:
        """A server's status; the goals that are its own now."""
        if uri == self.server:
            self.statuses = [*self.statuses[-1:], now]
        taken = []
        for goal_id, state in listed:
            goal = self.goals.get(goal_id)
            if state == RECALLING:
                # the mark of a cancel: the goal itself may never have come
                if goal is not None and uri == self.server:
                    goal.recalling = True
                continue
            self.shown[goal_id] = True
            if goal is not None:
                del self.goals[goal_id]
                self.forwarded += goal.sent is not None
                taken.append(goal_id)
        while len(self.shown) > REMEMBERED:
            del self.shown[next(iter(self.shown))]
        return taken

    # ---- what to do

    def pick(self, servers: Mapping[str, str], now: float) -> str:
        """The address to forward to, among living servers (name -> address)."""
        good = {name: uri for name, uri in servers.items() if now >= self.until or uri != self.old_uri}
        return next((good[name] for name in (self.node, *sorted(good)) if name in good), "")

    @property
    def taking(self) -> bool:
        """Whether goals must come here only: until the clients are given back."""
        return self.opened is None

    def step(self, sight: Sight, now: float) -> list[Order]:
        if sight.server != self.server:
            self._lose()
            self.server, self.since = sight.server, now
        if not self.server:
            return self._without(now)
        ready = (sight.clients_ready or now - self.since > PATIENCE) and (sight.stays or now > self.until)
        if not (self.statuses and ready):
            return [Order(ADVERTISE)] if self.goals else []
        todo: list[Order] = []
        if self.opened is None:
            self.opened = now
            todo.append(Order(OPEN))
        if not (sight.direct or now - self.opened > PATIENCE):
            self.direct = None
        elif self.direct is None:
            self.direct = now
        # what comes when the server has been connected to all clients is no goal of ours, listed or not
        last = math.inf if self.direct is None else self.direct + GRACE
        ours = [goal for goal in self.goals.values() if goal.arrived <= last]
        if ours:
            todo += self._forward(ours, sight, now) if sight.connected else [Order(ADVERTISE)]
        elif self.direct is not None and now - self.direct >= LINGER:
            todo.append(Order(FINISH))
        return todo

    def _lose(self) -> None:
        """The server that goals were being forwarded to is not there any more; what it did not list is still ours."""
        self.server, self.opened, self.direct, self.statuses = "", None, None, []
        for goal in self.goals.values():
            goal.sent = goal.cancel_sent = None
            goal.recalling = False

    def _without(self, now: float) -> list[Order]:
        if now > self.until + KEEP:
            given_up = [Order(GIVE_UP, goal) for goal in self.goals.values()]
            self.goals = {}
            return [*given_up, Order(FINISH)]
        if now > self.until and not self.warned:
            self.warned = True
            return [Order(WARN)]
        return []

    def _forward(self, goals: Iterable[Goal], sight: Sight, now: float) -> list[Order]:
        todo = []
        for goal in goals:
            if goal.sent is not None and now - goal.sent < RESEND:
                continue
            if not self._only_here(goal, sight, now):
                break  # the later ones keep their order
            if goal.cancelled and goal.cancel_sent is None:
                # The cancel first: the server then answers the goal without ever starting it.
                goal.cancel_sent = now
                todo.append(Order(CANCEL, goal))
            if goal.cancelled and not goal.recalling and now - (goal.cancel_sent or now) < RECALL:
                break
            goal.sent = now
            todo.append(Order(SEND, goal))
        return todo

    def _only_here(self, goal: Goal, sight: Sight, now: float) -> bool:
        """Whether the server did not get the goal directly: it came before the server, or is not listed in time."""
        if goal.arrived < self.since - GRACE or (goal.alone and goal.client not in sight.senders):
            return True
        start = max(goal.arrived, self.since)
        if now - start < GRACE:
            return False
        # two newer statuses; a server that sends them only on changes sends none
        return (len(self.statuses) == 2 and self.statuses[0] > start) or now - start > RESEND

    # ---- as it is kept

    def as_dict(self, now: float) -> dict[str, object]:
        return {
            "action": self.action,
            "node": self.node,
            "old_uri": self.old_uri,
            "seconds": self.until - now,
            "forwarded": self.forwarded,
            "goals": [
                {
                    "id": goal.id,
                    "stamp": list(goal.stamp),
                    "body": base64.b64encode(goal.body).decode("ascii"),
                    "age": now - goal.arrived,
                    "cancelled": goal.cancelled,
                }
                for goal in self.goals.values()
            ],
        }


def from_dict(data: Any, now: float) -> Hold:
    """The reverse of Hold.as_dict(), after a restart: the server is looked for anew, and lists what it has again."""
    hold = Hold(data["action"], data["node"], data["old_uri"], now + data["seconds"], forwarded=data["forwarded"])
    for item in data["goals"]:
        stamp = (int(item["stamp"][0]), int(item["stamp"][1]))
        body = base64.b64decode(item["body"])
        hold.goals[item["id"]] = Goal(item["id"], stamp, body, now - item["age"], cancelled=item["cancelled"])
    return hold
