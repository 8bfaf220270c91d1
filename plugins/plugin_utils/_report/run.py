# SPDX-License-Identifier: GPL-3.0-or-later
"""What became of every host in a run, and where the time went: as a file (the callback's documentation has its keys),
and as lines of the screen.

Pure: the callback tells what happens and when, `finish` makes a report of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from operator import itemgetter

from ...module_utils._common.documents import Data
from .._model import outcomes
from .._update.outcome import RobotOutcome
from . import results
from .host_run import HostRun, Noted, note_of
from .results import Result
from .text import table

SLOWEST = 10
CHANGED_KEPT = 100
STAGES_SHOWN = 6
NONE = RobotOutcome("")
HEADERS = ("host", "outcome", "ros graph", "changed", "note")
# In check mode nothing was changed, so the screen says it in the conditional; the file keeps the words of outcomes.
WOULD = {outcomes.UPDATED: "would change", outcomes.UNCHANGED: "would not change"}

Counts = Mapping[str, int]  # Ansible's own of a host: ok, changed, failures, unreachable
Api = Mapping[str, str]  # of a cluster: its `host`, and the `source` of the access


def screen(report: Data) -> list[str]:
    """The report in lines: a host each, with the whole of its cause, then where the time went."""
    would = WOULD if report["check_mode"] else {}
    rows = [
        (
            host["host"],
            would.get(host["outcome"], host["outcome"]),
            _graph_words(host["ready"]),
            host["counts"].get("changed", 0),
            note_of(host["reason"], host["failed_task"] or ""),
        )
        for host in report["hosts"]
    ]
    lines = table(HEADERS, rows) if rows else ["no host took part"]
    slow = sorted(report["stages"], key=itemgetter("seconds"), reverse=True)[:STAGES_SHOWN]
    spent = ", ".join(f"{one['name']} {one['seconds']:.1f} s" for one in slow if one["seconds"] >= 0.1)
    return [*lines, f"{report['elapsed']:.1f} s" + (f": {spent}" if spent else "")]


def _graph_words(ready: Data | None) -> str:
    """The last verdict on the ROS graph."""
    if ready is None:
        return ""
    return f"{ready['verdict']}" + ("" if ready["elapsed"] is None else f" {ready['elapsed']:.1f} s")


# ---- what happens


@dataclass
class Task:
    """The callback knows its name, its action, its stage (a role), and whether its failure ends the play `for_all`."""

    name: str
    action: str
    stage: str = ""
    for_all: bool = False
    play: str = ""
    seconds: float = 0.0
    hosts: set[str] = field(default_factory=set)
    changed: set[str] = field(default_factory=set)
    at: float = 0.0  # up to when its time is counted: it begins once per batch of hosts

    def row(self) -> Data:
        """As the report has it: `hosts` and `changed` are how many."""
        where = {"name": self.name, "action": self.action, "play": self.play, "stage": self.stage}
        return {**where, "seconds": round(self.seconds, 3), "hosts": len(self.hosts), "changed": len(self.changed)}


@dataclass
class _Host:
    groups: tuple[str, ...] = ()
    changed: list[str] = field(default_factory=list)
    failure: str | None = None  # what was said of it
    failed_task: str = ""
    unreachable: str = ""
    ready: Data | None = None
    declared: RobotOutcome | None = None
    blocked: list[tuple[str, str]] = field(default_factory=list)  # host that ended the run for this one, and how

    def outcome(self, counts: Counts, ended: Iterable[str]) -> RobotOutcome:
        """What became of it. `counts` know what was rescued, `ended` are the hosts that failed or were lost."""
        declared = self.declared or NONE
        message = self.failure or ""
        # A host may fail on purpose, for the exit status: then the word that was declared says more.
        on_purpose = declared.outcome in (outcomes.ROLLED_BACK, outcomes.BUSY, outcomes.OFFLINE, outcomes.FAILED)
        left = [how for other, how in self.blocked if other in ended]
        word, reason = outcomes.UNCHANGED, "" if counts else "no task ran for it"
        if counts.get("failures"):
            word, reason = (declared.outcome, declared.reason or message) if on_purpose else (outcomes.FAILED, message)
        elif counts.get("unreachable") or self.unreachable:  # the second where a play reads on without the host
            word, reason = outcomes.OFFLINE, self.unreachable
        elif declared.outcome == outcomes.UNCHANGED and counts.get("changed"):
            word, reason = outcomes.UPDATED, declared.reason  # its apps are unchanged, and other tasks were not
        elif self.declared:
            word, reason = declared.outcome, declared.reason
        elif left:
            word, reason = outcomes.FAILED, left[0]
        elif counts.get("changed"):
            word, reason = outcomes.UPDATED, ""
        return RobotOutcome(word, reason, declared.steps)


@dataclass
class _Play:
    """A play, or one of its batches; `over` are the hosts of those before."""

    name: str
    begun: float
    hosts: list[str]
    batch: set[str]
    over: set[str] = field(default_factory=set)


def _ended(stats: Mapping[str, Counts]) -> set[str]:
    """The hosts that failed or were lost."""
    return {name for name, one in stats.items() if one.get("failures") or one.get("unreachable")}


class RunReport:
    """Collects what happens in a run. Times are seconds of one clock, whichever, but for `started`, which is UTC."""

    def __init__(self, now: float = 0.0, started: str = "") -> None:
        self.playbook, self.started = "", started
        self._begun = now
        self._plays: list[_Play] = []
        self._tasks: dict[str, Task] = {}
        self._hosts: dict[str, _Host] = {}
        self._apis: dict[str, Api] = {}

    def host(self, name: str, groups: Iterable[str] = ()) -> _Host:
        host = self._hosts.setdefault(name, _Host())
        if groups:
            host.groups = tuple(sorted(set(groups) - {"all", "ungrouped"}))
        return host

    def play(self, name: str, hosts: Iterable[str], now: float, batch: Iterable[str] = ()) -> None:
        """It begins, or a further batch of its hosts."""
        new = _Play(name, now, list(hosts), {*batch})
        for last in self._plays[-1:]:
            over = last.over | last.batch
            if (last.name, last.hosts) == (name, new.hosts) and not over & new.batch:
                new.over = over
        self._plays.append(new)
        for host in self._plays[-1].hosts:
            self.host(host)

    def task(self, key: str, new: Task, now: float) -> None:
        """It begins, be it for a further batch of hosts."""
        new.play = self._plays[-1].name if self._plays else ""
        new.stage, new.action = new.stage or new.play, new.action.rpartition(".")[2]
        self._tasks.setdefault(key, new).at = now

    def ok(self, key: str, host: str, result: Result, now: float) -> None:
        task = self.ran(key, host, now)
        if result.get("changed") and task:
            task.changed.add(host)
            changed = self.host(host).changed
            if task.name not in changed and len(changed) < CHANGED_KEPT:
                changed.append(task.name)
        self._learn(task, host, result)

    def failed(self, key: str, host: str, result: Result, now: float, ignored: bool = False) -> None:
        task = self.ran(key, host, now)
        self._learn(task, host, result)
        if ignored:
            return
        # what makes a host leave the run says nothing of what became of it
        name = task.name if task and task.action != "_leave" else ""
        own = self.host(host)
        own.failure, own.failed_task = results.message_of(result), name
        if task and task.for_all:
            self._ends_for_all(host, f"{task.name} failed on {host} for all hosts")

    def unreachable(self, key: str, host: str, result: Result, now: float) -> None:
        task = self.ran(key, host, now)
        self.host(host).unreachable = results.message_of(result)
        if task and task.for_all:
            self._ends_for_all(host, f"{task.name} did not reach {host} for all hosts")

    def too_many_failed(self) -> None:
        """Ansible ends the play for all hosts."""
        for host in [name for play in self._plays[-1:] for name in play.hosts if self.host(name).failure]:
            self._ends_for_all(host, f"more hosts failed than max_fail_percentage allows, {host} is one of them")

    def _ends_for_all(self, host: str, why: str) -> None:
        for play in self._plays[-1:]:
            for other in play.hosts:
                if other not in (host, *play.over):
                    self.host(other).blocked.append((host, f"not carried on: {why}"))

    def cut_short(self, stats: Mapping[str, Counts]) -> None:
        """All hosts of a play failed, and Ansible begins no further one: so much of the hosts that those were for."""
        there = {name: self._hosts[name] for name in (self._plays[-1].hosts if self._plays else ())}
        for name in [name for name in there if name in _ended(stats)][:1]:
            host, how = there[name], "the connection was lost"
            why = host.unreachable
            if stats[name].get("failures"):  # what was rescued is none
                how, why = f"{host.failed_task or 'it'} failed", str(host.failure)
            for other in self._hosts.keys() - there.keys():
                self._hosts[other].blocked.append((name, f"not carried on: the run ended on {name}: {how}: {why}"))

    def ran(self, key: str, host: str, now: float) -> Task | None:
        """It did something for the host, or was skipped."""
        task = self._tasks.get(key)
        self.host(host)
        if task:
            task.hosts.add(host)
            task.seconds += now - task.at
            task.at = now
        return task

    def _learn(self, task: Task | None, name: str, result: Result) -> None:
        action, host = task.action if task else "", self.host(name)
        host.declared = results.outcome_of(action, result) or host.declared
        host.ready = results.ready_of(action, result) or host.ready
        self._apis.update(result.get("apis") or {})

    def finish(self, stats: Mapping[str, Counts], now: float, check_mode: bool = False) -> Data:
        """The report as it is written. `stats` is Ansible's own summary per host: it knows what was rescued."""
        names = [name for name in self._hosts if name != "localhost" or name in stats]
        if len(names) > 1:  # what ran on the control node only helped the others
            names = [name for name in names if name != "localhost"]
        ended = _ended(stats)
        slowest = sorted(self._tasks.values(), key=lambda task: task.seconds, reverse=True)[:SLOWEST]
        hosts = [self._host_report(name, stats.get(name) or {}, ended) for name in names]
        words = [host["outcome"] for host in hosts]
        ends = [*(play.begun for play in self._plays[1:]), now]
        return {
            "playbook": self.playbook,
            "check_mode": check_mode,
            "started": self.started,
            "elapsed": round(now - self._begun, 3),
            "outcomes": {word: words.count(word) for word in outcomes.OUTCOMES if word in words},
            "hosts": hosts,
            "plays": [{"name": one.name, "seconds": round(end - one.begun, 3)} for one, end in zip(self._plays, ends)],
            "stages": self._stages(),
            "slowest_tasks": [task.row() for task in slowest],
            "tasks": len(self._tasks),
            "apis": self._apis,
        }

    def _host_report(self, name: str, counts: Counts, ended: Iterable[str]) -> Data:
        """`changed` are names of tasks, `counts` Ansible's own."""
        host = self._hosts[name]
        failed = (host.failed_task if counts.get("failures") else "") or None
        about = {"host": name, "groups": host.groups, "failed_task": failed, "changed": host.changed}
        return {**about, **host.outcome(counts, ended).as_dict(), "ready": host.ready, "counts": counts}

    def so_far(self) -> Noted:
        """What there is to say of each host if it is here still, and if it was lost."""
        ended = {name for name, host in self._hosts.items() if host.failure or host.unreachable}
        here, lost = dict[str, Data](), dict[str, Data]()
        for name, host in self._hosts.items():
            changed = len(host.changed)
            gone = {"failures": bool(host.failure), "unreachable": bool(host.unreachable), "changed": changed}
            stays, left = host.outcome({"changed": changed, "ok": 1}, ()), host.outcome(gone, ended)
            of_run = name, self.playbook, self.started
            here[name] = HostRun(*of_run, stays, changed).as_dict()
            lost[name] = HostRun(*of_run, left, changed, host.failed_task).as_dict()
        return Noted(self.playbook, self.started, here, lost)

    def _stages(self) -> list[Data]:
        stages: dict[str, float] = {}
        for task in self._tasks.values():
            stages[task.stage] = stages.get(task.stage, 0.0) + task.seconds
        return [{"name": name, "seconds": round(seconds, 3)} for name, seconds in stages.items()]
