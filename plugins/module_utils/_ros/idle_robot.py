# SPDX-License-Identifier: GPL-3.0-or-later
"""Hold back an action's new goals at a moment when none is under way, and messages say what they have to.

Between "idle" and the end of a server there is time for a goal to come. So goals are held first, and then it is looked
again: one that slipped in before shows itself, and is left to finish.

The keeper lets go by itself, to a new server when one is up, or to the old one after some seconds. So a control node
that dies after the hold leaves nothing behind.
"""

from __future__ import annotations

import contextlib
import time
from dataclasses import dataclass
from functools import partial
from typing import Any, Callable, Iterable, Mapping

from .._common.documents import Arguments, Data
from .._common.errors import FleetError, RosError
from .._common.poll import PASS, WAIT, Seen, poll
from .checks import Check
from .client import Ros1Client
from .conditions import Conditions, conditions_from
from .gate import look
from .keeper_client import TIMEOUT, KeeperCalls
from .listener import Listener
from .names import is_meant
from .rpc import in_parallel, tell_publishers

CONSECUTIVE = 2  # a goal that is on its way stands in no list yet
SECOND_LOOK = 2.0  # seconds for a short goal that slipped in; the clients of held ones wait meanwhile
INTERVAL = 0.1
STEP = "/rosops_fleet_step"  # the caller id of an update's step


class IdleRobot:
    """What is asked and done. Goals are held for so many `seconds` at most, from the moment at which they are."""

    def __init__(
        self, ros: Ros1Client, keeper: KeeperCalls, conditions: Conditions, seconds: Callable[[], float]
    ) -> None:
        self.ros, self.keeper, self.conditions, self.seconds = ros, keeper, conditions, seconds
        self.listener = Listener(ros, conditions.values) if conditions.values else None

    def look(self) -> Seen:
        """Whether all actions are idle; what was observed is handed on."""
        seen = look(self.ros, self.conditions, ears=self.listener.checks if self.listener else None)
        return Seen(seen.verdict, seen)

    def hold(self, servers: Mapping[str, str]) -> Mapping[str, str]:
        """Action -> why its goals are not held, or nothing. All at once: who hangs is waited for a single time."""
        try:
            now = self._now(servers)
        except (OSError, RosError) as error:
            return dict.fromkeys(servers, str(error))
        return at_once({name: partial(self.keeper.hold, name, one, self.seconds()) for name, one in now.items()})

    def _now(self, servers: Mapping[str, str]) -> dict[str, str]:
        """What each action's server is called in its pod."""
        there = self.ros.state()
        return {
            action: next((one for one in there.servers(action) if is_meant(one, [server])), server)
            for action, server in servers.items()
        }

    def release(self, actions: Iterable[str]) -> Mapping[str, str]:
        """Action -> why its goals may not have been let go, or nothing. All at once."""
        return at_once({name: partial(self.keeper.release, name) for name in actions})

    def isolate(self, servers: Mapping[str, str]) -> None:
        """Tell each action's server that nobody sends it goals.

        roscpp's servers hang up; rospy's have lost their clients to the keeper already.
        """
        unheard = contextlib.suppress(OSError, RosError)  # whatever comes through after all shows in the next look
        with unheard:
            now = self._now(servers)
            uris = self.ros.addresses(dict.fromkeys(now.values()))[0]
            for action, server in now.items():
                with unheard:
                    if server in uris:
                        tell_publishers(uris[server], f"{action}/goal", [], self.ros.timeout)

    def close(self) -> None:
        """Listen no more."""
        if self.listener:
            self.listener.close()


def at_once(calls: Mapping[str, Callable[[], str]]) -> Mapping[str, str]:
    """Calls of the keeper, by action."""
    return in_parallel(calls, TIMEOUT + 1, lambda _action, error: str(error))


@dataclass(frozen=True)
class Held:
    """How it ended: the verdict of the last look, what it saw, and what is held now."""

    verdict: str
    last: Any
    held: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()

    @property
    def reason(self) -> str:
        """Every unmet check of the last look, and what is not held."""
        return "; ".join([*map(_told, self.last.unmet), *self.problems])


