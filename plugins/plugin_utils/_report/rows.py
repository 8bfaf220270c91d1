# SPDX-License-Identifier: GPL-3.0-or-later
"""How a fleet stands, as rows: a type for those of each section, with how good one is and what is told of it, and all
sections. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from ...module_utils._ros.checks import RATE_TOLERANCE
from .._model import names
from .._model.formats import quantity_value
from .._model.outcomes import BUSY, FAILED, OFFLINE, ROLLED_BACK

OK, WARN, BAD = "ok", "warn", "bad"
OUTCOMES = {FAILED: BAD, ROLLED_BACK: BAD, OFFLINE: WARN, BUSY: WARN}
NEARLY_FULL = 0.9
SHARED = "(shared)"  # whose the graph of a shared master is, and an app of the whole fleet
NAMED = 6  # a line has no room for the names of a whole fleet
HELPERS = frozenset({names.KEEPER_NAME, names.EXPORTER_NAME})  # beside a master; no inventory has them
OURS = frozenset({"site.yml", "update.yml", "rollback.yml"})  # playbooks that a user may run again by their name


@dataclass(frozen=True)
class Told:
    """How good a row is (empty: there is nothing to judge), and what is said where it is not as it should be.

    `todo` is a command, or a sentence where there is none, `runbook` the name of a page; `hosts` are those whose being
    off explains it.
    """

    level: str
    where: str
    what: str
    since: str = ""
    todo: str = ""
    runbook: str = ""
    hosts: tuple[str, ...] = ()


@dataclass(frozen=True)
class Row:
    """A line of a section."""

    def told(self) -> Told:
        raise NotImplementedError


@dataclass(frozen=True)
class OfRobot(Row):
    """A row of something that a robot has. What is the whole fleet's is of `SHARED`."""

    robot: str = ""
    name: str = ""


@dataclass(frozen=True)
class Trouble(Row):
    """What keeps the fleet from being whole, or from being seen. `cluster` or `graph` is what gave no answer."""

    where: str = ""
    what: str = ""
    todo: str = ""
    since: str = ""
    cluster: str = ""
    graph: str = ""

    def told(self) -> Told:
        return Told(BAD, self.where, self.what, self.since, self.todo)


@dataclass(frozen=True)
class Host(Row):
    name: str = ""
    group: str = ""
    address: str = ""
    role: str = ""
    cluster: str = ""
    reachable: bool = True
    reason: str = ""

    def told(self) -> Told:
        is_robot = self.group == "robots"
        away = WARN if is_robot else BAD  # robots come and go
        level = OK if self.reachable else away
        runbook = "RobotOffline" if is_robot else ""
        todo = f"ansible {self.name} -m ansible.builtin.ping"
        return Told(level, f"host {self.name}", joined("offline", self.reason), "", todo, runbook)


@dataclass(frozen=True)
class Node(Row):
    """`labels` are those that somebody chose."""

    name: str = ""
    ready: bool = False
    reason: str = ""
    since: str = ""
    version: str = ""
    address: str = ""
    roles: tuple[str, ...] = ()
    placement: str = ""
    robot: str = ""
    labels: Mapping[str, str] = field(default_factory=dict)

    def told(self) -> Told:
        ready, where, hosts = joined("Ready", self.reason), f"node {self.name}", (self.name,)
        if self.ready:
            todo = f"k3s kubectl uncordon {self.name}"
            return Told(WARN if self.reason else OK, where, ready, self.since, todo, "", hosts)
        todo = f"ansible {self.name} -b -a 'systemctl status k3s k3s-agent'"
        return Told(BAD, where, f"Not{ready}", self.since, todo, "RobotOffline", hosts)


