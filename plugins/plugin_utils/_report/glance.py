# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A fleet's status at a glance: how good each row is, counts, a line per host, and what needs attention. Pure."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.formats import quantity_value
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.outcomes import BUSY, FAILED, OFFLINE, ROLLED_BACK

Row = dict[str, Any]
Rows = Sequence[Mapping[str, Any]]
Status = Mapping[str, Rows]  # by section

OK, WARN, BAD = "ok", "warn", "bad"
NEARLY_FULL = 0.9
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
        return BAD
    share = used_share(row)
    return WARN if share is not None and share >= NEARLY_FULL else OK


def used_share(row: Mapping[str, Any]) -> float | None:
    """How much of its size a claim holds; None where either is not known."""
    size = quantity_value(str(row.get("size") or ""))
    used = row.get("used_bytes")
    return float(used) / float(size) if size and used is not None else None


def _outcome(row: Mapping[str, Any]) -> str:
    return _OUTCOMES.get(str(row.get("outcome")), OK)


# How good a row of each section is. What is not listed has nothing to judge.
_JUDGES: Mapping[str, Callable[[Mapping[str, Any]], str]] = {
    "problems": lambda _row: BAD,
    "hosts": _host,
    "nodes": _node,
    "masters": _workload,
    "apps": _workload,
    "went_back": lambda _row: WARN,
    "ended": lambda _row: WARN,
    "ros_nodes": lambda row: OK if row.get("reachable") else BAD,
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
    return WARN if found == BAD and because_off(section, row, off) else found


def hosts_off(status: Status) -> frozenset[str]:
    """Robots that are off. An edge host that is off is a fault, and so is all that it takes with it."""
    return frozenset(str(row.get("name")) for row in status.get("hosts") or [] if level("hosts", row) == WARN)


def because_off(section: str, row: Mapping[str, Any], off: Collection[str]) -> bool:
    if section == "nodes":
        return row.get("name") in off
    if section in ("masters", "apps"):
        return bool(row.get("nodes")) and all(node in off for node in row["nodes"])
    if section in ("outcomes", "steps"):
        return row.get("outcome") == OFFLINE and row.get("host", row.get("robot")) in off
    return section in ("ros_nodes", "claims") and row.get("robot") in off


# What is counted: its words, and where it comes from.
_COUNTED = (
    ("Hosts up", "hosts"),
    ("Nodes ready", "nodes"),
    ("ROS masters ready", "masters"),
    ("Apps ready", "apps"),
    ("ROS nodes up", "ros_nodes"),
    ("Claims in order", "claims"),
    ("Last outcomes good", "outcomes"),
)


def counts(status: Status) -> list[Row]:
    """`{label, section, good, total, level}` of everything of which there is something."""
    found, off = [], hosts_off(status)
    for label, section in _COUNTED:
        levels = [level(section, row, off) for row in status.get(section) or []]
        if levels:
            worst = next((one for one in (BAD, WARN) if one in levels), OK)
            found.append(
                {
                    "label": label,
                    "section": section,
                    "good": levels.count(OK),
                    "total": len(levels),
                    "level": worst,
                }
            )
    return found


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
    found = [level(section, row) for section in ("masters", "apps", "ros_nodes", "claims")
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


def attention(status: Status) -> list[Row]:
    """`{level, where, what}` of all that is not as it should be, the worst first."""
    found, off = [], hosts_off(status)
    for section, told in _TOLD.items():
        for row in status.get(section) or []:
            found_level = level(section, row)
            if found_level in (WARN, BAD) and not because_off(section, row, off):  # the host is told already
                where, what = told(row)
                found.append({"level": found_level, "section": section, "where": where, "what": what})
    return sorted(found, key=lambda row: row["level"] != BAD)


def _with(words: str, more: Any) -> str:
    return f"{words}: {more}" if more else words


def _ready_of(row: Mapping[str, Any]) -> str:
    return _with(f"{row.get('ready', 0)} of {row.get('wanted', 1)} ready", row.get("note"))


def _claim_words(row: Mapping[str, Any]) -> str:
    return f"{used_share(row) or 0:.0%} used" if row.get("bound") else str(row.get("phase") or "not bound")


_TOLD: Mapping[str, Callable[[Mapping[str, Any]], tuple[str, str]]] = {
    "problems": lambda row: (str(row.get("where", "")), str(row.get("what", ""))),
    "hosts": lambda row: (f"host {row.get('name')}", _with("offline", row.get("reason"))),
    "nodes": lambda row: (f"node {row.get('name')}", _with("Ready" if row.get("ready") else "NotReady", row["reason"])),
    "masters": lambda row: (f"ROS master of {row.get('robot')}", _ready_of(row)),
    "apps": lambda row: (f"app {row.get('name')} of {row.get('robot')}", _ready_of(row)),
    "went_back": lambda row: (
        f"app {row.get('name')} of {row.get('robot')}",
        _with(f"taken back by the keeper at {row['at']}, from {row['from']} to {row['to']}", row["reason"]),
    ),
    "ended": lambda row: (
        f"app {row['app']} of {row['robot']}" if row["app"] else f"launch file at {row['host']} of {row['robot']}",
        f"{row['node']} has ended; its exit code is in the pod's log alone",
    ),
    "ros_nodes": lambda row: (f"ROS node {row.get('name')} of {row.get('robot')}", _with("down", row.get("error"))),
    "claims": lambda row: (f"claim {row.get('name')} of {row.get('robot')}", _claim_words(row)),
    "outcomes": lambda row: (
        f"last {row.get('playbook')} on {row.get('host')}",
        _with(str(row["outcome"]), row.get("note")),
    ),
}
