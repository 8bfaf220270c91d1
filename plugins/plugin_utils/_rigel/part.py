# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A mapping of the Rigelfile that is taken apart key by key, and what was said about its keys meanwhile."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, TypeVar

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.finding import Problem, join_path, shown

T = TypeVar("T")

TAKEN, SAME, CHANGED, LEFT, OPEN = "taken", "the same", "another way", "no counterpart", "to fill in"
WORDS = {str: "a text", bool: "true or false", dict: "a mapping", list: "a list", int: "a whole number"}


class Note(NamedTuple):
    """What became of a key: where it stands, how it fared, and where it is now, or why not and what to do."""

    path: str
    verdict: str
    told: str


class Notes:
    """What is said on the way; `problems` are what cannot be imported as it stands."""

    def __init__(self) -> None:
        self.all: list[Note] = []
        self.problems: list[Problem] = []

    def say(self, path: str, verdict: str, told: str) -> None:
        self.all.append(Note(path, verdict, told))


class Part:
    """A mapping. Every key of it is taken, or left over in the end: nothing is passed over in silence."""

    def __init__(self, value: Any, path: str, notes: Notes) -> None:
        self.path, self.notes = path, notes
        self.value: dict[str, Any] = {}
        if isinstance(value, Mapping):
            self.value = copy.deepcopy(dict(value))
        elif value is not None:
            self.wrong("", value, "a mapping")

    def __contains__(self, key: str) -> bool:
        return key in self.value

    def at(self, key: str | int) -> str:
        """The path of a key."""
        return join_path(self.path, key)

    def take(self, key: str, kind: type[T]) -> T | None:
        """The value of a key; None where it is not there, or null, or (told as a problem) of another kind."""
        value = self.value.pop(key, None)
        if value is None or (isinstance(value, kind) and not (kind is int and isinstance(value, bool))):
            return value
        self.wrong(key, value, WORDS[kind])
        return None

    def text(self, key: str) -> str:
        """A text or a number as text; empty where there is none."""
        value = self.value.pop(key, None)
        if isinstance(value, (Mapping, list, bool)):
            self.wrong(key, value, "a text")
            return ""
        return "" if value is None else value if isinstance(value, str) else str(value)

    def words(self, key: str) -> list[str]:
        """A list of texts."""
        return [item if isinstance(item, str) else str(item) for item in self.take(key, list) or []]

    def part(self, key: str) -> Part:
        """The mapping below a key, an empty one where there is none."""
        return Part(self.value.pop(key, None), self.at(key), self.notes)

    def parts(self, key: str) -> Iterator[Part]:
        """The mappings of a list."""
        for index, item in enumerate(self.take(key, list) or []):
            yield Part(item, join_path(self.at(key), index), self.notes)

    def wrong(self, key: str, value: Any, allowed: str) -> None:
        self.notes.problems.append(
            Problem(join_path(self.path, key) if key else self.path, f"is {shown(value)}", allowed)
        )

    def say(self, key: str, verdict: str, told: str) -> None:
        """Say what became of a key."""
        self.notes.say(self.at(key) if key else self.path, verdict, told)

    def leave(self, key: str, why: str, verdict: str = LEFT) -> None:
        """Take a key that has no counterpart, if it is there, and say why."""
        if self.value.pop(key, None) is not None:
            self.say(key, verdict, why)

    def end(self, why: str) -> None:
        """Say of all keys that nobody took that they were left."""
        for key in list(self.value):
            self.leave(key, why)
