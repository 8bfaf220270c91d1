# SPDX-License-Identifier: GPL-3.0-or-later
"""A fleet's status at a glance: how good each row and each host is, and how many of each kind are. Pure."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

from . import rows
from .rows import BAD, OK, SHARED, WARN, Row, Status, some


def level(row: Row, off: Collection[str] = ()) -> str:
    """How good a row is. What is not in order only because it is on hosts that are `off` is no worse than they are."""
    found = row.told().level
    return WARN if is_unknown(row, off) or (found == BAD and _is_on(row, off)) else found


def is_unknown(row: Row, away: Collection[str]) -> bool:
    """Its hosts do not answer, so what was last said of it says nothing now."""
    if isinstance(row, rows.Claim):  # that it is there is known, what it holds is not
        return row.used_bytes is None and _is_on(row, away)
    return isinstance(row, (rows.Node, rows.Workload)) and row.told().level == BAD and _is_on(row, away)


def _is_on(row: Row, off: Collection[str]) -> bool:
    hosts = row.told().hosts
    return bool(hosts) and all(host in off for host in hosts)


def _whose(row: Row) -> str:
    """The host that a row is about."""
    match row:
        case rows.Node():
            return row.name
        case rows.LastRun():
            return row.host
    return row.robot if isinstance(row, rows.OfRobot) else ""


def hosts_off(status: Status) -> frozenset[str]:
    """Robots that are off. An edge host that is off is a fault, and so is all that it takes with it."""
    return frozenset(row.name for row in status.hosts if level(row) == WARN)


def hosts_away(status: Status) -> frozenset[str]:
    """All hosts that do not answer, of whatever group."""
    return frozenset(row.name for row in status.hosts if not row.reachable)


# What is counted, and the word for one that is in order.
_COUNTED = {
    "hosts": "up", "nodes": "ready", "masters": "ready", "helpers": "ready", "apps": "ready", "ros_nodes": "up",
    "claims": "in order", "outcomes": "good",
}  # fmt: skip


@dataclass(frozen=True)
class Count:
    """How many of a kind are in order: `5 of 7 up, 2 unknown (robot2)`. Unknown never looks as if it were in order."""

    section: str
    words: str
    level: str


def counts(status: Status) -> list[Count]:
    """Of everything of which there is something, or may be."""
    found = [_count(section, word, status) for section, word in _COUNTED.items()]
    return [count for count in found if count.words]


def _count(section: str, word: str, status: Status) -> Count:
    found, off, away = status.rows(section), hosts_off(status), hosts_away(status)
    levels = [level(row, off) for row in found]
    unknown = [row for row in found if is_unknown(row, away)]
    untold = sorted(_untold(section, status, away))  # not even their number is known, so that no total has them
    good = levels.count(OK)
    bad = len(found) - good - len(unknown)
    parts = [f"{good} of {len(found)} {word}"] if found else []
    parts += [f"{bad} not"] if bad else []
    parts += [f"{len(unknown)} unknown ({some(sorted(set(map(_whose, unknown))))})"] if unknown else []
    parts += [f"{some(untold)} unknown"] if untold else []
    return Count(section, ", ".join(parts), _worst(levels, WARN if unknown or untold else OK))


def _worst(levels: Collection[str], else_: str = OK) -> str:
    return next((one for one in (BAD, WARN) if one in levels), else_)


def _untold(section: str, status: Status, away: Collection[str]) -> set[str]:
    """Hosts that may have some of these, and nobody could look."""
    robots = {row.name for row in status.hosts if row.group == "robots"}
    if section == "ros_nodes":
        read = {row.robot for row in status.ros_nodes}
        failed = {row.graph for row in status.problems if row.graph}
        return failed | (set() if SHARED in read else robots & set(away) - read)
    if section in ("nodes", "masters", "apps", "claims"):
        silent = {row.cluster for row in status.problems if row.cluster}
        there = {row.name for row in status.hosts if row.cluster in silent}
        return there if section == "nodes" else there & robots
    return set()


def host_level(status: Status, host: rows.Host) -> str:
    """The worst of what belongs to the host. What a host that is off cannot show is no further fault."""
    if not host.reachable:
        return level(host)
    found = (status.workloads, status.ros_nodes, status.topics, status.claims, status.nodes, status.outcomes)
    return _worst([level(row) for section in found for row in section if _whose(row) == host.name])


def share(section: Iterable[Row], host: str) -> str:
    """How many rows of a host are in order, as `1/2`; empty where it has none."""
    levels = [level(row) for row in section if _whose(row) == host]
    return f"{levels.count(OK)}/{len(levels)}" if levels else ""
