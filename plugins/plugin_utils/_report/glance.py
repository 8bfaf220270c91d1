# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A fleet's status at a glance: how good each row is, how many of each kind, and a line per host. Pure."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._ros.checks import RATE_TOLERANCE
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.formats import quantity_value
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.outcomes import BUSY, FAILED, OFFLINE, ROLLED_BACK
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.launched import SHARED

Row = dict[str, Any]
Rows = Sequence[Mapping[str, Any]]
Status = Mapping[str, Rows]  # by section

OK, WARN, BAD = "ok", "warn", "bad"
NEARLY_FULL = 0.9
WORKLOADS = ("masters", "helpers", "apps")
NAMED = 6  # a line has no room for the names of a whole fleet
_OUTCOMES = {FAILED: BAD, ROLLED_BACK: BAD, OFFLINE: WARN, BUSY: WARN}


def _host(row: Mapping[str, Any]) -> str:
    if row.get("reachable", True):
        return OK
    return WARN if row.get("group") == "robots" else BAD  # robots come and go


def _node(row: Mapping[str, Any]) -> str:
    if not row.get("ready"):
        return BAD
    return WARN if row.get("reason") else OK


def _workload(row: Mapping[str, Any]) -> str:
    return OK if int(row.get("ready", 0)) >= int(row.get("wanted", 1)) else BAD


def _claim(row: Mapping[str, Any]) -> str:
    if not row.get("bound"):
        return OK if row.get("unused") else BAD
    share = used_share(row)
    return WARN if share is not None and share >= NEARLY_FULL else OK


def used_share(row: Mapping[str, Any]) -> float | None:
    """How much of its size a claim holds; None where either is not known."""
    size = quantity_value(str(row.get("size") or ""))
    used = row.get("used_bytes")
    return float(used) / float(size) if size and used is not None else None


def _topic(row: Mapping[str, Any]) -> str:
    """By what an app's readiness says of it, as its update holds it. A rate that nobody can tell is not held."""
    promised, rate = row.get("promised"), row.get("rate")
    if not promised:
        return ""
    if not row.get("publishers"):
        return BAD
    return WARN if rate is not None and rate < promised["min_rate"] * (1 - RATE_TOLERANCE) else OK


def _outcome(row: Mapping[str, Any]) -> str:
    return _OUTCOMES.get(str(row.get("outcome")), OK)


# How good a row of each section is. What is not listed has nothing to judge.
_JUDGES: Mapping[str, Callable[[Mapping[str, Any]], str]] = {
    "problems": lambda _row: BAD,
    "hosts": _host,
    "nodes": _node,
    "masters": _workload,
    "helpers": _workload,
    "apps": _workload,
    "went_back": lambda _row: WARN,
    "ended": lambda _row: WARN,
    "ros_nodes": lambda row: OK if row.get("reachable") else BAD,
    "links": lambda row: WARN if row.get("broken") else "",
    "topics": _topic,
    "claims": _claim,
    "outcomes": _outcome,
    "steps": _outcome,
}


def level(section: str, row: Mapping[str, Any], off: Collection[str] = ()) -> str:
    """`ok`, `warn` or `bad`; empty where there is nothing to judge.

    What is not in order only because it is on one of the hosts that are `off` is no worse than they are.
    """
    judge = _JUDGES.get(section)
    found = judge(row) if judge else ""
    unknown = bool(off) and section == "claims" and found == OK and is_unknown(section, row, off)
    return WARN if unknown or (found == BAD and because_off(section, row, off)) else found


def hosts_off(status: Status) -> frozenset[str]:
    """Robots that are off. An edge host that is off is a fault, and so is all that it takes with it."""
    return frozenset(str(row.get("name")) for row in status.get("hosts") or [] if level("hosts", row) == WARN)


def hosts_away(status: Status) -> frozenset[str]:
    """All hosts that do not answer, of whatever group."""
    return frozenset(str(row.get("name")) for row in status.get("hosts") or [] if level("hosts", row) != OK)


def because_off(section: str, row: Mapping[str, Any], off: Collection[str]) -> bool:
    if section == "nodes":
        return row.get("name") in off
    if section in WORKLOADS:
        return bool(row.get("nodes")) and all(node in off for node in row["nodes"])
    if section in ("outcomes", "steps"):
        return row.get("outcome") == OFFLINE and row.get("host", row.get("robot")) in off
    return section in ("ros_nodes", "claims") and row.get("robot") in off


# What is counted: its words, where it comes from, and the word for one that is in order.
_COUNTED = (
    ("Hosts", "hosts", "up"),
    ("Nodes", "nodes", "ready"),
    ("ROS masters", "masters", "ready"),
    ("Helpers", "helpers", "ready"),
    ("Apps", "apps", "ready"),
    ("ROS nodes", "ros_nodes", "up"),
    ("Claims", "claims", "in order"),
    ("Last outcomes", "outcomes", "good"),
)


