# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The stop hook: end the pod's own node so that it leaves the graph, once what it works on for others has ended.

roscpp as process 1 of a container ignores SIGTERM, and no node unregisters when it is killed; the slave API's
`shutdown` is what all nodes obey. Nodes that an app names itself (roslaunch) are found by the pod's address; roslaunch
ends them in its own way. Nothing here may keep a pod from being stopped.
"""

from __future__ import annotations

import contextlib
import os
import sys
import time
from functools import partial
from typing import Any, Callable, Mapping, Protocol, Sequence

from .._common.poll import PASS, WAIT, Seen, poll
from .._ros.graph import BUSY_STATES, GOAL_STATES, StatusReading
from .._ros.keeper_client import KeeperCalls
from .own_node import CALLER, OwnNode, find_node, nodes_here, ros_of
from .state import load_settings

LEAVING = 3.0  # of the stop's time for the node to end by itself, or a third of it where there is less
HOLD = 300.0  # for the next server to come: goals are held so long
CALL_TICK = 0.05


class Stopped(Protocol):
    """What is done to the own node; OwnNode with a ROS backend does it."""

    name: str

    def actions(self) -> list[str]: ...

    def status(self, action: str) -> StatusReading: ...

    def isolate(self, action: str) -> None: ...

    def calls(self) -> int: ...

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
    if settings["expect_node"]:
        node, reason = find_node(settings)
        nodes = [node] if node else []
    else:
        nodes, reason = nodes_here(settings)
    if not nodes:
        return [f"left to SIGTERM: {reason}"]
    keeper = KeeperCalls(settings["keeper"], CALLER).hold if settings["keeper"] else None
    return stop([_Stopped(node, settings["actions"]) for node in nodes], settings, keeper)


def stop(
    nodes: Sequence[Stopped],
    settings: Mapping[str, Any],
    hold: Callable[[str, str, float], str] | None,
    now: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> list[str]:
    """Stop the nodes within their deadline; remarks on what was not as it should be."""
    total = float(settings["stop_deadline"])
    end = now() + total - min(LEAVING, total / 3)
    try:
        remarks = drain(nodes, hold, end - now(), now, sleep)
    except Exception as error:  # a node that cannot be drained has to be stopped all the same
        remarks = [f"not drained: {type(error).__name__}: {error}"]
    remarks += let_calls_end(nodes, end - now(), now, sleep)
    if not settings["expect_node"]:
        return remarks  # roslaunch takes the end of a node for its failure, and starts it again or ends the others
    for node in nodes:
        try:
            node.unregister()
        except Exception as error:  # a master that is away will know nothing of the node when it comes back
            remarks.append(f"not unregistered: {error}")
        # a call may have come meanwhile; from now on nobody finds the node any more
        remarks += let_calls_end([node], end - now(), now, sleep)
        # It unregisters by itself, too, but rospy does so in a thread that ends with the process, and the main thread
        # sees the shutdown first: on a busy machine half of it stayed registered.
        node.shut_down()
    return list(dict.fromkeys(remarks))


def let_calls_end(
    nodes: Sequence[Stopped], seconds: float, now: Callable[[], float], sleep: Callable[[float], None]
) -> list[str]:
    """Wait until no service call is under way; a client that only stays connected is not waited for."""
    ended = poll(lambda: _quiet(nodes), max(seconds, 0.0), CALL_TICK, now=now, sleep=sleep)
    return [] if ended.verdict == PASS else [f"stopped with {ended.last} service calls under way"]


def drain(
    nodes: Sequence[Stopped],
    hold: Callable[[str, str, float], str] | None,
    seconds: float,
    now: Callable[[], float],
    sleep: Callable[[float], None],
) -> list[str]:
    """Wait until no goal is open. New ones are held back where a keeper does that, so that this has an end."""
    remarks, held = [], []
    actions = [(node, action) for node in nodes for action in node.actions()]
    for node, action in actions:
        reason = hold(action, node.name, seconds + HOLD) if hold else "there is no keeper"
        if reason:
            remarks.append(f"goals of {action} are not held: {reason}")
        else:
            held.append((node, action))

    def probe() -> Seen:
        for node, action in held:  # at every look: the master tells the server of each new client
            node.isolate(action)
        open_goals = [word for node, action in actions for word in busy(action, node.status(action))]
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


def _quiet(nodes: Sequence[Stopped]) -> Seen:
    """How many calls are under way; none where neither the kernel nor the node tells: it serves nobody any more."""
    calls = 0
    for node in nodes:
        with contextlib.suppress(Exception):
            calls += node.calls()
    return Seen(WAIT if calls else PASS, calls)


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
        self.name = node.name
        self.isolate = node.isolate
        self.unregister = partial(node.unregister, self.ros)
        self.calls = node.calls
        self.shut_down = node.shut_down

    def actions(self) -> list[str]:
        return self.node.actions(self.ros, self.expected)

    def status(self, action: str) -> StatusReading:
        return self.node.status(self.ros, action)
