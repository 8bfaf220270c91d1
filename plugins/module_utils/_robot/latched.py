# SPDX-License-Identifier: GPL-3.0-or-later
"""What a node had latched when it was stopped, and what becomes of it. Pure: what happens is told to it, with the time.

docs/updates.md, "Latched topics", says what is given to whom, and why.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Iterable, Mapping

from .._ros.contract import ACTION_TOPICS
from .._ros.names import stem

SETTLE = 2.0  # seconds for the next publisher to latch by itself what it knows
EXPIRES = 600.0  # seconds without one
WAIT, OFFER, DROP = "wait", "offer", "drop"

# What every version latches anew at its start: dynamic_reconfigure's, and what is logged.
_OWN = ("/parameter_descriptions", "/parameter_updates")


def worth_keeping(published: Iterable[str], subscribed: Iterable[str]) -> list[str]:
    """Topics of a node that may have something latched which its next version knows nothing of. No action's."""
    topics = sorted(published)
    actions = [name[: -len("/status")] for name in topics if name.endswith("/status")]
    served = {name for name in actions if f"{name}/goal" in set(subscribed)}
    left_out = {"/rosout", *(f"{name}/{part}" for name in served for part in ACTION_TOPICS)}
    return [topic for topic in topics if topic not in left_out and not topic.endswith(_OWN)]


@dataclass
class Value:
    """A message that `node`, which was at the address `uri`, had latched on `topic`; it lies in a file.

    `had`: subscriber -> its address, of those that have the message and have not hung up since. `beside`: addresses of
    others that published the topic at the same time; None until the graph was looked at. What they latched then was
    there beside this message, and takes nobody's place.
    """

    topic: str
    node: str
    uri: str
    header: dict[str, str]  # type, md5sum, message_definition
    file: str
    size: int
    had: dict[str, str]
    beside: list[str] | None = None
    offered: bool = field(default=False, compare=False)
    alone: float | None = field(default=None, compare=False)  # since when there is no next publisher,
    followed: float | None = field(default=None, compare=False)  # or there is one

    @property
    def key(self) -> tuple[str, str]:
        """A newer value of the same key takes its place."""
        return self.topic, stem(self.node)

    def place(self, publishers: Mapping[str, str], addresses: Mapping[str, str]) -> None:
        """The first look at the graph: who publishes the topic (name -> address), and where its subscribers are."""
        if self.beside is None:
            self.beside = sorted(uri for name, uri in publishers.items() if stem(name) != stem(self.node))
            self.had = {name: addresses.get(name, "") for name in self.had}

    def step(self, publishers: Mapping[str, str], subscribers: Iterable[str], now: float) -> str:
        """What to do with it. `publishers` of the topic: name -> address, without the keeper; `subscribers`: names."""
        others = [uri for uri in publishers.values() if uri not in (self.beside or ())]
        if self.uri in others:  # the node is still there, and gives it by itself
            self.alone = self.followed = None
            return WAIT
        if not others:
            self.alone, self.followed = now if self.alone is None else self.alone, None
            return DROP if now - self.alone >= EXPIRES else WAIT
        self.alone, self.followed = None, now if self.followed is None else self.followed
        # only now: a master that was restarted knows of no subscriber, and of no publisher either
        there = set(subscribers)
        self.had = {name: uri for name, uri in self.had.items() if name in there}
        return OFFER if now - self.followed >= SETTLE else WAIT

    def is_over(self, uri: str, heard: bool, news: int) -> bool:
        """Whether a publisher took its place: a next one that said anything, or one that was beside it with `news`."""
        if uri == self.uri or self.beside is None:
            return False
        return news > 0 if uri in self.beside else heard

    def is_due(self, subscriber: str, uri: str) -> bool:
        """Whether one that has just connected is to get it. `uri`: its address, or empty: not known."""
        known = self.had.get(subscriber)
        return known is None or bool(known and uri and known != uri)


_KEPT = ("topic", "node", "uri", "header", "file", "size", "had", "beside")


def from_kept(data: Any) -> list[Value]:
    """The reverse of as_kept(); none of anything else."""
    try:
        return [Value(**{name: item[name] for name in _KEPT}) for item in data["values"]]
    except (KeyError, TypeError):
        return []


def as_kept(values: Iterable[Value], boot: str) -> dict[str, object]:
    """`boot` of the host, after which they are worth nothing: nodes that it starts know of no event either."""
    return {"boot": boot, "values": [{name: getattr(value, name) for name in _KEPT} for value in values]}
