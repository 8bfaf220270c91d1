# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys of the inventory as fields of types: what is to be known of a key stands in its field, and nowhere else.

A dataclass or a TypedDict is a mapping of the inventory. `Annotated` says of a field what its type does not: its form
as JSON Schema, a function that its value goes through, or what its default `Follows` from. The text below a field is
the key's description. The objects (`read`), the validation's schema (`schema_of`) and the roles' argument specs
(tools/docs/keys.py) are made of these.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NamedTuple, Required, TypeVar, Union, get_args, get_origin, get_type_hints

Schema = Mapping[str, Any]
T = TypeVar("T")

SIMPLE = {str: "string", int: "integer", float: "number", bool: "boolean"}


def text(form: str | None = None) -> Schema:
    """A text, of a form (formats.FORMS) where one is named."""
    return {"type": "string", "format": form} if form else {"type": "string", "minLength": 1}


def either(allowed: str, *schemas: Schema) -> Schema:
    """One of several schemas, with words for all of them."""
    return {"anyOf": list(schemas), "x-allowed": allowed}


def number(low: float, above: bool = False) -> Schema:
    """A number from `low` on, or above it."""
    return {"type": "number", "exclusiveMinimum" if above else "minimum": low}


def whole(low: int, high: int = 86400) -> Schema:
    """A whole number; a day is the longest time that makes sense in seconds."""
    return {"type": "integer", "minimum": low, "maximum": high}


@dataclass(frozen=True)
class Follows:
    """A default that follows from what is said beside the key."""

    of: Callable[[Mapping[str, Any]], Any]


class Kind(NamedTuple):
    """A type taken apart: without `| None`, with the kinds or choices within it, and with what `Annotated` says."""

    type: Any
    inner: tuple[Any, ...]
    notes: tuple[Any, ...]


class Key(NamedTuple):
    """A field. Its default is MISSING where the key has to be said, None where there is none or one that follows."""

    kind: Kind
    default: Any
    follows: Follows | None

    @property
    def required(self) -> bool:
        return self.default is MISSING


def kind_of(hint: Any) -> Kind:
    """A type as it is written."""
    notes: tuple[Any, ...] = ()
    while True:
        origin, args = get_origin(hint), get_args(hint)
        if origin is Annotated:
            hint, notes = args[0], (*args[1:], *notes)
        elif origin is Required or (origin in (Union, UnionType) and args[1:] == (NoneType,)):
            hint = args[0]
        else:
            inner = args if origin is Literal else tuple(kind_of(one) for one in args if one is not ...)
            return Kind(origin or hint, inner, notes)


@functools.cache
def keys(of: Any) -> Mapping[str, Key]:
    """The keys of a dataclass or a TypedDict, by name."""
    items = {item.name: item for item in fields(of)} if is_dataclass(of) else {}
    found = {}
    for name, hint in get_type_hints(of, include_extras=True).items():
        kind, default = kind_of(hint), None
        follows = next((note for note in kind.notes if isinstance(note, Follows)), None)
        if name in items and not follows and items[name].default_factory is MISSING:
            default = items[name].default
        elif not items and (of.__total__ or get_origin(hint) is Required):
            default = MISSING
        found[name] = Key(kind, default, follows)
    return found


def read(of: Callable[..., T], said: Mapping[str, Any]) -> T:
    """The object that a mapping describes; null and the empty text stand for the default, other keys are not looked at.

    Raises KeyError, TypeError or AttributeError for what the schema refuses.
    """
    given = {name: value for name, value in said.items() if value is not None and value != ""}
    known = keys(of)
    given |= {name: key.follows.of(given) for name, key in known.items() if key.follows and name not in given}
    return of(**{name: _value(key.kind, given[name]) for name, key in known.items() if name in given})


def _value(kind: Kind, value: Any) -> Any:
    for note in kind.notes:
        if callable(note):
            value = note(value)
    if kind.type is tuple:
        return tuple(_value(kind.inner[0], item) for item in value)
    if kind.type is Mapping:
        return {str(name): _value(kind.inner[1], item) for name, item in value.items()}
    return read(kind.type, value) if isinstance(kind.type, type) and is_dataclass(kind.type) else value


def plain(value: Any) -> Any:
    """An object in mappings, lists and scalars, of which `read` makes it again."""
    if is_dataclass(value):
        return {item.name: plain(getattr(value, item.name)) for item in fields(value)}
    if isinstance(value, Mapping):
        return {name: plain(item) for name, item in value.items()}
    return [plain(item) for item in value] if isinstance(value, (list, tuple)) else value


def schema_of(hint: Any) -> Schema:
    """The JSON Schema of a type. Mappings are closed: a key that nobody reads is a mistake that nobody would see."""
    return _schema(kind_of(hint))


def _schema(kind: Kind) -> Schema:
    """A form with a type of its own stands for what the type says, else it adds to that."""
    form = {word: value for note in kind.notes if isinstance(note, Mapping) for word, value in note.items()}
    return form if {"type", "anyOf"} & set(form) else {**_of_type(kind), **form}


def _of_type(kind: Kind) -> Schema:
    if kind.type is Literal:
        return {"enum": list(kind.inner)}
    if kind.type is tuple:
        return {"type": "array", "items": _schema(kind.inner[0])}
    if kind.type is Mapping:
        names, values = map(_schema, kind.inner)
        return {"type": "object", "propertyNames": names, "additionalProperties": values}
    if kind.type in SIMPLE:
        return {"type": SIMPLE[kind.type]}
    if kind.type is Any:
        return {}
    known = keys(kind.type)
    return {
        "type": "object",
        "properties": {name: _schema(key.kind) for name, key in known.items()},
        "required": [name for name, key in known.items() if key.required],
        "additionalProperties": False,
    }