@dataclass(frozen=True)
class Workload(OfRobot):
    """A master, what helps it, or an app. `ended`, `ended_at`: how and when a container did that is started again."""

    namespace: str = ""
    placement: str = ""
    ready: int = 0
    wanted: int = 1
    nodes: tuple[str, ...] = ()
    addresses: tuple[str, ...] = ()
    images: tuple[str, ...] = ()
    restarts: int = 0
    ended: str = ""
    ended_at: str = ""
    since: str = ""
    note: str = ""

    @property
    def is_master(self) -> bool:
        return self.name == names.MASTER_NAME

    def told(self) -> Told:
        where = "ROS master" if self.is_master else self.name if self.name in HELPERS else f"app {self.name}"
        note, todo = self.note, f"k3s kubectl -n {self.namespace} describe pod -l rosops.fleet/app={self.name}"
        if "CrashLoopBackOff" in note or self.ended:
            todo = f"k3s kubectl -n {self.namespace} logs deploy/{self.name} --previous"
        if self.ended and "CrashLoopBackOff" not in note:
            note = "; ".join(filter(None, (note, self.ended)))
        what = joined(f"{self.ready} of {self.wanted} ready", note)
        level = OK if self.ready >= self.wanted else BAD
        runbook = "RosMasterDown" if self.is_master else ""
        return Told(level, f"{where} of {self.robot}", what, self.since, todo, runbook, self.nodes)


@dataclass(frozen=True)
class WentBack(OfRobot):
    """An app that a keeper took back from the revision `before` to `after`."""

    before: str = ""
    after: str = ""
    at: str = ""
    reason: str = ""

    def told(self) -> Told:
        what = joined(f"taken back by the keeper, from {self.before} to {self.after}", self.reason)
        todo = logs_of(self.robot, names.KEEPER_NAME)
        return Told(WARN, f"app {self.name} of {self.robot}", what, self.at, todo, "RobotUpdateFailed")


@dataclass(frozen=True)
class Ended(Row):
    """A process of a launch file that has ended nobody knows how; it may have done its work."""

    robot: str = ""
    app: str = ""
    node: str = ""
    host: str = ""

    def told(self) -> Told:
        where = f"app {self.app}" if self.app else f"launch file at {self.host}"
        what = f"{self.node} has ended; its exit code is in the pod's log alone"
        return Told(WARN, f"{where} of {self.robot}", what, "", logs_of(self.robot, self.app) if self.app else "")


@dataclass(frozen=True)
class RosNode(OfRobot):
    """`at`: its host, or the bare address of a process that no pod of ours has. `app`: empty where nobody knows."""

    at: str = ""
    app: str = ""
    reachable: bool = False
    error: str = ""
    publications: int = 0
    subscriptions: int = 0
    services: tuple[str, ...] = ()

    def told(self) -> Told:
        todo = logs_of(self.robot, self.app, " --since 10m") if self.app else ""
        level, where = OK if self.reachable else BAD, f"ROS node {self.name} of {self.robot}"
        return Told(level, where, joined("down", self.error), "", todo, "RosNodeDown", (self.at or self.robot,))


@dataclass(frozen=True)
class Promise:
    """The rate in Hz that an app's readiness says of a topic. `robot` is whose app that is."""

    min_rate: float
    app: str
    robot: str


@dataclass(frozen=True)
class Topic(OfRobot):
    type: str = ""
    publishers: int = 0
    subscribers: int = 0
    connections: int = 0
    rate: float | None = None
    promised: Promise | None = None
    note: str = ""

    def told(self) -> Told:
        """By what an app's readiness says of it, as its update holds it. A rate that nobody can tell is not held."""
        where = f"topic {self.name} of {self.robot}"
        found = "nobody publishes it" if self.rate is None else f"{self.rate:.1f} Hz"
        if self.promised is None:
            return Told("", where, found)
        level = OK if self.publishers else BAD
        least = self.promised.min_rate * (1 - RATE_TOLERANCE)
        if self.publishers and self.rate is not None and self.rate < least:
            level = WARN
        told = f"{found}; {self.promised.app} promises at least {self.promised.min_rate:g} Hz"
        todo = logs_of(self.promised.robot, self.promised.app, " --since 10m")
        return Told(level, where, told, "", todo, "RosTopicSilent" if self.rate is None else "RosTopicRateDrop")


@dataclass(frozen=True)
class Link(OfRobot):
    """Who hears whom; `broken` are the pairs of them that are registered, alive and not connected."""

    action: bool = False
    publishers: tuple[str, ...] = ()
    subscribers: tuple[str, ...] = ()
    broken: tuple[tuple[str, str], ...] = ()

    def told(self) -> Told:
        """Who is registered as a subscriber, is alive, and does not get what a publisher sends."""
        pairs = [f"{publisher} is not connected to {subscriber}" for publisher, subscriber in self.broken]
        todo = f"ansible-playbook rosops.fleet.status --limit {self.robot}"
        level = WARN if self.broken else ""
        return Told(level, f"topic {self.name} of {self.robot}", some(pairs), "", todo, "RosTopicSilent")