def _told(check: Check) -> str:
    """An action's reason names its server; what is wrong with a value does not say of which."""
    return str(check) if check.kind == "value" else check.reason


def hold_when_idle(  # noqa: PLR0913 - the clocks are the price of tests that never wait
    robot: IdleRobot,
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
    start = now()
    while True:
        left = max(interval, start + timeout - now())  # never less than two looks, whoever does not want to wait
        # before a hold once is enough: what counts is the look after it
        ended = poll(robot.look, left, interval, 1 if servers else looks, now=now, sleep=sleep)
        if ended.verdict != PASS or not servers:
            return Held(ended.verdict, ended.last)
        refused = robot.hold(servers)
        held = {action: server for action, server in servers.items() if not refused[action]}
        problems = [f"goals of {action} are not held: {why}" for action, why in refused.items() if why]

        def rest(held: Mapping[str, str] = held) -> Seen:
            if held:
                robot.isolate(held)  # at every look: the master tells the server of each new client
            return robot.look()

        again = poll(rest, SECOND_LOOK, INTERVAL, CONSECUTIVE, now=now, sleep=sleep)
        if again.verdict == PASS:
            return Held(PASS, again.last, tuple(held), tuple(problems))
        let_go = robot.release(servers)  # of all: a keeper that answered too late holds, too
        problems += [why for action, why in let_go.items() if why and action in held]
        if again.verdict != WAIT or now() - start >= timeout:
            return Held(again.verdict, again.last, (), tuple(problems))


# ---- jobs of an update's step on the robot's host


def hold(arguments: Arguments) -> Data:
    """Wait `timeout` seconds until the `actions` ({name, server}) are idle and messages say the `values`, if there are
    any; then have the keeper at `keeper_uri` hold the goals of those with a server for `seconds` at most.

    Without a keeper, or for no seconds, nothing is held, and for no seconds one look that finds it so is enough. That
    goals cannot be held stands in the reason, and is no failure.
    """
    actions, seconds = arguments["actions"], arguments["seconds"]
    ros, keeper = Ros1Client(arguments["master_uri"], caller=STEP), arguments.get("keeper_uri", "")
    # of a wait in several calls, one may be shorter than what has to be quiet: so conditions hear of no time-out
    wanted = {"actions": [{**one, "state": "idle"} for one in actions], "values": arguments.get("values")}
    robot = IdleRobot(ros, KeeperCalls(keeper, STEP), conditions_from(wanted), lambda: seconds)
    servers = {one["name"]: one["server"] for one in actions if one.get("server") and keeper and seconds}
    looks = CONSECUTIVE if seconds else 1
    try:
        ended = hold_when_idle(robot, servers, arguments["timeout"], arguments["interval"], looks)
    finally:
        robot.close()
    return {
        "changed": bool(ended.held), "verdict": ended.verdict, "reason": ended.reason, "held": list(ended.held),
    }  # fmt: skip


def release(arguments: Arguments) -> Data:
    """Let go what the keeper at `keeper_uri` holds of the `actions` (names), to whatever server there is.

    A keeper that is away is asked again until `timeout` seconds are over: a kubelet that starts again takes it out of
    its Service for a while.
    """
    keeper, names = KeeperCalls(arguments["keeper_uri"], STEP), {*arguments["actions"]}
    there: set[str] = set()

    def probe() -> Seen:
        try:
            there.update(keeper.held().keys() & names)
        except (FleetError, OSError) as error:
            return Seen(WAIT, str(error))
        problems = at_once({name: partial(keeper.release, name) for name in sorted(there)}).values()
        return Seen(WAIT if any(problems) else PASS, "; ".join(filter(None, problems)))

    ended = poll(probe, arguments["timeout"], arguments["interval"])
    if ended.verdict != PASS:
        raise RosError(ended.last)
    return {"changed": bool(there)}
