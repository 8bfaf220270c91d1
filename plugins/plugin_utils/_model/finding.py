# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""One finding about the operator's input: where, what is wrong, what would be right."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple, TypeVar

T = TypeVar("T")


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

    def as_dict(self) -> dict[str, str]:
        """Shape of an item of the validation's `errors`."""
        return {"path": self.path, "problem": self.problem, "allowed": self.allowed}

    def line(self) -> str:
        """The finding as one line for people."""
        return f"{self.path}: {self.problem}" + (f"; allowed: {self.allowed}" if self.allowed else "")


def join_path(path: str, *parts: str | int) -> str:
    """`join_path("hosts", "robot1", "ros_apps", 2)` is `hosts.robot1.ros_apps[2]`."""
    for part in parts:
        path += f"[{part}]" if isinstance(part, int) else f".{part}" if path else part
    return path


def repeated(items: Sequence[T]) -> Iterator[tuple[int, T]]:
    """The items that stand there before, and where they do so again."""
    return ((index, item) for index, item in enumerate(items) if item in items[:index])


def unique(problems: Iterable[Problem]) -> list[Problem]:
    """The problems without repetition, in order of appearance."""
    return list(dict.fromkeys(problems))


def shown(value: Any, limit: int = 60) -> str:
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
    return text if len(text) <= limit else text[: limit - 4] + "...'"
