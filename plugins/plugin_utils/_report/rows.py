# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""How a fleet stands, as rows: a type for those of each section, and all sections. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from .._model import names
from .._model.keys import plain

SHARED = "(shared)"  # whose the graph of a shared master is, and an app of the whole fleet
NAMED = 6  # a line has no room for the names of a whole fleet


@dataclass(frozen=True)
class Row:
    """A line of a section."""


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


@dataclass(frozen=True)
class Host(Row):
    name: str = ""
    group: str = ""
    address: str = ""
    role: str = ""
    cluster: str = ""
    reachable: bool = True
    reason: str = ""


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


@dataclass(frozen=True)
class Placed(Row):
    """What runs on a node."""

    node: str = ""
    placement: str = ""
    runs: tuple[str, ...] = ()


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


@dataclass(frozen=True)
class WentBack(OfRobot):
    """An app that a keeper took back from the revision `before` to `after`."""

    namespace: str = ""
    before: str = ""
    after: str = ""
    at: str = ""
    reason: str = ""


@dataclass(frozen=True)
class Ended(Row):
    """A process of a launch file that has ended nobody knows how; it may have done its work."""

    robot: str = ""
    app: str = ""
    node: str = ""
    host: str = ""


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


@dataclass(frozen=True)
class Link(OfRobot):
    """Who hears whom; `broken` are the pairs of them that are registered, alive and not connected."""

    action: bool = False
    publishers: tuple[str, ...] = ()
    subscribers: tuple[str, ...] = ()
    broken: tuple[tuple[str, str], ...] = ()


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


@dataclass(frozen=True)
class LastRun(Row):
    """What the newest run that had the host made of it."""

    host: str = ""
    outcome: str = ""
    playbook: str = ""
    started: str = ""
    changed: int = 0
    note: str = ""


@dataclass(frozen=True)
class Step(OfRobot):
    """A step of a robot's last update; `before` and `after` are the versions of its apps."""

    id: str = ""
    handoff: str = ""
    outcome: str = ""
    before: tuple[str, ...] = ()
    after: tuple[str, ...] = ()
    seconds: float = 0.0
    busy_wait: float = 0.0
    phases: Mapping[str, float] = field(default_factory=dict)
    note: str = ""


@dataclass(frozen=True)
class Status:
    """All sections. `read` makes it of a mapping of lists, in which sections and keys of rows may be missing."""

    problems: tuple[Trouble, ...] = ()
    hosts: tuple[Host, ...] = ()
    nodes: tuple[Node, ...] = ()
    placement: tuple[Placed, ...] = ()
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

    def as_dict(self) -> dict[str, Any]:
        """As the task of status.yml returns it: a list of mappings for each section."""
        found: dict[str, Any] = plain(self)
        for row in (*found["went_back"], *found["steps"]):
            row["from"], row["to"] = row.pop("before"), row.pop("after")
        return found


def some(given: Sequence[str]) -> str:
    """A few names, and how many there are beside them."""
    rest = len(given) - NAMED
    return ", ".join(given[:NAMED]) + (f" and {rest} more" if rest > 0 else "")


def logs_of(robot: str, app: str, more: str = "") -> str:
    """How one reads what an app has written."""
    namespace = names.FLEET_NAMESPACE if robot == SHARED else names.robot_namespace(robot)
    return f"k3s kubectl -n {namespace} logs deploy/{app}{more}"
