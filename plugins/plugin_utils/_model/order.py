# SPDX-License-Identifier: GPL-3.0-or-later
"""An order in which everything comes after what it needs. Pure."""

from __future__ import annotations

import graphlib
from collections.abc import Iterable, Mapping


def in_order(needs: Mapping[str, Iterable[str]]) -> list[str]:
    """The keys, each after its needs, which are keys, too; within that in the order given. There is no `circle`."""
    found: list[str] = []
    while len(found) < len(needs):
        found.append(next(name for name, its in needs.items() if name not in found and {*its} <= {*found}))
    return found


def circle(needs: Mapping[str, Iterable[str]]) -> list[str]:
    """The members of one circle, each needing the next, first the first as given; empty if there is none."""
    try:
        graphlib.TopologicalSorter(needs).prepare()
    except graphlib.CycleError as error:
        members: list[str] = error.args[1][:0:-1]  # its first one stands at its end again
        start = members.index(min(members, key=list(needs).index))
        return [*members[start:], *members[:start]]
    return []
