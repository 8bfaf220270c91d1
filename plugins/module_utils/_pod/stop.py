# SPDX-License-Identifier: GPL-3.0-or-later
"""The stop hook: end the pod's own node so that it leaves the graph, once what it works on for others has ended.

roscpp as process 1 of a container ignores SIGTERM, and no node unregisters when it is killed; the slave API's
`shutdown` is what all nodes obey. Nodes that an app names itself (roslaunch) are found by the pod's address; roslaunch
ends them in its own way. Nothing here may keep a pod from being stopped.
"""

from __future__ import annotations

import os
import sys
import time
from functools import partial
from typing import Any, Callable, Sequence

from .._common.poll import PASS, WAIT, Polled, Seen, poll
from .._ros import keeper_client
from .._ros.checks import idle
from .._ros.graph import NodeKey, StatusReading
from .._ros.rpc import in_parallel
from .own_node import OwnNode, own_nodes
from .state import CALLER, TIMEOUT, load_settings

LEAVING = 3.0  # of the stop's time for the node to end by itself, or a third of it where there is less
FINDING = 8  # calls of whoever hangs that fit into the stop's time while the node is looked for
LEAST = 0.05  # s for a call when the time is over: a node that answers does so within that
HOLD = 300.0  # for the next server to come: goals are held so long
CALL_TICK = 0.05
LOG = "/proc/1/fd/1"  # of the container

Hold = Callable[[str, str, float, float], str]  # action, server, seconds to hold, seconds to answer -> why not
Failed = Callable[[BaseException], Any]


def why(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}"


def together(tasks: Sequence[Callable[[], Any]], seconds: float, failed: Failed = why) -> list[Any]:
    """What each of them returned, or what `failed` makes of its error. Who hangs holds up nobody else."""
    return list(in_parallel(dict(enumerate(tasks)), seconds, lambda _key, error: failed(error)).values())


class Time:
    """When each part of a stop is over that begins now. Kubernetes ends the pod not long after the last.

    The clock, and how several things are done at once, are handed in: the price of tests that never wait.
    """

    def __init__(
        self,
        total: float,
        now: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
        together: Callable[..., list[Any]] = together,
    ) -> None:
        self.now, self.sleep, self.together = now, sleep, together
        leaving, self.end = min(LEAVING, total / 3), now() + total
        self.quiet = self.end - leaving  # what is under way may end until then,
        self.late = self.end - leaving * 2 / 3  # a look at it that began before,
        self.away = self.end - leaving / 3  # the master's answers

    def left(self, end: float) -> float:
        """Seconds for a call that may last until `end`."""
        return max(LEAST, min(TIMEOUT, end - self.now()))

    def each(self, calls: Sequence[Callable[[float], Any]], end: float, failed: Failed = why) -> list[Any]:
        """What each returned that may last until `end`, or what is made of its error; all at once."""
        seconds = self.left(end)
        return self.together([partial(call, seconds) for call in calls], seconds, failed)

    def until_quiet(self, probe: Callable[[], Seen], interval: float, consecutive: int = 1) -> Polled:
        left = max(self.quiet - self.now(), 0.0)
        return poll(probe, left, interval, consecutive, now=self.now, sleep=self.sleep)


def main(_words: list[str]) -> int:
    """Always 0: Kubernetes would call a pod that has ended cleanly one that failed to stop."""
    try:
        remarks = _main()
    except Exception as error:  # whatever goes wrong here, the pod is going to be stopped
        remarks = [f"stop hook: {why(error)}"]
    if remarks:
        tell("rosops.fleet: " + "; ".join(remarks))
    return 0


def _main() -> list[str]:
    settings = load_settings(os.environ)
    total = float(settings.stop_deadline)
    clock = Time(total)
    nodes, reason = own_nodes(settings, min(TIMEOUT, total / FINDING))
    if not nodes:
        return [f"left to SIGTERM: {reason}"]
    hold = keeper_client.KeeperCalls(settings.keeper, CALLER).hold if settings.keeper else None
    return stop(nodes, settings.expect_node, hold, clock)


