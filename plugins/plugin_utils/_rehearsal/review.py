# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a rehearsal showed: the update's outcome, and what the stand-ins got meanwhile. Pure."""

from __future__ import annotations

import json
import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._pod.stand_in import ACCOUNTS
from ansible_collections.rosops.fleet.plugins.module_utils._ros.recording import Recording

Accounts = Mapping[str, Mapping[str, Any]]  # node -> topic -> what it got


@dataclass(frozen=True)
class Received:
    """What a stand-in got on a topic during the update.

    `missing`: numbers that never came, None where messages have none. `twice`: those that came from two versions.
    `silence`: the longest time in seconds without a message.
    """

    topic: str
    subscriber: str
    publishers: tuple[str, ...]
    messages: int
    missing: int | None
    twice: int
    silence: float


@dataclass(frozen=True)
class Asked:
    """How often a stand-in greeted a service of the changed apps during the update, and how often nobody answered."""

    service: str
    client: str
    asked: int
    refused: int


@dataclass(frozen=True)
class Review:
    robot: str
    recorded: str  # whose graph it was
    change: Mapping[str, Any]
    outcome: str
    reason: str
    seconds: float
    steps: tuple[Mapping[str, Any], ...]
    received: tuple[Received, ...]
    asked: tuple[Asked, ...]

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)

    def lines(self) -> list[str]:
        """For people."""
        told = [f"{self.recorded}'s graph, {', '.join(self.change)} changed: {self.outcome or 'nothing was done'}"]
        told += [self.reason] if self.reason else []
        for step in self.steps:
            phases = ", ".join(f"{name} {seconds:.1f} s" for name, seconds in step["phases"].items())
            told.append(f"{step['name']}: {step['outcome']} by {step['handoff']}: {phases or 'not begun'}")
        told += [_line(one) for one in self.received]
        told += [f"{one.service} by {one.client}: asked {one.asked} times, {one.refused} refused" for one in self.asked]
        return told


def _line(one: Received) -> str:
    lost = "without numbers" if one.missing is None else f"{one.missing} lost, {one.twice} twice"
    return f"{one.topic} at {one.subscriber}: {one.messages} messages, {lost}, longest silence {one.silence:.2f} s"


def accounts(values: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Node -> its account, from the parameters of a recording."""
    below = f"{ACCOUNTS}/"
    return {f"/{name[len(below) :]}": json.loads(value) for name, value in values.items() if name.startswith(below)}


def received(before: Accounts, after: Accounts, since: float, topics: Iterable[str]) -> tuple[Received, ...]:
    """What came between two looks, `since` 1970, on these topics, and on others where something is missing."""
    wanted = set(topics)
    return tuple(one for one in _received(before, after, since) if one.topic in wanted or one.missing)


def asked(before: Accounts, after: Accounts) -> Iterator[Asked]:
    """What became of the greetings between two looks."""
    for node, service, then, now in _pairs(before, after, "asked"):
        yield Asked(service, node, now["asked"] - then["asked"], now["refused"] - then["refused"])


def _pairs(
    before: Accounts, after: Accounts, key: str
) -> Iterator[tuple[str, str, Mapping[str, Any], Mapping[str, Any]]]:
    """Node, topic or service, and its account then and now; all zeros for a stand-in that has begun since."""
    for node, own in sorted(after.items()):
        for name, now in sorted(own.items()):
            then = before.get(node, {}).get(name)
            if key in now:
                yield node, name, then if then and then[key] <= now[key] else defaultdict(int), now


def _received(before: Accounts, after: Accounts, since: float) -> Iterator[Received]:
    for node, topic, then, now in _pairs(before, after, "messages"):
        yield Received(
            topic,
            node,
            tuple(now["publishers"]),
            now["messages"] - then["messages"],
            None if now["missing"] is None else now["missing"] - (then["missing"] or 0),
            now["twice"] - then["twice"],
            max((seconds for ended, seconds in now["gaps"] if ended >= since), default=0.0),
        )


def review(  # noqa: PLR0913 - all that was seen, by name
    robot: str,
    recording: Recording,
    change: Mapping[str, Any],
    outcome: Mapping[str, Any],
    before: Accounts,
    after: Accounts,
) -> Review:
    """Of a robot; `outcome` is what _robot_update says of it."""
    steps = tuple(outcome.get("steps") or ())
    own = {node for app in change if app in recording.apps for node in recording.apps[app].nodes}
    topics = [name for name, topic in recording.topics.items() if own & set(topic.publishers)]
    since = min((step["started"] for step in steps), default=math.inf)
    return Review(
        robot,
        recording.robot,
        change,
        outcome.get("outcome", ""),
        outcome.get("reason", ""),
        round(sum(sum(step["phases"].values()) for step in steps), 1),
        steps,
        received(before, after, since, topics),
        tuple(asked(before, after)),
    )
