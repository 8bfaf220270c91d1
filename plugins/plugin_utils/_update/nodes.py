# SPDX-License-Identifier: GPL-3.0-or-later
"""Apps on the ROS graph: their nodes, what the next version's are called, and what it is meant to change. Pure.

An app has the node of its name, or all that its pod started. Those of a launch file have the names that it gives them;
where its versions overlap, each with its revision behind it (`_pod/launch.py`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from ...module_utils._pod.launch import LOGGERS, MANAGER, named, owner_of
from ...module_utils._robot.latched import worth_keeping
from ...module_utils._ros.contract import Intended
from ...module_utils._ros.graph import Graph, names_of
from ...module_utils._ros.names import matches, resolve
from ...module_utils._step.objects import node_of, suffix_of
from .._model import context
from .._model.app import App
from .._model.context import Robot
from .world import Object

_HELD = "--replace="
# Whether the keeper keeps it.
LATCHED = {
    True: "is given to later subscribers by the keeper until the next version says something",
    False: "goes with it",
}
# Who publishes one of these moves the robot, and who takes it obeys.
MOVING = ("geometry_msgs/Twist", "geometry_msgs/TwistStamped", "trajectory_msgs/JointTrajectory")
MOVING_PACKAGES = ("ackermann_msgs/", "control_msgs/", "mavros_msgs/")
# These say what follows from the robot's description alone: two of them say the same.
AGREEING = ("state_publisher", "static_transform")


@dataclass(frozen=True)
class Launched:
    """An app whose nodes a launch file names: what is behind their names before and after a step.

    `held`: nodes, as the launch file calls them, that begin when those of the version before have ended. `overlap`:
    those of which somebody said that two of them do no harm. `on_demand`: what they have on the graph is their clients'
    wish.
    """

    old: str
    new: str
    held: tuple[str, ...] = ()
    overlap: tuple[str, ...] = ()
    on_demand: bool = False

    def plain(self, node: str) -> str:
        """What the launch file calls a node of the version before."""
        return node.removesuffix(self.old)

    def is_held(self, node: str) -> bool:
        return any(named(word, [self.plain(node)]) for word in self.held)

    def may_overlap(self, node: str) -> bool:
        return any(named(word, [self.plain(node)]) for word in self.overlap)


def launched(before: Object, after: Object, app: App) -> Launched | None:
    """Two versions of an app, of which the later is a launch file; None: it has a node of its own name."""
    if node_of(after):
        return None
    words = [word for one in after["spec"]["template"]["spec"]["containers"] for word in one.get("args") or ()]
    held = tuple(word.removeprefix(_HELD) for word in words if word.startswith(_HELD))
    overlap = app.launch.overlap if app.launch else ()
    return Launched(suffix_of(before), suffix_of(after), held, overlap, app.on_demand)


@dataclass(frozen=True)
class Succession:
    """What is called otherwise after a step: nodes, and topics and services that are private to one."""

    nodes: Mapping[str, str] = field(default_factory=dict)
    names: Mapping[str, str] = field(default_factory=dict)

    @property
    def renames(self) -> dict[str, str]:
        return {**self.nodes, **self.names}

    def __or__(self, other: Succession) -> Succession:
        return Succession({**self.nodes, **other.nodes}, {**self.names, **other.names})


def succession(app: Launched, nodes: Sequence[str], there: Iterable[str]) -> Succession:
    """Of a launch file's nodes; `there` are all topics and services.

    Private ones have the place that others know in every version, but for those that a nodelet manager has for its own
    nodelets.
    """
    new = {node: app.plain(node) + app.new for node in nodes}
    known = set(there)
    names_: dict[str, str] = {}
    for name in known:
        node = owner_of(name, nodes)
        if node:
            own = MANAGER if f"{node}/load_nodelet" in known else LOGGERS
            rest = name[len(node) :]
            names_[name] = (new[node] if rest[1:] in own else app.plain(node)) + rest
    return Succession(new, names_)


# --- what the next version is meant to change -------------------------------------------------------------------------


def intended(apps: Collection[App], robot: Robot, old_nodes: Mapping[str, str], back: bool = False) -> Intended:
    """Of all apps of a step together: it is one change. `back`: to the version before, so names move back, too."""
    ignore: list[str] = []
    renamed: dict[str, str] = {}
    rates: dict[str, float] = {}
    nodes: list[str] = []
    for app in apps:
        stable, update = context.graph_node(app, robot), app.update
        namespace, node = context.graph_namespace(app, robot), old_nodes.get(app.name) or stable

        def full(name: str, app: App = app, namespace: str = namespace, node: str = node) -> str:
            kept = name.startswith("~") and name[1:].lstrip("/") in app.private_names
            return resolve(name, namespace, context.graph_node(app, robot) if kept else node)

        ignore += [full(name) for name in update.ignore]
        renamed |= {full(before): full(after) for before, after in update.renamed.items()}
        rates |= {full(name): float(hz) for name, hz in update.rates.items()}
        nodes += [node] if app.on_demand else []
    if back:
        renamed = {after: before for before, after in renamed.items()}
    keeps = robot.master.ours and all(app.hooks != "none" for app in apps)
    return Intended(tuple(ignore), renamed, rates, tuple(nodes), keeps)


def allowed(graph: Graph, nodes: Sequence[str], wanted: Intended) -> list[str]:
    """What a step of these nodes (as they are called now) would allow, in words; what nobody has now is not told."""
    own = set(nodes)
    topics = {
        name: topic
        for name, topic in sorted(graph.topics.items())
        if own & {*names_of((*topic.publishers, *topic.subscribers))}
    }
    services = {name for name, one in graph.services.items() if own & {one.said.provider, *names_of(one.providers)}}
    actions = {name for name, action in graph.actions.items() if own & {*names_of(action.servers)}}
    there = [*topics, *sorted(services), *sorted(actions)]
    found = [f"{name} may be missing or of another type" for name in there if matches(name, wanted.ignore)]
    found += [
        f"{before} has to be {after} then"
        for before, after in wanted.renamed.items()
        if any(name == before or name.startswith(f"{before}/") for name in there)
    ]
    for name, topic in topics.items():
        hz = wanted.rate(wanted.renamed.get(name, name))
        was = [rate for key, rate in topic.rates.items() if key.name in own and rate]
        if hz is not None:
            carried = f" (now {max(was):g} Hz)" if was else ""
            found.append(f"{name} may carry {'any rate' if not hz else f'{hz:g} Hz or more'}{carried}")
    found += [f"{node} may have other topics and services: its clients ask for them" for node in wanted.on_demand]
    for node in nodes:
        latched = [name for name, topic in topics.items() if node in names_of(topic.latched)]
        heard = [name for name, topic in topics.items() if node in names_of(topic.subscribers)]
        found += [f"what {node} latched on {name} {LATCHED[wanted.keeps]}" for name in worth_keeping(latched, heard)]
    return found


# --- why two of a node must not be there at once ----------------------------------------------------------------------


def obstacle(graph: Graph, node: str) -> str:
    """What the node does that two of it would undo, in words; empty: nothing that shows.

    The graph shows names and types. A device, a port or a file that both would write to it does not show.
    """
    for name, action in sorted(graph.actions.items()):
        if node in names_of(action.servers):
            return f"serves the action {name}, of which two servers lose goals"
    for name, topic in sorted(graph.topics.items()):
        moves = topic.type in MOVING or topic.type.startswith(MOVING_PACKAGES)
        publishes = node in names_of(topic.publishers)
        if moves and publishes:
            return f"publishes {name} ({topic.type}), so two of it would both move the robot"
        if moves and node in names_of(topic.subscribers):
            return f"obeys {name} ({topic.type}), and two of it would"
        agrees = any(word in node for word in AGREEING)
        if name.endswith("/tf") and publishes and not agrees:
            return f"publishes {name}, where two of it would contradict each other"
    return ""
