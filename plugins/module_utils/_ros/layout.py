# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""How the bytes of a message type lie: the length of one that is all zeros, and where the number is that counts them.

Pure; what a message is: `messages`.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Sequence

from .._common.errors import RosError
from .messages import HEADER, NUMBERS, TIMES, Definition, Field

COUNT = 4  # bytes of the number in front of a text or list
LARGEST = 64 * 1024 * 1024  # bytes of a message
COUNTERS = frozenset("iIqQ")
SEQUENCE = "sequence"  # what messages call a number that goes on from one version of their publisher to the next


@dataclass(frozen=True)
class Place:
    """Where a whole number is. `steps` lead there: bytes to pass over, or (negative) a list with items of so many.

    `code` is struct's. `own`: the number is its publisher's own, and begins anew with each; else they share it.
    """

    steps: tuple[int, ...]
    code: str
    own: bool


def smallest(definition: Definition) -> int:
    """Bytes of a message of zeros: its texts and lists of free length are empty."""
    size = _size(definition, definition.name)
    if size > LARGEST:
        raise RosError(f"a message of {definition.name} has {size} bytes, more than {LARGEST}")
    return size


def counter(definition: Definition) -> Place | None:
    """The number that counts the messages: a field `sequence`, else that of the header; None where there is none."""
    fields = definition.types[definition.name]
    for at, field in enumerate(fields):
        code = NUMBERS.get(field.kind, "")
        steps = _steps(definition, fields[:at])
        if field.name == SEQUENCE and code in COUNTERS and not field.is_list and steps is not None:
            return Place(tuple(steps), code, own=False)
    # both client libraries number the messages of a publisher there, and only where the header comes first
    if fields and fields[0].kind == HEADER and not fields[0].is_list:
        return Place((), "I", own=True)
    return None


def _size(definition: Definition, kind: str) -> int:
    plain = _plain(kind)
    if plain is not None:
        return plain
    if kind == "string":
        return COUNT
    return sum(_field_size(definition, field) for field in definition.types[kind])


def _field_size(definition: Definition, field: Field) -> int:
    if not field.is_list:
        return _size(definition, field.kind)
    return COUNT if field.length is None else field.length * _size(definition, field.kind)


def _plain(kind: str) -> int | None:
    """Bytes of a number or a time; None of anything else."""
    code = NUMBERS.get(kind) or TIMES.get(kind)
    return struct.calcsize(f"<{code.lstrip('<')}") if code else None


def _steps(definition: Definition, fields: Sequence[Field]) -> list[int] | None:
    """How to pass over fields; None where it takes more than sizes to know."""
    found: list[int] = []
    for field in fields:
        plain = _plain(field.kind)
        if field.is_list and plain is None:
            return None
        if field.is_list and field.length is None:
            found.append(-(plain or 0))
        elif plain is not None:
            found.append(plain * (1 if field.length is None else field.length))
        elif field.kind == "string":
            found.append(-1)
        else:
            inner = _steps(definition, definition.types[field.kind])
            if inner is None:
                return None
            found += inner
    return found
