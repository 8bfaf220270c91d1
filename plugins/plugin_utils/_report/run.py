# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What became of every host in a run, and where the time went.

Pure: the callback tells what happens and when, `finish` makes plain data of it, `screen` makes lines of that.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypedDict

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.outcomes import (
    BUSY,
    FAILED,
    OFFLINE,
    OUTCOMES,
    ROLLED_BACK,
    UNCHANGED,
    UPDATED,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.text import table

# In check mode nothing was changed, so the screen says it in the conditional; the file keeps the words of outcomes.
WOULD = {UPDATED: "would change", UNCHANGED: "would not change"}

FACTS = ("fleet_outcome", "fleet_k3s_outcome")  # the latter is site's own, of its stage k3s
SLOWEST = 10
CHANGED_KEPT = 100
HIDDEN = "hidden by no_log"
CORE_PREFIX = "Task failed: "  # ansible-core 2.19 puts it before every message of a plugin
MESSAGE_KEPT = 4000  # a result is not a log


class HostReport(TypedDict):
    """A host in the report; the callback's documentation has its keys."""

    host: str
    groups: list[str]
    outcome: str
    reason: str
    failed_task: str | None
    changed: list[str]
    ready: dict[str, Any] | None
    rollout: dict[str, Any] | None
    steps: list[Mapping[str, Any]]
    counts: dict[str, int]


class ReportFile(TypedDict):
    """The report as it is written. Times are in seconds, but for `started`, which is in UTC."""

    playbook: str
    check_mode: bool
    started: str
    elapsed: float
    outcomes: dict[str, int]
    hosts: list[HostReport]
    plays: list[dict[str, Any]]
    stages: list[dict[str, Any]]
    slowest_tasks: list[dict[str, Any]]
    tasks: int
    apis: dict[str, Any]


@dataclass(frozen=True)
class TaskInfo:
    """What is known of a task before it runs. `for_all`: its failure ends the play for every host."""

    name: str
    action: str
    stage: str = ""
    for_all: bool = False


@dataclass
class _Task:
    name: str
    action: str
    play: str
    stage: str
    for_all: bool
    seconds: float = 0.0
    hosts: set[str] = field(default_factory=set)
    changed: set[str] = field(default_factory=set)
    begun: float | None = None
    ended: float = 0.0

    def close(self) -> None:
        """Add what has passed since it began; a task begins once per batch of hosts."""
        if self.begun is not None:
            self.seconds += max(self.ended - self.begun, 0.0)
        self.begun = None


@dataclass
class _Host:
    groups: list[str] = field(default_factory=list)
    changed: list[str] = field(default_factory=list)
    failure: dict[str, str] = field(default_factory=dict)
    unreachable: str = ""
    ready: dict[str, Any] = field(default_factory=dict)
    rollout: dict[str, Any] = field(default_factory=dict)
    declared: dict[str, Any] = field(default_factory=dict)
    blocked: list[tuple[str, str]] = field(default_factory=list)  # host that ended the run for this one, and how


@dataclass
class _Play:
    name: str
    begun: float
    hosts: list[str]
    ended: float = 0.0


def short_action(action: str) -> str:
    return action.rpartition(".")[2]


def message_of(result: Mapping[str, Any]) -> str:
    """What a failed result says: its message, or those of its failed items, or what the command wrote."""
    if "censored" in result:
        return HIDDEN
    items = [item for item in result.get("results") or [] if isinstance(item, Mapping)]
    failed = [item for item in items if item.get("failed") or item.get("unreachable")]
    if failed:
        said = dict.fromkeys(message_of(item) for item in failed)
        return "; ".join(said)[:MESSAGE_KEPT]
    text = str(result.get("msg") or "").strip()
    if text.startswith(CORE_PREFIX):
        text = text[len(CORE_PREFIX) :]
    if text in ("", "non-zero return code", "MODULE FAILURE"):
        more = str(result.get("stderr") or result.get("module_stderr") or result.get("stdout") or "").strip()
        text = f"{text}: {more}".strip(": ")
    return (text or "failed without a message")[:MESSAGE_KEPT]


def _ready_of(result: Mapping[str, Any]) -> dict[str, Any]:
    """ros_ready's verdict, and the conditions that do not hold."""
    checks = [check for check in result.get("checks") or [] if isinstance(check, Mapping)]
    unmet = [f"{check.get('kind')} {check.get('name')}: {check.get('reason')}" for check in checks
             if check.get("verdict") != "pass"]  # fmt: skip
    return {
        "verdict": result.get("verdict"),
        "elapsed": result.get("elapsed"),
        "checks": len(checks),
        "unmet": unmet,
    }


def _rollout_of(result: Mapping[str, Any]) -> dict[str, Any]:
    rows = [row for row in result.get("objects") or [] if isinstance(row, Mapping)]
    unmet = [f"{row.get('kind')} {row.get('namespace')}/{row.get('name')}: {row.get('reason')}" for row in rows
             if row.get("verdict") != "pass"]  # fmt: skip
    return {"elapsed": result.get("elapsed"), "objects": len(rows), "unmet": unmet}


def _declared_of(action: str, result: Mapping[str, Any]) -> dict[str, Any]:
    """An outcome that an action of ours says, or that a play decided itself, with `set_fact: fleet_outcome`."""
    facts = result.get("ansible_facts")
    if action in ("_robot_update", "_update_soak", "_guarded"):
        return declared_in(result.get("outcome"))
    told = [declared_in(facts.get(name)) for name in FACTS] if isinstance(facts, Mapping) else []
    return next(filter(None, told), {})


def declared_in(value: Any) -> dict[str, Any]:
    """A word or `{outcome, reason, steps}`, as the latter; empty where it is none."""
    if isinstance(value, Mapping):
        word, reason = str(value.get("outcome", "")), str(value.get("reason") or "")
    else:
        word, reason = str(value or ""), ""
    steps = value.get("steps") if isinstance(value, Mapping) else None
    return {"outcome": word, "reason": reason, "steps": list(steps or [])} if word in OUTCOMES else {}


class RunReport:
    """Collects what happens in a run. Times are seconds of one clock, whichever."""

    def __init__(self, now: float = 0.0) -> None:
        self._begun = now
        self._plays: list[_Play] = []
        self._tasks: dict[str, _Task] = {}
        self._hosts: dict[str, _Host] = {}
        self._apis: dict[str, Any] = {}

    def host(self, name: str, groups: Iterable[str] = ()) -> _Host:
        host = self._hosts.setdefault(name, _Host())
        if groups:
            host.groups = sorted(set(groups) - {"all", "ungrouped"})
        return host

    def play(self, name: str, hosts: Iterable[str], now: float) -> None:
        self._close(now)
        self._plays.append(_Play(name, now, list(hosts)))
        for host in self._plays[-1].hosts:
            self.host(host)

    def task(self, key: str, info: TaskInfo, now: float) -> None:
        for task in self._tasks.values():
            task.close()
        play = self._plays[-1].name if self._plays else ""
        made = _Task(info.name, short_action(info.action), play, info.stage or play, info.for_all)
        task = self._tasks.setdefault(key, made)
        task.begun, task.ended = now, now

    def ok(self, key: str, host: str, result: Mapping[str, Any], now: float) -> None:
        task = self._note(key, host, now)
        if result.get("changed") and task:
            task.changed.add(host)
            changed = self.host(host).changed
            if task.name not in changed and len(changed) < CHANGED_KEPT:
                changed.append(task.name)
        self._learn(task, host, result)

    def failed(self, key: str, host: str, result: Mapping[str, Any], now: float, ignored: bool = False) -> None:
        task = self._note(key, host, now)
        self._learn(task, host, result)
        if ignored:
            return
        # what makes a host leave the run says nothing of what became of it
        name = task.name if task and task.action != "_leave" else ""
        self.host(host).failure = {"task": name, "message": message_of(result)}
        if task and task.for_all and self._plays:
            for other in self._plays[-1].hosts:
                if other != host:
                    self.host(other).blocked.append((host, f"not carried on: {name} failed on {host} for all hosts"))

    def skipped(self, key: str, host: str, now: float) -> None:
        self._note(key, host, now)

    def unreachable(self, key: str, host: str, result: Mapping[str, Any], now: float) -> None:
        self._note(key, host, now)
        self.host(host).unreachable = message_of(result)

    def cut_short(self) -> None:
        """All hosts of a play failed, and Ansible begins no further one: so much of the hosts that those were for."""
        there = {name: self._hosts[name] for name in (self._plays[-1].hosts if self._plays else ())}
        ended = [(name, host) for name, host in there.items() if host.failure or host.unreachable]
        for name, host in ended[:1]:
            how = f"{host.failure['task']} failed" if host.failure else "the connection was lost"
            why = host.failure.get("message") or host.unreachable
            for other in self._hosts.keys() - there.keys():
                self._hosts[other].blocked.append((name, f"not carried on: the run ended on {name}: {how}: {why}"))

    def _note(self, key: str, host: str, now: float) -> _Task | None:
        task = self._tasks.get(key)
        self.host(host)
        if task:
            task.hosts.add(host)
            task.ended = now
        return task

    def _learn(self, task: _Task | None, host: str, result: Mapping[str, Any]) -> None:
        action = task.action if task else ""
        declared = _declared_of(action, result)
        if declared:
            self.host(host).declared = declared
        self._apis.update(result.get("apis") or {})
        if action in ("ros_ready", "_robot_update") and "verdict" in result:
            self.host(host).ready = _ready_of(result)
        if action == "rollout_ready" and "objects" in result:
            self.host(host).rollout = _rollout_of(result)

    def _close(self, now: float) -> None:
        for task in self._tasks.values():
            task.close()
        if self._plays and not self._plays[-1].ended:
            self._plays[-1].ended = now

    def finish(
        self,
        stats: Mapping[str, Mapping[str, int]],
        now: float,
        playbook: str = "",
        check_mode: bool = False,
        started: str = "",
    ) -> ReportFile:
        """The report as data. `stats` is Ansible's own summary per host: it knows what was rescued."""
        self._close(now)
        names = [name for name in self._hosts if name != "localhost" or name in stats]
        hosts = [self._host_row(name, stats) for name in names]
        if len(hosts) > 1:  # what ran on the control node only helped the others
            hosts = [host for host in hosts if host["host"] != "localhost"]
        counts = {word: sum(host["outcome"] == word for host in hosts) for word in OUTCOMES}
        return {
            "playbook": playbook,
            "check_mode": check_mode,
            "started": started,
            "elapsed": round(now - self._begun, 3),
            "outcomes": {word: count for word, count in counts.items() if count},
            "hosts": hosts,
            "plays": [{"name": play.name, "seconds": round(play.ended - play.begun, 3)} for play in self._plays],
            "stages": self._stages(),
            "slowest_tasks": self._slowest(),
            "tasks": len(self._tasks),
            "apis": self._apis,
        }

    def so_far(self) -> dict[str, Any]:
        """Of each host: what there is to say of it, and its outcome if it is `here` still, or if it was `lost`."""
        failed = {name: {"failures": 1} for name, host in self._hosts.items() if host.failure}
        found = {}
        for name, host in self._hosts.items():
            changed = len(host.changed)
            lost = {"failures": bool(host.failure), "unreachable": bool(host.unreachable), "changed": changed}
            outcomes = {
                "here": self._outcome(host, {"changed": changed, "ok": 1}, {}),
                "lost": self._outcome(host, lost, failed),
            }
            task = host.failure.get("task") or None
            found[name] = {
                "host": {"changed": changed, "steps": host.declared.get("steps") or []},
                "here": dict(zip(("outcome", "reason"), outcomes["here"])),
                "lost": {**dict(zip(("outcome", "reason"), outcomes["lost"])), "failed_task": task},
            }
        return found

    def _host_row(self, name: str, stats: Mapping[str, Mapping[str, int]]) -> HostReport:
        host, counts = self._hosts[name], dict(stats.get(name) or {})
        outcome, reason = self._outcome(host, counts, stats)
        return {
            "host": name,
            "groups": host.groups,
            "outcome": outcome,
            "reason": reason,
            "failed_task": (host.failure.get("task") or None) if counts.get("failures") else None,
            "changed": host.changed,
            "ready": host.ready or None,
            "rollout": host.rollout or None,
            "steps": host.declared.get("steps") or [],
            "counts": counts,
        }

    @staticmethod
    def _outcome(host: _Host, counts: Mapping[str, int], stats: Mapping[str, Mapping[str, int]]) -> tuple[str, str]:
        declared, why = host.declared.get("outcome", ""), host.declared.get("reason", "")
        message = host.failure.get("message", "")
        # A host may fail on purpose, for the exit status: then the word that was declared says more.
        on_purpose = declared in (ROLLED_BACK, BUSY, OFFLINE, FAILED)
        ends = {name for name, one in stats.items() if one.get("failures") or one.get("unreachable")}
        left = [why for other, why in host.blocked if other in ends]
        if counts.get("failures"):
            outcome = (declared, why or message) if on_purpose else (FAILED, message)
        elif counts.get("unreachable") or host.unreachable:  # the second where a play reads on without the host
            outcome = (OFFLINE, host.unreachable)
        elif declared == UNCHANGED and counts.get("changed"):  # its apps are; other tasks of the run were not
            outcome = (UPDATED, why)
        elif declared:
            outcome = (declared, why)
        elif left:
            outcome = (FAILED, left[0])
        elif counts.get("changed"):
            outcome = (UPDATED, "")
        else:
            outcome = (UNCHANGED, "" if counts else "no task ran for it")
        return outcome

    def _stages(self) -> list[dict[str, Any]]:
        stages: dict[str, float] = {}
        for task in self._tasks.values():
            stages[task.stage] = stages.get(task.stage, 0.0) + task.seconds
        return [{"name": name, "seconds": round(seconds, 3)} for name, seconds in stages.items()]

    def _slowest(self) -> list[dict[str, Any]]:
        tasks = sorted(self._tasks.values(), key=lambda task: task.seconds, reverse=True)[:SLOWEST]
        return [
            {
                "name": task.name,
                "action": task.action,
                "play": task.play,
                "stage": task.stage,
                "seconds": round(task.seconds, 3),
                "hosts": len(task.hosts),
                "changed": len(task.changed),
            }
            for task in tasks
        ]


# --- screen ---------------------------------------------------------------------------------------------------------


def word_of(outcome: str, check_mode: bool) -> str:
    return WOULD.get(outcome, outcome) if check_mode else outcome


def _ready_cell(host: Mapping[str, Any]) -> str:
    ready = host.get("ready") or {}
    if not ready:
        return ""
    elapsed = ready.get("elapsed")
    return f"{ready.get('verdict')}" + (f" {elapsed:.1f} s" if isinstance(elapsed, (int, float)) else "")


def note_of(host: Mapping[str, Any]) -> str:
    """What there is to say of a host's outcome, in one line: the cause, and then where it showed."""
    lines = str(host.get("reason") or "").strip().splitlines()
    first = " ".join(line.strip() for line in lines[:2])
    return f"{first} (task: {host['failed_task']})".strip() if host.get("failed_task") else first


def screen(report: ReportFile, width: int = 120) -> list[str]:
    """The report in lines: a host each, then where the time went."""
    rows: list[Sequence[Any]] = [
        [
            host["host"],
            word_of(host["outcome"], report["check_mode"]),
            _ready_cell(host),
            host["counts"].get("changed", 0),
            note_of(host),
        ]
        for host in report["hosts"]
    ]
    lines = (
        table(["host", "outcome", "ros graph", "changed", "note"], rows, width, wrapped=True)
        if rows
        else ["no host took part"]
    )
    slow = sorted(report["stages"], key=lambda stage: float(stage["seconds"]), reverse=True)[:6]
    spent = ", ".join(f"{stage['name']} {stage['seconds']:.1f} s" for stage in slow if stage["seconds"] >= 0.1)
    lines.append(f"{report['elapsed']:.1f} s" + (f": {spent}" if spent else ""))
    return lines