def stop(nodes: Sequence[OwnNode], expect_node: bool, hold: Hold | None, clock: Time) -> list[str]:
    """Stop the nodes before its time is over; remarks on what was not as it should be."""
    try:
        remarks = drain(nodes, hold, clock)
    except Exception as error:  # a node that cannot be drained has to be stopped all the same
        remarks = [f"not drained: {why(error)}"]
    remarks += let_calls_end(nodes, clock)
    words = clock.each([node.hand_over for node in nodes], clock.late)  # last: a goal or a call may latch something
    remarks += [f"what {node.name} has latched goes with it: {word}" for node, word in zip(nodes, words) if word]
    # It unregisters by itself, too, but rospy does so in a thread that ends with the process, and the main thread sees
    # the shutdown first: on a busy machine half of it stayed registered. A master that is away will know nothing of it
    # when it comes back.
    words = clock.each([node.unregister for node in nodes], clock.away, str)
    remarks += [f"not unregistered: {word}" for word in words if word]
    if expect_node:  # before its end, for which the next version of this name waits
        words = clock.each([node.forget for node in nodes], clock.away, str)
        remarks += [f"its parameters stay: {word}" for word in words if word]
    # a call may have come meanwhile; from now on nobody finds the node any more
    remarks += let_calls_end(nodes, clock)
    # roslaunch takes the end of a node for its failure, and starts it again or ends the others: those get its signal
    for node in nodes if expect_node else ():
        node.shut_down(clock.left(clock.end))
    return list(dict.fromkeys(remarks))


def let_calls_end(nodes: Sequence[OwnNode], clock: Time) -> list[str]:
    """Wait until no service call is under way; a client that only stays connected is not waited for."""

    def probe() -> Seen:
        # none where neither the kernel nor the node tells: it serves nobody any more
        calls = sum(clock.each([node.calls for node in nodes], clock.late, lambda _error: 0))
        return Seen(WAIT if calls else PASS, calls)

    ended = clock.until_quiet(probe, CALL_TICK)
    return [] if ended.verdict == PASS else [f"stopped with {ended.last} service calls under way"]


def drain(nodes: Sequence[OwnNode], hold: Hold | None, clock: Time) -> list[str]:
    """Wait until no goal is open. New ones are held back where a keeper does that, so that this has an end."""
    served = clock.each([node.actions for node in nodes], clock.quiet)
    remarks = [f"not drained: {names}" for names in served if isinstance(names, str)]
    found = [(node, names) for node, names in zip(nodes, served) if not isinstance(names, str)]
    actions = [(node, action) for node, names in found for action in names]
    if not actions:
        return remarks
    unheld = dict(zip(actions, _hold(actions, hold, clock)))
    remarks += [f"goals of {action} are not held: {reason}" for (_node, action), reason in unheld.items() if reason]
    held = [one for one in actions if not unheld[one]]
    uncut: dict[str, str] = {}

    def probe() -> Seen:
        seconds = clock.left(clock.late) / 2
        # at every look: the master tells the server of each new client
        cut = clock.together([partial(node.isolate, action, seconds) for node, action in held], seconds)
        uncut.update({action: word for (_node, action), word in zip(held, cut)})
        tasks = [partial(node.status, action) for node, action in actions]
        read = clock.each(tasks, clock.late, lambda error: StatusReading(error=why(error)))
        looks = [(action, *idle(NodeKey(node.name), status)) for (node, action), status in zip(actions, read)]
        open_goals = [f"{action} {reason}" for action, verdict, reason in looks if verdict != PASS]
        return Seen(WAIT if open_goals else PASS, open_goals)

    # Twice: a look may begin with a status from before the isolation, and a goal on its way stands in none yet.
    ended = clock.until_quiet(probe, 0.1, consecutive=2)
    remarks += [f"clients of {action} were not cut off from it: {word}" for action, word in uncut.items() if word]
    if ended.verdict != PASS:
        said = "; ".join(ended.last) or "idle once only"
        remarks.append(f"stopped with open goals after {ended.elapsed:.0f} s: {said}")
    return remarks


def _hold(actions: Sequence[tuple[OwnNode, str]], hold: Hold | None, clock: Time) -> list[str]:
    """Why the goals of each are not held. All are asked for at once: a keeper that hangs takes its time only once."""
    if hold is None:
        return ["there is no keeper"] * len(actions)
    left = clock.quiet - clock.now()
    seconds = max(LEAST, min(keeper_client.TIMEOUT, left / 2))
    tasks = [partial(hold, action, node.name, max(left, 0.0) + HOLD, seconds) for node, action in actions]
    return clock.together(tasks, seconds)


def tell(line: str) -> None:
    """On our output, which Kubernetes shows for a failing hook only, and in the container's log."""
    sys.stdout.write(f"{line}\n")
    if "ROSOPS_REVISION" not in os.environ:
        return  # no pod of ours, and its process 1 is somebody else's
    try:
        if os.path.samefile("/proc/self/fd/1", LOG):  # noqa: PTH121 - not a path of a file system
            return
        with open(LOG, "w", encoding="utf-8") as log:  # noqa: PTH123 - nor is that
            log.write(f"{line}\n")
    except OSError:
        pass
