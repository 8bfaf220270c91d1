# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What needs attention: each finding once, with all that it takes along, since when, and what to do next. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.outcomes import BUSY, OFFLINE
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.glance import (
    BAD,
    WARN,
    WORKLOADS,
    Status,
    hosts_away,
    is_unknown,
    level,
    some,
    used_share,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.launched import logs_of

RUNBOOKS = "https://github.com/rosops/fleet/blob/main/docs/runbooks"  # as in the alerts' rules
OURS = frozenset({"site.yml", "update.yml", "rollback.yml"})  # playbooks that a user may run again by their name

Row = Mapping[str, Any]
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
    for section, tell in _TOLD.items():
        for row in status.get(section) or []:
            found_level = level(section, row)
            if found_level not in (WARN, BAD) and not is_unknown(section, row, away):
                continue
            cause = next((causes[key] for key in _causes(section, row, status) if key in causes), None)
            if cause is not None:
                cause.followers.append((section, row))
                # what depends on this row has the same cause, and must find it
                causes.update(dict.fromkeys(_keys(section, row), cause))
                continue
            finding = Finding(found_level, section, tell(row))
            causes.update({key: finding for key in _keys(section, row) if key not in causes})
            found.append(finding)
    return sorted(map(_dated, found), key=lambda one: one.level != BAD)


def _keys(section: str, row: Row) -> list[Key]:
    """As what a row may be the cause of others."""
    name, robot = str(row.get("name")), str(row.get("robot"))
    if section == "hosts":
        return [("host", name), *([("cluster", str(row.get("cluster")))] if row.get("role") == "server" else [])]
    return {
        "nodes": [("host", name)],
        "masters": [("graph", robot)],
        "helpers": [("app", f"{robot}/{name}")],
        "apps": [("app", f"{robot}/{name}")],
    }.get(section, [])


def _causes(section: str, row: Row, status: Status) -> Iterator[Key]:
    """What may be the cause of a row, the first one first."""
    robot = str(row.get("robot"))
    if section == "nodes":
        yield "host", str(row.get("name"))
    elif section in WORKLOADS:
        if row.get("nodes"):
            yield from (("host", str(node)) for node in row["nodes"][:1] if len(row["nodes"]) == 1)
    elif section == "ros_nodes":
        yield "app", f"{robot}/{row.get('app')}"
        yield "graph", robot
        yield "host", str(row.get("at") or robot)
    elif section == "topics":
        yield "app", "{robot}/{app}".format(**row["promised"])
        yield "graph", robot
    elif section == "claims":
        yield "host", robot
    elif section == "outcomes" and row.get("outcome") == OFFLINE:
        yield "host", str(row.get("host"))
    elif section == "problems":
        if row.get("cluster") and _servers_away(str(row["cluster"]), status):
            yield "cluster", str(row["cluster"])
        if row.get("graph"):
            yield "graph", str(row["graph"])


def _servers_away(cluster: str, status: Status) -> bool:
    servers = [row for row in status.get("hosts") or [] if (row.get("cluster"), row.get("role")) == (cluster, "server")]
    return all(not row.get("reachable", True) for row in servers)


def _dated(finding: Finding) -> Finding:
    """A host that is off says nothing itself: its node's last word counts, or the run that missed it."""
    if finding.section != "hosts" or finding.told.since:
        return finding
    nodes = [str(row.get("since") or "") for section, row in finding.followers if section == "nodes"]
    missed = [str(row.get("started") or "") for section, row in finding.followers if section == "outcomes"]
    since = next((one for one in [*nodes, *missed] if one), "")
    return replace(finding, told=replace(finding.told, since=since))


# ---- in words

_PLURAL = {
    "nodes": "node", "masters": "ROS master", "helpers": "helper", "apps": "app", "ros_nodes": "ROS node",
    "topics": "topic", "claims": "claim", "outcomes": "last run", "problems": "",
}  # fmt: skip


def _short(section: str, row: Row) -> str:
    if section == "outcomes":
        return f"{row.get('playbook')} {row.get('outcome')}"
    if section == "problems":
        return str(row.get("where"))
    if section == "masters":
        return f"of {row.get('robot')}"
    return str(row.get("name"))


def _counted(section: str, named: Sequence[str]) -> str:
    noun = _PLURAL[section]
    if len(named) == 1 or not noun:
        return f"{noun} {some(named)}".strip()
    return f"{len(named)} {noun}s: {some(named)}"


def _with(words: str, more: Any) -> str:
    return f"{words}: {more}" if more else words


def _since(row: Row) -> str:
    return str(row.get("since") or "")


def _host(row: Row) -> Told:
    name = str(row.get("name"))
    runbook = "RobotOffline" if row.get("group") == "robots" else ""
    todo = f"ansible {name} -m ansible.builtin.ping"
    return Told(f"host {name}", _with("offline", row.get("reason")), "", todo, runbook)


def _node(row: Row) -> Told:
    name, ready = str(row.get("name")), row.get("ready")
    todo = f"k3s kubectl uncordon {name}" if ready else f"ansible {name} -b -a 'systemctl status k3s k3s-agent'"
    what = _with("Ready" if ready else "NotReady", row.get("reason"))
    return Told(f"node {name}", what, _since(row), todo, "" if ready else "RobotOffline")


def _workload(where: str, row: Row, runbook: str) -> Told:
    namespace, name, note = row.get("namespace"), row.get("name"), str(row.get("note") or "")
    todo = f"k3s kubectl -n {namespace} describe pod -l rosops.fleet/app={name}"
    logs = f"k3s kubectl -n {namespace} logs deploy/{name} --previous"
    if "CrashLoopBackOff" in note:
        todo = logs
    elif row.get("ended"):
        note, todo = "; ".join(filter(None, (note, str(row["ended"])))), logs
    what = _with(f"{row.get('ready', 0)} of {row.get('wanted', 1)} ready", note)
    return Told(where, what, _since(row), todo, runbook)


def _claim(row: Row) -> Told:
    where = f"claim {row.get('name')} of {row.get('robot')}"
    kubectl = f"k3s kubectl -n {row.get('namespace')}"
    if row.get("bound"):
        share = used_share(row)
        # a host that is off takes its claims along; one without a number is not told by itself
        what = "not measured" if share is None else f"{share:.0%} used"
        return Told(where, what, "", f"{kubectl} get pvc {row.get('name')}", "PvcNearlyFull")
    todo = f"{kubectl} describe pvc {row.get('name')}"
    return Told(where, str(row.get("note") or row.get("phase") or "not bound"), _since(row), todo)


def _topic(row: Row) -> Told:
    promised, rate = row["promised"], row.get("rate")
    found = "nobody publishes it" if rate is None else f"{rate:.1f} Hz"
    told = f"{found}; {promised['app']} promises at least {promised['min_rate']:g} Hz"
    todo = logs_of(promised["robot"], promised["app"], " --since 10m")
    runbook = "RosTopicSilent" if rate is None else "RosTopicRateDrop"
    return Told(f"topic {row['name']} of {row['robot']}", told, "", todo, runbook)


def _link(row: Row) -> Told:
    """Who is registered as a subscriber, is alive, and does not get what a publisher sends."""
    pairs = [f"{publisher} is not connected to {subscriber}" for publisher, subscriber in row["broken"]]
    todo = f"ansible-playbook rosops.fleet.status --limit {row['robot']}"
    return Told(f"topic {row['name']} of {row['robot']}", some(pairs), "", todo, "RosTopicSilent")


def _outcome(row: Row) -> Told:
    playbook, host, outcome = str(row.get("playbook")), row.get("host"), row.get("outcome")
    named = f"rosops.fleet.{playbook.removesuffix('.yml')}" if playbook in OURS else playbook
    runbook = "" if outcome in (BUSY, OFFLINE) else "RobotUpdateFailed"
    return Told(
        f"last {playbook} on {host}",
        _with(str(outcome), row.get("note")),
        str(row.get("started") or ""),
        f"ansible-playbook {named} --limit {host}" + ("" if outcome in (BUSY, OFFLINE) else " --check --diff"),
        runbook,
    )


def _ended(row: Row) -> Told:
    where = f"app {row['app']} of {row['robot']}" if row["app"] else f"launch file at {row['host']} of {row['robot']}"
    what = f"{row['node']} has ended; its exit code is in the pod's log alone"
    return Told(where, what, "", logs_of(row["robot"], row["app"]) if row["app"] else "")


# Causes come before what they may be the cause of.
_TOLD: Mapping[str, Callable[[Row], Told]] = {
    "hosts": _host,
    "nodes": _node,
    "masters": lambda row: _workload(f"ROS master of {row.get('robot')}", row, "RosMasterDown"),
    "problems": lambda row: Told(
        str(row.get("where", "")), str(row.get("what", "")), _since(row), str(row.get("todo") or "")
    ),
    "helpers": lambda row: _workload(f"{row.get('name')} of {row.get('robot')}", row, ""),
    "apps": lambda row: _workload(f"app {row.get('name')} of {row.get('robot')}", row, ""),
    "went_back": lambda row: Told(
        f"app {row.get('name')} of {row.get('robot')}",
        _with(f"taken back by the keeper, from {row['from']} to {row['to']}", row["reason"]),
        str(row["at"]),
        logs_of(str(row.get("robot")), "ros-keeper"),
        "RobotUpdateFailed",
    ),
    "ended": _ended,
    "ros_nodes": lambda row: Told(
        f"ROS node {row.get('name')} of {row.get('robot')}",
        _with("down", row.get("error")),
        "",
        logs_of(str(row.get("robot")), str(row["app"]), " --since 10m") if row.get("app") else "",
        "RosNodeDown",
    ),
    "topics": _topic,
    "claims": _claim,
    "outcomes": _outcome,
    "links": _link,
}
