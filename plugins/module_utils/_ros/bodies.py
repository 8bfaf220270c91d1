# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading XML-RPC calls and replies of peers that may be hostile. Pure: whoever reads bytes bounds their number.

The library's own parser expands entities, so that a few hundred bytes become as much memory as the peer wants, and
reads numbers of any length, which takes the square of the length. No ROS peer needs either.
"""

from __future__ import annotations

import xmlrpc.client
from typing import Any, Callable
from xml.parsers import expat

from .._common.errors import RosError

DIGITS = 20  # of the least number of 64 bits, with its sign


class _Values(xmlrpc.client.Unmarshaller):
    """The library's, with whole numbers that end."""

    dispatch: dict[str, Callable[..., None]] = dict(xmlrpc.client.Unmarshaller.dispatch)  # noqa: RUF012 - inherited

    def end_number(self, data: str) -> None:
        if len(data.strip()) > DIGITS:
            raise RosError(f"a number has more than {DIGITS} digits")
        self.end_int(data)

    for _tag in ("i1", "i2", "i4", "i8", "int", "biginteger"):
        dispatch[_tag] = end_number


def loads(body: bytes) -> tuple[Any, str | None]:
    """As xmlrpc.client's `loads`: the parameters, and the method of a call; RosError on what is made to do harm."""
    values = _Values()
    parser = expat.ParserCreate()
    parser.StartElementHandler = values.start
    parser.EndElementHandler = values.end
    parser.CharacterDataHandler = values.data
    parser.StartDoctypeDeclHandler = _refuse  # entities are declared in a document type alone
    values.xml("", None)  # expat hands on text, which nobody has to decode
    parser.Parse(body, True)
    return values.close(), values.getmethodname()


def _refuse(*_: Any) -> None:
    raise RosError("a document type or entities are declared, which no ROS peer does")