@dataclass(frozen=True)
class Count:
    """How many of a kind are in order. `unknown` are those that nobody can tell of, `of` whose they are.

    `untold` are hosts of which not even the number is known: no total has them.
    """

    label: str
    section: str
    word: str
    good: int
    total: int
    unknown: int = 0
    of: tuple[str, ...] = ()
    untold: tuple[str, ...] = ()
    level: str = OK

    @property
    def words(self) -> str:
        """`5 of 7 up, 2 unknown (robot2)`: what is not known never looks as if it were in order."""
        bad = self.total - self.good - self.unknown
        parts = [f"{self.good} of {self.total} {self.word}"] if self.total else []
        parts += [f"{bad} not"] if bad else []
        parts += [f"{self.unknown} unknown ({some(self.of)})"] if self.unknown else []
        parts += [f"{some(self.untold)} unknown"] if self.untold else []
        return ", ".join(parts)


def some(given: Sequence[str]) -> str:
    """A few names, and how many there are beside them."""
    rest = len(given) - NAMED
    return ", ".join(given[:NAMED]) + (f" and {rest} more" if rest > 0 else "")


def counts(status: Status) -> list[Count]:
    """Of everything of which there is something, or may be."""
    found = [_count(label, section, word, status) for label, section, word in _COUNTED]
    return [count for count in found if count.total or count.untold]


def _count(label: str, section: str, word: str, status: Status) -> Count:
    rows, off, away = list(status.get(section) or []), hosts_off(status), hosts_away(status)
    levels = [level(section, row, off) for row in rows]
    unknown = [row for row in rows if is_unknown(section, row, away)]
    of = {str(row.get("name" if section == "nodes" else "robot")) for row in unknown}
    untold = _untold(section, status, away)
    worst = next((one for one in (BAD, WARN) if one in levels), WARN if unknown or untold else OK)
    return Count(
        label, section, word, levels.count(OK), len(rows), len(unknown), tuple(sorted(of)), tuple(sorted(untold)), worst
    )


def _untold(section: str, status: Status, away: Collection[str]) -> set[str]:
    """Hosts that may have some of these, and nobody could look."""
    hosts, problems = status.get("hosts") or [], status.get("problems") or []
    robots = {str(row.get("name")) for row in hosts if row.get("group") == "robots"}
    if section == "ros_nodes":
        read = {str(row.get("robot")) for row in status.get("ros_nodes") or []}
        failed = {str(row["graph"]) for row in problems if row.get("graph")}
        return failed | (set() if SHARED in read else robots & set(away) - read)
    if section in ("nodes", "masters", "apps", "claims"):
        silent = {row["cluster"] for row in problems if row.get("cluster")}
        there = {str(row.get("name")) for row in hosts if row.get("cluster") in silent}
        return there if section == "nodes" else there & robots
    return set()


def is_unknown(section: str, row: Mapping[str, Any], off: Collection[str]) -> bool:
    """Its host does not answer, so what was last said of it says nothing now."""
    if section == "claims":  # that it is there is known, what it holds is not
        return row.get("used_bytes") is None and row.get("robot") in off
    return section in ("nodes", *WORKLOADS) and level(section, row) == BAD and because_off(section, row, off)


def host_lines(status: Status) -> list[Row]:
    """A line per host: what runs for it and what became of it."""
    outcomes = {row["host"]: row["outcome"] for row in status.get("outcomes") or []}
    nodes = {str(row["name"]): row for row in status.get("nodes") or []}
    return [
        {
            "host": host.get("name", ""),
            "group": host.get("group", ""),
            "state": "up" if host.get("reachable", True) else "offline",
            "node": _ready_word(nodes.get(str(host.get("name")))),
            "master": _share("masters", status, host),
            "apps": _share("apps", status, host),
            "ros_nodes": _share("ros_nodes", status, host),
            "topics": len(_own("topics", status, host)) or None,
            "messages": sum(float(row["rate"] or 0) for row in _own("topics", status, host)) or None,
            "outcome": outcomes.get(host.get("name"), ""),
            "level": host_level(status, host),
        }
        for host in status.get("hosts") or []
    ]


def host_level(status: Status, host: Mapping[str, Any]) -> str:
    """The worst of what belongs to the host. What a host that is off cannot show is no further fault."""
    if level("hosts", host) != OK:
        return level("hosts", host)
    found = [level(section, row) for section in (*WORKLOADS, "ros_nodes", "topics", "claims")
             for row in _own(section, status, host)]  # fmt: skip
    found += [level("nodes", row) for row in status.get("nodes") or [] if row.get("name") == host.get("name")]
    found += [level("outcomes", row) for row in status.get("outcomes") or [] if row.get("host") == host.get("name")]
    return next((one for one in (BAD, WARN) if one in found), OK)


def _own(section: str, status: Status, host: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    return [row for row in status.get(section) or [] if row.get("robot") == host.get("name")]


def _share(section: str, status: Status, host: Mapping[str, Any]) -> str:
    levels = [level(section, row) for row in _own(section, status, host)]
    return f"{levels.count(OK)}/{len(levels)}" if levels else ""


def _ready_word(node: Mapping[str, Any] | None) -> str:
    return "" if node is None else "Ready" if node.get("ready") else "NotReady"
