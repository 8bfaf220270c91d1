# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys of the inventory as fields of types: what is to be known of a key stands in its field, and nowhere else.

A dataclass or a TypedDict is a mapping of the inventory. `Annotated` says of a field what its type does not: its form,
a Kind that stands for what the inventory may say, a function that makes of this what is kept, or what its default
`Follows` from. The text below a field is the key's description. The objects (`read`), the validation and the roles'
argument specs (tools/docs/keys.py) are made of these.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from types import NoneType, UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    NamedTuple,
    Required,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

from ...module_utils._common.documents import Variables
from .formats import FORMS, words

T = TypeVar("T")
OPEN = "open"  # a note of a kind: it may have keys that nobody knows


@dataclass(frozen=True)
class Follows:
    """A default that follows from what is said beside the key."""

    of: Callable[[Variables], Any]


class Kind(NamedTuple):
    """A type taken apart: without `| None`, with what `Annotated` says.

    `inner` are the kinds of its items or of its alternatives, its choices, or its keys by name.
    """

    type: Any
    inner: Any = ()
    notes: tuple[Any, ...] = ()

    @property
    def said(self) -> Kind:
        """What the inventory may say."""
        return next((note for note in self.notes if isinstance(note, Kind)), self)


class Key(NamedTuple):
    """A field. Its default is MISSING where the key has to be said, None where there is none or one that follows."""

    kind: Kind
    default: Any = None
    follows: Follows | None = None

    @property
    def required(self) -> bool:
        return self.default is MISSING


def text(form: str) -> Kind:
    """A text of a form that has a name."""
    return kind_of(Annotated[str, FORMS[form]])


def either(allowed: str, *hints: Any) -> Kind:
    """One of several types, with words for all of them."""
    return Kind(Union, tuple(map(kind_of, hints)), (words(allowed),))


def kind_of(hint: Any) -> Kind:
    """A type as it is written."""
    notes: tuple[Any, ...] = ()
    while True:
        origin, args = get_origin(hint), get_args(hint)
        if origin is Annotated:
            hint, notes = args[0], (*args[1:], *notes)
        elif origin is Required or (origin in (Union, UnionType) and args[1:] == (NoneType,)):
            hint = args[0]
        elif is_dataclass(hint) or is_typeddict(hint):
            return Kind(hint, keys(hint), notes)
        else:
            inner = args if origin is Literal else tuple(kind_of(one) for one in args if one is not ...)
            return Kind(Union if origin is UnionType else origin or hint, inner, notes)


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


def read(of: Callable[..., T], said: Variables) -> T:
    """The object that a mapping describes; null and the empty text stand for the default, other keys are not looked at.

    Raises KeyError, TypeError or AttributeError for what the validation refuses.
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
