# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What needs attention: each finding once, with all that it takes along, since when, and what to do next. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import singledispatch

from .._model import names
from .._model.outcomes import BUSY, OFFLINE
from . import rows
from .glance import BAD, WARN, hosts_away, is_unknown, level, used_share
from .rows import Row, Status, logs_of, some

RUNBOOKS = "https://github.com/rosops/fleet/blob/main/docs/runbooks"  # as in the alerts' rules
OURS = frozenset({"site.yml", "update.yml", "rollback.yml"})  # playbooks that a user may run again by their name
# Causes come before what they may be the cause of.
SECTIONS = (
    "hosts", "nodes", "masters", "problems", "helpers", "apps", "went_back", "ended", "ros_nodes", "topics", "claims",
    "outcomes", "links",
)  # fmt: skip

Key = tuple[str, str]  # a kind of cause, and its name


@dataclass(frozen=True)
class Told:
    """What is said of a row. `todo` is a command, or a sentence where there is none; `runbook` the name of a page."""

    where: str
    what: str
    since: str = ""
    todo: str = ""
    runbook: str = ""


@dataclass
class Finding:
    """`followers` are the rows, with their sections, of which this finding is the cause; `takes` says it in words."""

    level: str
    section: str
    told: Told
    followers: list[tuple[str, Row]] = field(default_factory=list)

    @property
    def link(self) -> str:
        return f"{RUNBOOKS}/{self.told.runbook}.md" if self.told.runbook else ""

    @property
    def takes(self) -> list[str]:
        by_section: dict[str, list[str]] = {}
        for section, row in self.followers:
            by_section.setdefault(section, []).append(_short(section, row))
        return [_counted(section, named) for section, named in by_section.items()]


def attention(status: Status) -> list[Finding]:
    """All that is not as it should be, the worst first; what has another finding as its cause stands with that one."""
    causes: dict[Key, Finding] = {}
    found: list[Finding] = []
    away = hosts_away(status)
    for section, row in ((key, row) for key in SECTIONS for row in status.rows(key)):
        if level(row) not in (WARN, BAD) and not is_unknown(row, away):
            continue
        cause = next((causes[key] for key in _causes(row, status) if key in causes), None)
        if cause is not None:
            cause.followers.append((section, row))
            # what depends on this row has the same cause, and must find it
            causes.update(dict.fromkeys(_keys(section, row), cause))
            continue
        finding = Finding(level(row), section, _told(row, section))
        causes.update({key: finding for key in _keys(section, row) if key not in causes})
        found.append(finding)
    return sorted(map(_dated, found), key=lambda one: one.level != BAD)


def _keys(section: str, row: Row) -> list[Key]:
    """As what a row may be the cause of others."""
    match row:
        case rows.Host():
            return [("host", row.name), *([("cluster", row.cluster)] if row.role == "server" else [])]
        case rows.Node():
            return [("host", row.name)]
        case rows.Workload():
            return [("graph", row.robot) if section == "masters" else ("app", f"{row.robot}/{row.name}")]
    return []


def _causes(row: Row, status: Status) -> Iterator[Key]:
    """What may be the cause of a row, the first one first."""
    match row:
        case rows.Node():
            yield "host", row.name
        case rows.Workload(nodes=(node,)):
            yield "host", node
        case rows.RosNode():
            yield "app", f"{row.robot}/{row.app}"
            yield "graph", row.robot
            yield "host", row.at or row.robot
        case rows.Topic():
            if row.promised:
                yield "app", f"{row.promised.robot}/{row.promised.app}"
            yield "graph", row.robot
        case rows.Claim():
            yield "host", row.robot
        case rows.LastRun(outcome=outcome) if outcome == OFFLINE:
            yield "host", row.host
        case rows.Trouble():
            if row.cluster and _servers_away(row.cluster, status):
                yield "cluster", row.cluster
            if row.graph:
                yield "graph", row.graph


def _servers_away(cluster: str, status: Status) -> bool:
    return not any(row.reachable for row in status.hosts if (row.cluster, row.role) == (cluster, "server"))


def _dated(finding: Finding) -> Finding:
    """A host that is off says nothing itself: its node's last word counts, or the run that missed it."""
    if finding.section != "hosts" or finding.told.since:
        return finding
    followers = [row for _section, row in finding.followers]
    times = [row.since for row in followers if isinstance(row, rows.Node)]
    times += [row.started for row in followers if isinstance(row, rows.LastRun)]
    return replace(finding, told=replace(finding.told, since=next(filter(None, times), "")))


# ---- in words

_PLURAL = {
    "nodes": "node", "masters": "ROS master", "helpers": "helper", "apps": "app", "ros_nodes": "ROS node",
    "topics": "topic", "claims": "claim", "outcomes": "last run", "problems": "",
}  # fmt: skip


def _short(section: str, row: Row) -> str:
    match row:
        case rows.LastRun():
            return f"{row.playbook} {row.outcome}"
        case rows.Trouble():
            return row.where
        case rows.Workload() if section == "masters":
            return f"of {row.robot}"
        case rows.Node() | rows.OfRobot():
            return row.name
    return ""


