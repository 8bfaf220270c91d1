# SPDX-License-Identifier: GPL-3.0-or-later
"""Hold back an action's new goals at a moment when none is under way. No I/O: the world is handed in.

Between "idle" and the end of a server there is time for a goal to come. So goals are held first, and then it is looked
again: one that slipped in before shows itself, and is left to finish.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, Callable, Iterable, Mapping, Protocol

from .._common.poll import PASS, WAIT, Seen, poll

CONSECUTIVE = 2  # a goal that is on its way stands in no list yet
SECOND_LOOK = 2.0  # seconds for a short goal that slipped in; the clients of held ones wait meanwhile
INTERVAL = 0.1


class World(Protocol):
    """What is asked and done; the module ros_action_hold has the real one."""

    def look(self) -> Seen:
        """Whether all actions are idle; what was observed is handed on."""

    def hold(self, servers: Mapping[str, str]) -> Mapping[str, str]:
        """Action -> why its goals are not held, or nothing. All at once: who hangs is waited for a single time."""

    def isolate(self, servers: Mapping[str, str]) -> None:
        """Tell each action's server that nobody sends it goals."""

    def release(self, actions: Iterable[str]) -> Mapping[str, str]:
        """Action -> why its goals may not have been let go, or nothing. All at once."""


@dataclass(frozen=True)
class Held:
    """How it ended: the verdict of the last look, what it saw, and what is held now."""

    verdict: str
    last: Any
    elapsed: float
    held: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()
    called_off: int = 0  # how often goals were held and let go, because one had slipped in


def hold_when_idle(  # noqa: PLR0913 - the clocks are the price of tests that never wait
    world: World,
    servers: Mapping[str, str],
    timeout: float,
    interval: float,
    looks: int = CONSECUTIVE,
    now: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> Held:
    """Wait until all actions are idle, and hold the goals of those in `servers` (action -> its server's node).

    `looks` in a row have to find them idle where nothing is held.

    What cannot be held is told and is no reason to wait: without a keeper an idle action is the best there is.
    """
    start, called_off = now(), 0
    while True:
        left = max(interval, start + timeout - now())  # never less than two looks, whoever does not want to wait
        # before a hold once is enough: what counts is the look after it
        ended = poll(world.look, left, interval, 1 if servers else looks, now=now, sleep=sleep)
        if ended.verdict != PASS or not servers:
            return Held(ended.verdict, ended.last, now() - start, called_off=called_off)
        refused = world.hold(servers)
        held = {action: server for action, server in servers.items() if not refused[action]}
        problems = [f"goals of {action} are not held: {why}" for action, why in refused.items() if why]

        def rest(held: Mapping[str, str] = held) -> Seen:
            if held:
                world.isolate(held)  # at every look: the master tells the server of each new client
            return world.look()

        again = poll(rest, SECOND_LOOK, INTERVAL, CONSECUTIVE, now=now, sleep=sleep)
        if again.verdict == PASS:
            return Held(PASS, again.last, now() - start, tuple(held), tuple(problems), called_off)
        let_go = world.release(servers)  # of all: a keeper that answered too late holds, too
        problems += [why for action, why in let_go.items() if why and action in held]
        called_off += 1
        if again.verdict != WAIT or now() - start >= timeout:
            return Held(again.verdict, again.last, now() - start, (), tuple(problems), called_off)