@dataclass(frozen=True)
class Claim(OfRobot):
    """`unused`: not bound, and nobody mounts it."""

    namespace: str = ""
    bound: bool = False
    unused: bool = False
    since: str = ""
    phase: str = ""
    storage_class: str = ""
    size: str = ""
    used_bytes: int | None = None
    note: str = ""

    def told(self) -> Told:
        where, kubectl = f"claim {self.name} of {self.robot}", f"k3s kubectl -n {self.namespace}"
        if not self.bound:
            level = OK if self.unused else BAD
            what = self.note or self.phase or "not bound"
            return Told(level, where, what, self.since, f"{kubectl} describe pvc {self.name}", "", (self.robot,))
        # a host that is off takes its claims along; one without a number is not told by itself
        level, what = OK, "not measured"
        size = quantity_value(self.size)
        if size and self.used_bytes is not None:
            share = float(self.used_bytes) / float(size)
            level, what = WARN if share >= NEARLY_FULL else OK, f"{share:.0%} used"
        return Told(level, where, what, "", f"{kubectl} get pvc {self.name}", "PvcNearlyFull", (self.robot,))


@dataclass(frozen=True)
class LastRun(Row):
    """What the newest run that had the host made of it."""

    host: str = ""
    outcome: str = ""
    playbook: str = ""
    started: str = ""
    changed: int = 0
    note: str = ""

    def told(self) -> Told:
        named = f"rosops.fleet.{self.playbook.removesuffix('.yml')}" if self.playbook in OURS else self.playbook
        where, what = f"last {self.playbook} on {self.host}", joined(self.outcome, self.note)
        level = OUTCOMES.get(self.outcome, OK)
        todo = f"ansible-playbook {named} --limit {self.host}"
        if level == WARN:
            return Told(level, where, what, self.started, todo, "", (self.host,) if self.outcome == OFFLINE else ())
        return Told(level, where, what, self.started, f"{todo} --check --diff", "RobotUpdateFailed")


@dataclass(frozen=True)
class Step(OfRobot):
    """A step of a robot's last update; `before` and `after` are the versions of its apps."""

    handoff: str = ""
    outcome: str = ""
    before: tuple[str, ...] = ()
    after: tuple[str, ...] = ()
    seconds: float = 0.0
    busy_wait: float = 0.0
    note: str = ""

    def told(self) -> Told:
        return Told(OUTCOMES.get(self.outcome, OK), f"step {self.name} of {self.robot}", self.outcome)


@dataclass(frozen=True)
class Status:
    """All sections. `read` makes it of a mapping of lists, in which sections and keys of rows may be missing."""

    problems: tuple[Trouble, ...] = ()
    hosts: tuple[Host, ...] = ()
    nodes: tuple[Node, ...] = ()
    masters: tuple[Workload, ...] = ()
    helpers: tuple[Workload, ...] = ()
    apps: tuple[Workload, ...] = ()
    went_back: tuple[WentBack, ...] = ()
    claims: tuple[Claim, ...] = ()
    ended: tuple[Ended, ...] = ()
    ros_nodes: tuple[RosNode, ...] = ()
    topics: tuple[Topic, ...] = ()
    links: tuple[Link, ...] = ()
    outcomes: tuple[LastRun, ...] = ()
    steps: tuple[Step, ...] = ()

    def rows(self, section: str) -> tuple[Row, ...]:
        """The rows of a section by its name."""
        found: tuple[Row, ...] = getattr(self, section)
        return found

    @property
    def workloads(self) -> tuple[Workload, ...]:
        return (*self.masters, *self.helpers, *self.apps)


def joined(words: str, more: str) -> str:
    return f"{words}: {more}" if more else words


def some(given: Sequence[str]) -> str:
    """A few names, and how many there are beside them."""
    rest = len(given) - NAMED
    return ", ".join(given[:NAMED]) + (f" and {rest} more" if rest > 0 else "")


def logs_of(robot: str, app: str, more: str = "") -> str:
    """How one reads what an app has written."""
    namespace = names.FLEET_NAMESPACE if robot == SHARED else names.robot_namespace(robot)
    return f"k3s kubectl -n {namespace} logs deploy/{app}{more}"
