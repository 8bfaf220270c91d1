# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rates of topics by what their publishers say that they have sent: nothing is subscribed to, and nobody woken."""

from __future__ import annotations

import time
from functools import partial
from typing import Any, Callable, Iterable

from . import bus_stats
from .graph import Graph, NodeKey, Rate
from .master import Master
from .rpc import Api, Deadline, in_parallel, reason

LEAST_COUNT = 3  # messages that tell a rate


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
    errors = {key: one for half in (after, before) for key, one in half.items() if isinstance(one, str)}
    counted = {key: bus_stats.sent(before[key][1], after[key][1]) for key in nodes if key not in errors}
    found = {}
    for topic, keys in publishers.items():
        by = {
            key: _rate(counted[key][topic], after[key][0] - before[key][0])
            for key in keys
            if topic in counted.get(key, ())
        }
        why = {key: errors[key] for key in keys if key in errors} if not by else {}
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
            return time.monotonic(), bus_stats.stats(reply)

    def failed(key: NodeKey, error: BaseException) -> Any:
        return f"{key}: {reason(error, key.participant, ros.timeout)}"

    return in_parallel({key: partial(task, key.participant) for key in nodes}, ros.timeout, failed)
