# SPDX-License-Identifier: GPL-3.0-or-later
"""One finding about the operator's input: where, what is wrong, what would be right."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator
from typing import Any, NamedTuple, TypeVar

T = TypeVar("T")
Place = TypeVar("Place", bound=Hashable)
What = TypeVar("What", bound=Hashable)


class Problem(NamedTuple):
    """path `hosts.robot1.ros_apps[2].placement`, problem `is 'cloud'`, allowed `local or remote`.

    Nothing allowed stands in what is no error.
    """

    path: str
    problem: str
    allowed: str = ""

    def below(self, path: str) -> Problem:
        """The finding in what is at `path`."""
        return self._replace(path=join_path(path, self.path))

    def line(self) -> str:
        """The finding as one line for people."""
        return f"{self.path}: {self.problem}" + (f"; allowed: {self.allowed}" if self.allowed else "")


def join_path(path: str, *parts: str | int) -> str:
    """`join_path("hosts", "robot1", "ros_apps", 2)` is `hosts.robot1.ros_apps[2]`."""
    for part in parts:
        path += f"[{part}]" if isinstance(part, int) else f".{part}" if path else part
    return path


def each(path: str, items: Iterable[T], key: str = "") -> Iterator[tuple[str, T]]:
    """The items of the list at `path`, each with its place, or with that of a `key` in it."""
    return ((f"{path}[{index}]{key}", item) for index, item in enumerate(items))


def taken(claims: Iterable[tuple[Place, What]]) -> Iterator[tuple[Place, What, Place]]:
    """Of places that each have something: where it is what another place has already, what it is, and where first."""
    first: dict[What, Place] = {}
    return ((place, what, first[what]) for place, what in claims if first.setdefault(what, place) != place)


def twice(
    claims: Iterable[tuple[str, What]], allowed: str, found: str = "is '{}' for the second time"
) -> Iterator[Problem]:
    """Of places that may not have the same: each that has what another place has already."""
    return (Problem(place, found.format(what), allowed) for place, what, _first in taken(claims))


def shown(value: Any) -> str:
    """A value as an operator wrote it, short enough for a message."""
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, (list, tuple)):
        return "a list"
    if value is None:
        return "empty (null)"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return f"the number {value}"
    text = repr(str(value))
    return text if len(text) <= 60 else text[:56] + "...'"
