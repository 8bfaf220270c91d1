# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rates of topics by what their publishers say that they have sent: nothing is subscribed to, and nobody woken."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from typing import Any, Callable, Iterable, Mapping

from . import bus_stats
from .graph import Graph, NodeKey, Rate
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
    ros: Master, graph: Graph, topics: Iterable[str], seconds: float, sleep: Callable[[float], None] = time.sleep
) -> dict[str, Rate]:
    """The rates of topics over so many seconds, and of each of their publishers in this graph that tells.

    A topic that nobody listens to is not in it: its publishers count nothing then.
    """
    publishers = {topic: graph.topic(topic).publishers for topic in topics}
    nodes = {key for keys in publishers.values() for key in keys if graph.at(key).reachable}
    before = _counts(ros, nodes)
    sleep(seconds)
    after = _counts(ros, nodes)
    counted = {key: _grown(before[key], after[key]) for key in nodes}
    rates = {
        topic: _rate(topic, {key: counted[key] for key in keys if key in counted}) for topic, keys in publishers.items()
    }
    return {topic: rate for topic, rate in rates.items() if rate is not None}


def _rate(topic: str, counted: Mapping[NodeKey, _Counted]) -> Rate | None:
    """The sum of what a topic's publishers sent."""
    by = {key: _rate_of(one.messages[topic], one.seconds) for key, one in counted.items() if topic in one.messages}
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


def _counts(ros: Master, nodes: Iterable[NodeKey]) -> dict[NodeKey, Any]:
    """Node -> the time and its counts; or why it does not tell them."""

    def task(uri: str) -> Any:
        with Api(uri, ros.caller, Deadline(ros.timeout)) as api:
            reply = api.raw("getBusStats", ros.caller)
            return time.monotonic(), bus_stats.stats(reply)

    def failed(key: NodeKey, error: BaseException) -> Any:
        return f"{key}: {reason(error, key.participant, ros.timeout)}"

    return in_parallel({key: partial(task, key.participant) for key in nodes}, ros.timeout, failed)