def _counted(section: str, named: list[str]) -> str:
    noun = _PLURAL[section]
    if len(named) == 1 or not noun:
        return f"{noun} {some(named)}".strip()
    return f"{len(named)} {noun}s: {some(named)}"


def _with(words: str, more: str) -> str:
    return f"{words}: {more}" if more else words


@singledispatch
def _told(row: Row, section: str) -> Told:
    raise TypeError(f"{row} of {section}: nothing is told of it")


@_told.register
def _trouble(row: rows.Trouble, _section: str) -> Told:
    return Told(row.where, row.what, row.since, row.todo)


@_told.register
def _host(row: rows.Host, _section: str) -> Told:
    runbook = "RobotOffline" if row.group == "robots" else ""
    todo = f"ansible {row.name} -m ansible.builtin.ping"
    return Told(f"host {row.name}", _with("offline", row.reason), "", todo, runbook)


@_told.register
def _node(row: rows.Node, _section: str) -> Told:
    todo = f"ansible {row.name} -b -a 'systemctl status k3s k3s-agent'"
    if row.ready:
        todo = f"k3s kubectl uncordon {row.name}"
    what = _with("Ready" if row.ready else "NotReady", row.reason)
    return Told(f"node {row.name}", what, row.since, todo, "" if row.ready else "RobotOffline")


@_told.register
def _workload(row: rows.Workload, section: str) -> Told:
    where = {"masters": "ROS master", "apps": f"app {row.name}"}.get(section, row.name)
    note, todo = row.note, f"k3s kubectl -n {row.namespace} describe pod -l rosops.fleet/app={row.name}"
    if "CrashLoopBackOff" in note or row.ended:
        todo = f"k3s kubectl -n {row.namespace} logs deploy/{row.name} --previous"
    if row.ended and "CrashLoopBackOff" not in note:
        note = "; ".join(filter(None, (note, row.ended)))
    what = _with(f"{row.ready} of {row.wanted} ready", note)
    return Told(f"{where} of {row.robot}", what, row.since, todo, "RosMasterDown" if section == "masters" else "")


@_told.register
def _went_back(row: rows.WentBack, _section: str) -> Told:
    what = _with(f"taken back by the keeper, from {row.before} to {row.after}", row.reason)
    todo = logs_of(row.robot, names.KEEPER_NAME)
    return Told(f"app {row.name} of {row.robot}", what, row.at, todo, "RobotUpdateFailed")


@_told.register
def _ended(row: rows.Ended, _section: str) -> Told:
    where = f"app {row.app}" if row.app else f"launch file at {row.host}"
    what = f"{row.node} has ended; its exit code is in the pod's log alone"
    return Told(f"{where} of {row.robot}", what, "", logs_of(row.robot, row.app) if row.app else "")


@_told.register
def _ros_node(row: rows.RosNode, _section: str) -> Told:
    todo = logs_of(row.robot, row.app, " --since 10m") if row.app else ""
    return Told(f"ROS node {row.name} of {row.robot}", _with("down", row.error), "", todo, "RosNodeDown")


@_told.register
def _link(row: rows.Link, _section: str) -> Told:
    """Who is registered as a subscriber, is alive, and does not get what a publisher sends."""
    pairs = [f"{publisher} is not connected to {subscriber}" for publisher, subscriber in row.broken]
    todo = f"ansible-playbook rosops.fleet.status --limit {row.robot}"
    return Told(f"topic {row.name} of {row.robot}", some(pairs), "", todo, "RosTopicSilent")


@_told.register
def _claim(row: rows.Claim, _section: str) -> Told:
    where, kubectl = f"claim {row.name} of {row.robot}", f"k3s kubectl -n {row.namespace}"
    if row.bound:
        share = used_share(row)
        # a host that is off takes its claims along; one without a number is not told by itself
        what = "not measured" if share is None else f"{share:.0%} used"
        return Told(where, what, "", f"{kubectl} get pvc {row.name}", "PvcNearlyFull")
    return Told(where, row.note or row.phase or "not bound", row.since, f"{kubectl} describe pvc {row.name}")


@_told.register
def _topic(row: rows.Topic, _section: str) -> Told:
    where, found = (
        f"topic {row.name} of {row.robot}",
        "nobody publishes it" if row.rate is None else f"{row.rate:.1f} Hz",
    )
    if row.promised is None:
        return Told(where, found)
    told = f"{found}; {row.promised.app} promises at least {row.promised.min_rate:g} Hz"
    todo = logs_of(row.promised.robot, row.promised.app, " --since 10m")
    return Told(where, told, "", todo, "RosTopicSilent" if row.rate is None else "RosTopicRateDrop")


@_told.register
def _outcome(row: rows.LastRun, _section: str) -> Told:
    named = f"rosops.fleet.{row.playbook.removesuffix('.yml')}" if row.playbook in OURS else row.playbook
    waits = row.outcome in (BUSY, OFFLINE)
    return Told(
        f"last {row.playbook} on {row.host}",
        _with(row.outcome, row.note),
        row.started,
        f"ansible-playbook {named} --limit {row.host}" + ("" if waits else " --check --diff"),
        "" if waits else "RobotUpdateFailed",
    )
