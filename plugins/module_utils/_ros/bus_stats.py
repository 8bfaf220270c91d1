# SPDX-License-Identifier: GPL-3.0-or-later
"""A node's getBusStats replies, one after the other -> how many messages and bytes went over its topics.

Pure but for `rates`. For them nothing is subscribed to, and nobody is woken.

Both client libraries count per connection and from its beginning, in differing shapes:

    rospy   [1, "", [pubs, subs, services]]   pub [topic, bytes, [[id, bytes, messages, connected], ..]]
    roscpp  [pubs, subs]                      pub [topic, [[id, bytes, data bytes, messages, 0], ..]]
    both                                      sub [topic, [[id, bytes, messages, drops, connected], ..]]

roscpp casts its counts to int32, so they wrap; it names one connection of a subscription only, the last one. rospy does
not wrap: past 2^31-1 its whole call faults.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Iterable, Mapping

from .._common.errors import RosError
from .graph import Count, Flow, Graph, Link, NodeKey, Rate, Stats
from .replies import rows, unwrap
from .rpc import Api, Deadline, Master, in_parallel, reason

OUT, IN = "out", "in"
WRAP = 1 << 32
# A count that went down has wrapped if it is then not far from where it was. Half of the range in one interval of ten
# seconds would be 200 MB/s; a restarted count, on the other hand, seldom looks like a small step.
WRAP_STEP = 1 << 31
LEAST_COUNT = 3  # messages that tell a rate


@dataclass(frozen=True)
class Counted:
    """What was counted of one node so far. `process` tells its process from a later one under the same name."""

    process: tuple[str, int]
    totals: Mapping[Flow, Count] = field(default_factory=dict)
    links: Mapping[Link, Count] = field(default_factory=dict)
    highest: int = -1  # connection so far: both libraries number them upwards


def stats(reply: Any) -> Stats:
    """A raw reply of either library; RosError where it is neither."""
    bare = isinstance(reply, (list, tuple)) and bool(reply) and isinstance(reply[0], (list, tuple))
    value = reply if bare else unwrap(reply)
    if not isinstance(value, (list, tuple)) or len(value) < 2:
        raise RosError("the reply is not a list of publishers and subscribers")
    links: dict[Link, Count] = {}
    flows = set()
    for direction, entries in ((OUT, value[0]), (IN, value[1])):
        for entry in rows(entries, 2):
            if not isinstance(entry[0], str):
                continue
            flows.add((entry[0], direction))
            # the connections come last, whatever stands before them
            for row in rows(entry[-1], 4):
                # the fourth of five fields of a publisher is roscpp's count, after the bytes without headers
                messages = row[3] if direction == OUT and len(row) > 4 else row[2]
                if all(isinstance(number, int) for number in (row[0], row[1], messages)):
                    links[(entry[0], direction, row[0])] = Count(messages, row[1])
    return Stats(links, frozenset(flows), bare)


def _step(before: int, now: int, wraps: bool) -> int:
    """By how much one count of a connection grew."""
    if wraps:
        step = (now - before) % WRAP
        return step if step < WRAP_STEP else now % WRAP  # else it began anew
    return now - before if now >= before else now


def advance(
    before: Counted | None, process: tuple[str, int], new: Stats, fresh: bool, ignored: Iterable[int] = ()
) -> Counted:
    """What was counted with one more reply.

    `fresh`: an unknown process is younger than the last look, so all that it counted came since. Of any other the first
    reply is where counting begins: a restarted exporter must not count again what the one before it did.
    Likewise a connection that is new by its number has counted since the last look; one that was only not in the reply
    (of several, roscpp names whichever is the last) has counted for who knows how long.
    `ignored` connections are not the node's own business: they are ours.
    """
    so_far = before or Counted(process)
    known = before is not None and before.process == process
    last, highest = (so_far.links, so_far.highest) if known else ({}, -1)
    links = {link: count for link, count in new.links.items() if link[2] not in set(ignored)}
    grown: dict[Flow, list[Count]] = {flow: [] for flow in new.flows}
    for link, count in links.items():
        start = last.get(link)
        if start is None:
            born = link[2] > highest if known else fresh
            start = Count() if born else count
        steps = (_step(start.messages, count.messages, new.wraps), _step(start.bytes, count.bytes, new.wraps))
        grown[link[:2]].append(Count(*steps))
    totals = {flow: _sum(flow, so_far.totals.get(flow, Count()), steps) for flow, steps in grown.items()}
    return Counted(process, totals, links, max([highest, *(link[2] for link in new.links)]))


def _sum(flow: Flow, total: Count, steps: list[Count]) -> Count:
    """A publisher sends each message to all its subscribers: it is one message, however many copies went out."""
    messages = [step.messages for step in steps]
    more = max(messages, default=0) if flow[1] == OUT else sum(messages)
    return Count(total.messages + more, total.bytes + sum(step.bytes for step in steps))


def _sent(before: Stats, after: Stats) -> dict[str, int]:
    """Topic -> how many messages the node published between two replies, to those who listened all the time.

    Who came meanwhile does not count: the first message that it got may be a latched one.
    """
    found: dict[str, int] = {}
    for link, count in after.links.items():
        topic, direction, _number = link
        if direction == OUT and link in before.links:
            step = _step(before.links[link].messages, count.messages, after.wraps)
            found[topic] = max(found.get(topic, 0), step)
    return found


# ---- asking


def rates(ros: Master, graph: Graph, topics: Iterable[str], seconds: float) -> dict[str, Rate]:
    """The rates of topics over so many seconds, and of each of their publishers in this graph that tells.

    A topic that nobody listens to is not in it: its publishers count nothing then.
    """
    publishers = {topic: graph.topic(topic).publishers for topic in topics}
    nodes = {key for keys in publishers.values() for key in keys if graph.at(key).reachable}
    before = _counts(ros, nodes)
    time.sleep(seconds)
    after = _counts(ros, nodes)
    errors = {key: one for half in (after, before) for key, one in half.items() if isinstance(one, str)}
    counted = {key: _sent(before[key][1], after[key][1]) for key in nodes if key not in errors}
    found = {}
    for topic, keys in publishers.items():
        told = [key for key in keys if topic in counted.get(key, ())]
        by = {key: _rate(counted[key][topic], after[key][0] - before[key][0]) for key in told}
        why = {key: errors[key] for key in keys if key in errors}
        if by or why:
            found[topic] = Rate.of_all(by, why)
    return found


def _rate(messages: int, seconds: float) -> Rate:
    return Rate(messages / seconds, messages, seconds, few=messages < LEAST_COUNT)


def _counts(ros: Master, nodes: Iterable[NodeKey]) -> dict[NodeKey, Any]:
    """Node -> the time and its counts; or why it does not tell them."""

    def task(uri: str) -> Any:
        with Api(uri, ros.caller, Deadline(ros.timeout)) as api:
            reply = api.raw("getBusStats", ros.caller)
            return time.monotonic(), stats(reply)

    def failed(key: NodeKey, error: BaseException) -> Any:
        return f"{key}: {reason(error, key.participant, ros.timeout)}"

    return in_parallel({key: partial(task, key.participant) for key in nodes}, ros.timeout, failed)
