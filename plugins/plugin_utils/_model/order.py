# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""An order in which everything comes after what it needs. Pure."""

from __future__ import annotations

import graphlib
from typing import Iterable, Mapping

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError


def in_order(needs: Mapping[str, Iterable[str]]) -> list[str]:
    """The keys, each after its needs, which are keys, too; within that in the order given. SpecError for a circle."""
    place = {name: number for number, name in enumerate(needs)}
    sorter = graphlib.TopologicalSorter(needs)
    try:
        sorter.prepare()
    except graphlib.CycleError as error:
        circle = " needs ".join(reversed(error.args[1]))
        raise SpecError(f"these depend on each other in a circle: {circle}") from None
    found: list[str] = []
    ready: set[str] = set()
    while sorter.is_active():
        ready |= set(sorter.get_ready())
        first = min(ready, key=lambda name: place[name])
        ready.discard(first)
        sorter.done(first)
        found.append(first)
    return found
