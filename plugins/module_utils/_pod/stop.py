# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The stop hook: end the pod's own node so that it leaves the graph, an action server only once it is idle.

roscpp as process 1 of a container ignores SIGTERM, and no node unregisters when it is killed; the slave API's
`shutdown` is what all nodes obey. Nothing here may keep a pod from being stopped.
"""

from __future__ import annotations

import contextlib
import os
import sys
import time
from functools import partial
from typing import Any, Callable, Mapping, Protocol

from .._common.poll import PASS, WAIT, Seen, poll
from .._ros.graph import BUSY_STATES, GOAL_STATES, StatusReading
from .._ros.keeper_client import KeeperCalls
from .own_node import CALLER, OwnNode, find_node, ros_of
from .state import load_settings

LEAVING = 3.0  # of the stop's time for the node to end by itself, or a third of it where there is less
CALLS = 3.0  # for clients to hang up: a call takes milliseconds, a persistent connection is never closed
HOLD = 300.0  # for the next server to come: goals are held so long
CALL_TICK = 0.05


class Stopped(Protocol):
    """What is done to the own node; OwnNode with a ROS backend does it."""

    def actions(self) -> list[str]: ...

    def status(self, action: str) -> StatusReading: ...

    def isolate(self, action: str) -> None: ...

    def connections(self) -> int: ...

    def unregister(self) -> None: ...

    def shut_down(self) -> None: ...


def main(_words: list[str]) -> int:
    """Always 0: Kubernetes would call a pod that has ended cleanly one that failed to stop."""
    try:
        remarks = _main()
    except Exception as error:  # whatever goes wrong here, the pod is going to be stopped
        remarks = [f"stop hook: {type(error).__name__}: {error}"]
    if remarks:
        tell("rosops.fleet: " + "; ".join(remarks))
    return 0


def _main() -> list[str]:
    settings = load_settings(os.environ)
    if not settings["expect_node"]:
        return []  # nobody knows its nodes: left to SIGTERM
    node, reason = find_node(settings)
    if node is None:
        return [f"left to SIGTERM: {reason}"]
    keeper = KeeperCalls(settings["keeper"], CALLER).hold if settings["keeper"] else None
    return stop(_Stopped(node, settings["actions"]), settings, keeper)


def stop(
    node: Stopped,
    settings: Mapping[str, Any],
    hold: Callable[[str, str, float], str] | None,
    now: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> list[str]:
    """Stop the node within its deadline; remarks on what was not as it should be."""
    total = float(settings["stop_deadline"])
    end = now() + total
    leaving = min(LEAVING, total / 3)
    remarks = []
    if settings["handoff"] == "drain":
        try:
            remarks = drain(node, settings["node"], hold, end - leaving - now(), now, sleep)
        except Exception as error:  # a node that cannot be drained has to be stopped all the same
            remarks = [f"not drained: {type(error).__name__}: {error}"]
    else:
        poll(lambda: _quiet(node), min(CALLS, end - leaving - now()), CALL_TICK, now=now, sleep=sleep)
    return [*remarks, *leave(node)]


def leave(node: Stopped) -> list[str]:
    """Take the node out of the graph and shut it down.

    It unregisters by itself, too, but rospy does so in a thread that ends with the process, and the main thread sees
    the shutdown first: on a busy machine half of it stayed registered.
    """
    remarks = []
    try:
        node.unregister()
    except Exception as error:  # a master that is away will know nothing of the node when it comes back
        remarks.append(f"not unregistered: {error}")
    node.shut_down()
    return remarks


def drain(  # noqa: PLR0913 - the clocks are the price of tests that never wait
    node: Stopped,
    name: str,
    hold: Callable[[str, str, float], str] | None,
    seconds: float,
    now: Callable[[], float],
    sleep: Callable[[float], None],
) -> list[str]:
    """Wait until no goal is open. New ones are held back where a keeper does that, so that this has an end."""
    remarks, held = [], []
    actions = node.actions()
    for action in actions:
        reason = hold(action, name, seconds + HOLD) if hold else "there is no keeper"
        if reason:
            remarks.append(f"goals of {action} are not held: {reason}")
        else:
            held.append(action)

    def probe() -> Seen:
        for action in held:  # at every look: the master tells the server of each new client
            node.isolate(action)
        open_goals = [word for action in actions for word in busy(action, node.status(action))]
        return Seen(WAIT if open_goals else PASS, open_goals)

    # Twice: a look may begin with a status from before the isolation, and a goal on its way stands in none yet.
    ended = poll(probe, seconds, 0.1, consecutive=2, now=now, sleep=sleep) if actions else None
    if ended and ended.verdict != PASS:
        remarks.append(
            f"stopped with open goals after {ended.elapsed:.0f} s: {', '.join(ended.last) or 'idle once only'}"
        )
    return remarks


def busy(action: str, status: StatusReading) -> list[str]:
    """What is under way, in words; a status that cannot be read twice counts as that."""
    states = [state for reading in status.readings for state in reading if state in BUSY_STATES]
    if states:
        return [f"{action} {GOAL_STATES[states[-1]]}"]
    return [] if len(status.readings) > 1 else [f"{action} unknown ({status.error or 'no second status'})"]


def _quiet(node: Stopped) -> Seen:
    """No call under way; nor where that cannot be seen."""
    with contextlib.suppress(Exception):
        return Seen(WAIT if node.connections() else PASS)
    return Seen(PASS)


def tell(line: str) -> None:
    """On our output, which Kubernetes shows for a failing hook only, and in the container's log."""
    sys.stdout.write(f"{line}\n")
    if "ROSOPS_REVISION" not in os.environ:
        return  # no pod of ours, and its process 1 is somebody else's
    try:
        with open("/proc/1/fd/1", "w", encoding="utf-8") as log:  # noqa: PTH123 - not a path of a file system
            log.write(f"{line}\n")
    except OSError:
        pass


class _Stopped:
    """The own node and the ROS backend that reads it."""

    def __init__(self, node: OwnNode, expected: list[str]) -> None:
        self.node, self.expected, self.ros = node, expected, ros_of(os.environ)
        self.isolate = node.isolate
        self.unregister = partial(node.unregister, self.ros)
        self.connections = node.connections
        self.shut_down = node.shut_down

    def actions(self) -> list[str]:
        return self.node.actions(self.ros, self.expected)

    def status(self, action: str) -> StatusReading:
        return self.node.status(self.ros, action)
