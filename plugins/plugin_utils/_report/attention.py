# SPDX-License-Identifier: GPL-3.0-or-later
"""What needs attention: each finding once, with all that it takes along, since when, and what to do next. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from . import rows
from .glance import hosts_away, is_unknown, level
from .rows import BAD, WARN, Row, Status, Told, some

RUNBOOKS = "https://github.com/rosops/fleet/blob/main/docs/runbooks"  # as in the alerts' rules
# Causes come before what they may be the cause of.
SECTIONS = (
    "hosts", "nodes", "masters", "problems", "helpers", "apps", "went_back", "ended", "ros_nodes", "topics", "claims",
    "outcomes", "links",
)  # fmt: skip

Key = tuple[str, str]  # a kind of cause, and its name


@dataclass
class Finding:
    """`followers` are the rows, with their sections, of which this finding is the cause; `takes` says it in words."""

    level: str
    row: Row
    followers: list[tuple[str, Row]] = field(default_factory=list)

    @property
    def told(self) -> Told:
        """A host that is off says nothing itself: its node's last word counts, or the run that missed it."""
        if not isinstance(self.row, rows.Host):
            return self.row.told()
        followers = [row for _section, row in self.followers]
        times = [row.since for row in followers if isinstance(row, rows.Node)]
        times += [row.started for row in followers if isinstance(row, rows.LastRun)]
        return replace(self.row.told(), since=next(filter(None, times), ""))

    @property
    def link(self) -> str:
        return f"{RUNBOOKS}/{self.told.runbook}.md" if self.told.runbook else ""

    @property
    def takes(self) -> list[str]:
        by_section: dict[str, list[str]] = {}
        for section, row in self.followers:
            by_section.setdefault(section, []).append(row.told().where)
        return [some(named) for named in by_section.values()]


def attention(status: Status) -> list[Finding]:
    """All that is not as it should be, the worst first; what has another finding as its cause stands with that one."""
    causes: dict[Key, Finding] = {}
    found: list[Finding] = []
    away = hosts_away(status)
    for section, row in ((key, row) for key in SECTIONS for row in status.rows(key)):
        if level(row) not in (WARN, BAD) and not is_unknown(row, away):
            continue
        cause = next((causes[key] for key in _causes(row, status) if key in causes), None)
        if cause:
            cause.followers.append((section, row))
        else:
            found.append(Finding(level(row), row))
        for key in _keys(row):  # what depends on this row has the same cause, and must find it
            causes.setdefault(key, cause or found[-1])
    return sorted(found, key=lambda one: one.level != BAD)


def _keys(row: Row) -> list[Key]:
    """As what a row may be the cause of others."""
    match row:
        case rows.Host():
            return [("host", row.name), *([("cluster", row.cluster)] if row.role == "server" else [])]
        case rows.Node():
            return [("host", row.name)]
        case rows.Workload():
            return [("graph", row.robot) if row.is_master else ("app", f"{row.robot}/{row.name}")]
    return []


def _causes(row: Row, status: Status) -> Iterator[Key]:
    """What may be the cause of a row, the first one first."""
    match row:
        case rows.RosNode():
            yield "app", f"{row.robot}/{row.app}"
            yield "graph", row.robot
        case rows.Topic():
            if row.promised:
                yield "app", f"{row.promised.robot}/{row.promised.app}"
            yield "graph", row.robot
        case rows.Trouble():
            servers = [host for host in status.hosts if (host.cluster, host.role) == (row.cluster, "server")]
            if row.cluster and not any(host.reachable for host in servers):
                yield "cluster", row.cluster
            if row.graph:
                yield "graph", row.graph
    if len(hosts := row.told().hosts) == 1:
        yield "host", hosts[0]
