# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""How many series a graph may make, whoever is in it. Pure.

Names come from whoever reaches the master. Each one that never comes again (rostopic's, rviz's, with a process id and
a time in it) would leave its series in the database for good, and a node with thousands of topics fill it.
"""

from __future__ import annotations

import re
from typing import Iterable, Mapping

from .._ros.names import ANONYMOUS
from .families import COUNTER, GAUGE, Family, Sample

MOST = 20_000  # samples of a scrape
LEFT_OUT = "ros_exporter_series_left_out"
NAMES = frozenset({"node", "topic", "service", "action", "publisher", "subscriber"})  # labels with names of the graph
# of several nodes that share a name; other numbers are added up
SMALLEST = ("ros_node_up", "ros_service_up", "ros_launch_process_up")

_ANONYMOUS = re.compile(ANONYMOUS + r"(?=/|\Z)")


def bounded(families: Iterable[Family], most: int = MOST) -> list[Family]:
    """The families with anonymous nodes under one name, and no more than so many samples; how many are left out.

    Where there are too many, the largest families are cut: the same samples as long as the graph stays as it is.
    """
    folded = [_folded(family) for family in families]
    sizes = [len(family.samples) for family in folded]
    room = _room(sizes, most)
    kept = [family if len(family.samples) <= room else _cut(family, room) for family in folded]
    left_out = sum(max(0, size - room) for size in sizes)
    about = "Samples left out because there are more than the exporter shows"
    return [*kept, Family(LEFT_OUT, GAUGE, about, [({}, float(left_out))])]


def stable(name: str) -> str:
    """A name without what makes it another one in each process.

    >>> stable("/rostopic_4711_1700000000000/debug")
    '/rostopic_*/debug'
    """
    return _ANONYMOUS.sub("_*", name)


def _folded(family: Family) -> Family:
    """Series of anonymous nodes as one; none of a counter, which begins anew with each of them."""
    plain: list[Sample] = []
    shared: dict[tuple[tuple[str, str], ...], list[float]] = {}
    for labels, value in family.samples:
        found = {key: stable(word) if key in NAMES else word for key, word in labels.items()}
        if found == labels:
            plain.append((labels, value))
        elif family.kind != COUNTER:
            shared.setdefault(tuple(found.items()), []).append(value)
    if len(plain) == len(family.samples):
        return family
    merge = min if family.name in SMALLEST else sum
    return family._replace(
        samples=[*plain, *((dict(labels), float(merge(values))) for labels, values in shared.items())]
    )


def _room(sizes: Iterable[int], most: int) -> int:
    """How many samples each family may have, so that all of them together have no more than `most`."""
    left, room = most, 0
    ranked = sorted(sizes)
    for number, size in enumerate(ranked):
        room = left // (len(ranked) - number)
        if size > room:
            return room
        left -= size
    return max([room, *ranked])


def _cut(family: Family, room: int) -> Family:
    return family._replace(samples=sorted(family.samples, key=_by_labels)[:room])


def _by_labels(sample: Sample) -> list[tuple[str, str]]:
    labels: Mapping[str, str] = sample[0]
    return sorted(labels.items())
