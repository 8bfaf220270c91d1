# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rates of topics by what their publishers say that they have sent: nothing is subscribed to, and nobody woken."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from typing import Any, Callable, Iterable, Mapping, Sequence

from . import bus_stats
from .graph import Graph, Rate
from .master import Master
from .rpc import Api, Deadline, in_parallel, reason

LEAST_COUNT = 3  # messages that tell a rate


@dataclass(frozen=True)
class _Counted:
    """What one publisher sent, by topic, in so many seconds; or why it does not tell."""

    messages: Mapping[str, int]
    seconds: float
    error: str = ""


def sent(
    ros: Master,
    graph: Graph,
    publishers: Mapping[str, Sequence[str]],
    seconds: float,
    sleep: Callable[[float], None] = time.sleep,
) -> dict[str, Rate]:
    """The rates of topics, each with the publishers to ask, over so many seconds, and of each publisher that tells.

    A topic that nobody listens to is not in it: its publishers count nothing then.
    """
    nodes = {name for names in publishers.values() for name in names if graph.nodes[name].reachable}
    before = _counts(ros, graph, nodes)
    sleep(seconds)
    after = _counts(ros, graph, nodes)
    counted = {name: _grown(before[name], after[name]) for name in nodes}
    found = {}
    for topic, names in publishers.items():
        rate = _rate(topic, {name: counted[name] for name in names if name in counted})
        if rate is not None:
            found[topic] = rate
    return found


def _rate(topic: str, counted: Mapping[str, _Counted]) -> Rate | None:
    """The sum of what a topic's publishers sent."""
    by = {name: _rate_of(one.messages[topic], one.seconds) for name, one in counted.items() if topic in one.messages}
    if not by:
        errors = [one.error for one in counted.values() if one.error]
        return Rate(error="; ".join(errors)) if errors else None
    told = list(by.values())
    hz, messages = sum(one.hz for one in told), sum(one.messages for one in told)
    return Rate(hz, messages, max(one.seconds for one in told), by=by, few=all(one.few for one in told))


def _rate_of(messages: int, seconds: float) -> Rate:
    return Rate(messages / seconds, messages, seconds, few=messages < LEAST_COUNT)


def _grown(before: Any, after: Any) -> _Counted:
    for one in (before, after):
        if isinstance(one, str):
            return _Counted({}, 0.0, one)
    return _Counted(bus_stats.sent(before[1], after[1]), after[0] - before[0])


def _counts(ros: Master, graph: Graph, nodes: Iterable[str]) -> dict[str, Any]:
    """Node -> the time and its counts; or why it does not tell them."""

    def task(uri: str) -> Any:
        with Api(uri, ros.caller, Deadline(ros.timeout)) as api:
            reply = api.raw("getBusStats", ros.caller)
            return time.monotonic(), bus_stats.stats(reply)

    def failed(name: Any, error: BaseException) -> Any:
        return f"{name}: {reason(error, graph.nodes[name].uri, ros.timeout)}"

    return in_parallel({name: partial(task, graph.nodes[name].uri) for name in nodes}, ros.timeout, failed)
