# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is wrong with values, in words that somebody who runs robots understands: where, what, and what is allowed."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Mapping
from types import NoneType
from typing import Any, Literal, Union

from .._model.finding import Problem, each, join_path, shown
from .._model.formats import FILLED, Form
from .._model.keys import OPEN, Key, Kind
from .._model.secrets import is_secret

# Type -> whose values it takes, and its words; all others are mappings.
TYPES: dict[Any, tuple[Any, str]] = {
    str: (str, "text"),
    int: (int, "a whole number"),
    float: ((int, float), "a number"),
    bool: (bool, "true or false"),
    NoneType: (NoneType, "nothing"),
    tuple: (list, "a list"),
}
MAPPING = (dict, "a mapping")


def value_problems(value: Any, kind: Kind, path: str) -> list[Problem]:
    """Everything that is wrong with a value, in the order of the paths."""
    return [*dict.fromkeys(sorted(_wrong(value, kind.said, path), key=lambda problem: problem.path))]


def _wrong(value: Any, kind: Kind, path: str) -> Iterator[Problem]:
    forms = [note for note in kind.notes if isinstance(note, Form)]
    of_its_type = [one for one in kind.inner if fits(value, one)] if kind.type is Union else []
    if of_its_type:
        yield from _wrong(value, of_its_type[0], path)
    elif not fits(value, kind) or not all(form.test(value) for form in forms):
        found = "empty" if FILLED in forms and fits(value, kind) else _value(value, path)
        yield Problem(path, f"is {found}", allowed(kind))
    elif kind.type is tuple:
        for where, item in each(path, value):
            yield from _wrong(item, kind.inner[0].said, where)
    elif kind.type is Mapping:
        names, values = kind.inner
        for name, item in value.items():
            if any(_wrong(name, names, path)):
                yield Problem(path, f"has the key {shown(name)}", allowed(names))
            yield from _wrong(item, values.said, join_path(path, name))
    elif isinstance(kind.inner, Mapping):
        yield from _of_mapping(value, kind, path)


def fits(value: Any, kind: Kind) -> bool:
    """Whether a value is of a type. Of numbers it is the value that counts: 2.0 is a whole one."""
    if kind.type is Any:
        return True
    if kind.type is Literal:
        return value in kind.inner
    if kind.type is Union:
        return any(fits(value, one) for one in kind.inner)
    if isinstance(value, bool):
        return kind.type is bool
    if kind.type is int and isinstance(value, float):
        return value.is_integer()
    return isinstance(value, TYPES.get(kind.type, MAPPING)[0])


def _of_mapping(value: Mapping[str, Any], kind: Kind, path: str) -> Iterator[Problem]:
    """Mappings are closed: a key that nobody reads is a mistake that nobody would see."""
    known: Mapping[str, Key] = kind.inner
    for name, key in known.items():
        where = join_path(path, name)
        if name in value:
            yield from _wrong(value[name], key.kind.said, where)
        elif key.required:
            yield Problem(where, "is missing", allowed(key.kind.said))
    for name in set(value) - set(known) if OPEN not in kind.notes else ():
        told = "a variable of the collection's documentation"
        if len(known) < 30:
            told = "one of " + ", ".join(sorted(known))
        yield Problem(join_path(path, name), f"is unknown{did_you_mean(name, known)}", told)
    needs = next((note for note in kind.notes if isinstance(note, Mapping)), {})
    for name, other in ((name, other) for name, others in needs.items() for other in others):
        if name in value and other not in value:
            found = f"is missing, although {name} is set"
            yield Problem(join_path(path, other), found, f"{other} together with {name}")


def allowed(kind: Kind) -> str:
    """A kind in words."""
    forms = [note for note in kind.notes if isinstance(note, Form)]
    if forms and forms[-1] is not FILLED:
        return forms[-1].allowed
    if kind.type is Literal:
        words = [str(choice) for choice in kind.inner]
        return " or ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
    if kind.type is Union:
        return " or ".join(map(allowed, kind.inner))
    return ", ".join([TYPES.get(kind.type, MAPPING)[1], *(form.allowed for form in forms)])


def _value(value: Any, path: str) -> str:
    return "not acceptable" if isinstance(value, str) and is_secret(path) else shown(value)


def nearest_name(name: str, known: Iterable[str], cutoff: float = 0.6) -> str | None:
    """The known name that a misspelt one most likely means."""
    found = difflib.get_close_matches(name, sorted(known), 1, cutoff)
    return found[0] if found else None


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """The end of a finding about a name that nobody knows."""
    nearest = nearest_name(name, known)
    return f"; did you mean {nearest}?" if nearest else ""
