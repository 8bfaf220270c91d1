# SPDX-License-Identifier: GPL-3.0-or-later
"""ROS graphs as ros_graph_info returns them -> rows: which node runs where, who hears whom and who should but does not,
and which processes of launch files have ended. Pure.

The five topics of an action are one link, and a topic that nobody listens to is none. A process that crashed is a
problem. One that has ended nobody knows how may have done its work: a row, for a person to judge.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated

from ...module_utils._common.documents import Result
from ...module_utils._ros.contract import ACTION_TOPICS
from ...module_utils._ros.graph import Graph, NodeKey, Topic, host_of, names_of
from ...module_utils._ros.graph_json import graph_from
from .._model.keys import read
from . import rows
from .rows import SHARED, Promise, Trouble, Workload

PLUMBING_TOPICS = frozenset({"/rosout", "/rosout_agg", "/clock"})
Owner = tuple[str, str]  # robot, app
Promises = Mapping[str, Promise]  # by topic


@dataclass(frozen=True)
class Process:
    """A process of a launch file, in the pod of this address; `crash` says in words what is wrong with it."""

    node: Annotated[str, str] = ""
    host: Annotated[str, str] = ""
    alive: bool = False
    exit_code: int | None = None
    crash: str = ""


@dataclass(frozen=True)
class Reading:
    """What ros_graph_info returns of a master's graph, and what is promised of it."""

    graph: Graph
    launched: tuple[Process, ...] = ()
    promised: Promises = field(default_factory=dict)

    @classmethod
    def from_dict(cls, found: Result, promised: Promises) -> Reading:
        return cls(graph_from(found), tuple(read(Process, one) for one in found.get("launched") or ()), promised)


Graphs = Mapping[str, Reading]  # by robot, or SHARED


def apps_of(graph: str, apps: Iterable[Workload]) -> list[Workload]:
    """Those whose nodes may be in the graph of a robot, or in the shared one, which is all robots'."""
    return [row for row in apps if graph == SHARED or row.robot in (graph, SHARED)]


def owners_of(apps: Iterable[Workload]) -> dict[str, Owner]:
    """Address -> whose it is. One that several apps have (that of the host, where they share its network) tells
    nothing."""
    found: dict[str, set[Owner]] = {}
    for row in apps:
        for address in row.addresses:
            found.setdefault(address, set()).add((row.robot, row.name))
    return {address: owners.pop() for address, owners in found.items() if len(owners) == 1}


def place(graph: str, uri: str, apps: Iterable[Workload], hosts: Mapping[str, str]) -> tuple[str, str]:
    """Where a ROS node runs, and for which app: `rows.RosNode.at` and `rows.RosNode.app`, by the address that it is
    registered with. `apps` are masters, too, `hosts` the nodes' names by address."""
    address = host_of(uri)
    here = [row for row in apps_of(graph, apps) if address in row.addresses]
    if len({host for row in here for host in row.nodes}) > 1:
        # pods of two clusters may have it: then the robot's own is meant
        here = [row for row in here if row.robot == graph]
    found = {host for row in here for host in row.nodes}
    at = found.pop() if len(found) == 1 else hosts.get(address, address)
    return at, owners_of(here).get(address, ("", ""))[1]


def node_rows(graphs: Graphs, apps: Sequence[Workload], nodes: Iterable[rows.Node]) -> Iterator[rows.RosNode]:
    hosts = {row.address: row.name for row in nodes if row.address}
    for robot, one in sorted(graphs.items()):
        for node in map(one.graph.node, one.graph.names):
            sizes = len(node.publications), len(node.subscriptions)
            where = place(robot, node.uri, apps, hosts)
            yield rows.RosNode(robot, node.name, *where, node.reachable, node.error, *sizes, node.services)


def topic_rows(graphs: Graphs) -> Iterator[rows.Topic]:
    """What is there, and what is promised."""
    for robot, one in sorted(graphs.items()):
        for topic in map(one.graph.topic, sorted({*one.promised, *one.graph.topics} - PLUMBING_TOPICS)):
            sizes = len(topic.publishers), len(topic.subscribers), len(topic.connections)
            promise, why = one.promised.get(topic.name), topic.rate_error
            yield rows.Topic(robot, topic.name, topic.type, *sizes, topic.rate, promise, why)


def links(graphs: Graphs) -> list[rows.Link]:
    return [link for robot, one in sorted(graphs.items()) for link in _links(robot, one.graph) if link.subscribers]


def _links(robot: str, graph: Graph) -> Iterator[rows.Link]:
    for name in sorted(graph.actions):
        # from its clients to its server; goals have to get there, results have to come back
        goal, result = graph.topic(f"{name}/goal"), graph.topic(f"{name}/result")
        back = ((client, server) for server, client in _broken(result, graph) if client in goal.publishers)
        yield _link(robot, name, goal, (*_broken(goal, graph), *back), action=True)
    of_actions = {f"{name}/{part}" for name in graph.actions for part in ACTION_TOPICS}
    for name, topic in sorted(graph.topics.items()):
        if name not in of_actions | PLUMBING_TOPICS:
            yield _link(robot, name, topic, _broken(topic, graph))


def _link(
    robot: str, name: str, topic: Topic, broken: Iterable[tuple[NodeKey, NodeKey]], action: bool = False
) -> rows.Link:
    pairs = tuple(dict.fromkeys((one.name, other.name) for one, other in broken))
    return rows.Link(robot, name, action, tuple(names_of(topic.publishers)), tuple(names_of(topic.subscribers)), pairs)


def _broken(topic: Topic, graph: Graph) -> Iterator[tuple[NodeKey, NodeKey]]:
    """By the publishers' own word. What a node that does not answer is connected to, nobody knows."""
    for ends in itertools.product(topic.publishers, topic.subscribers):
        if all(graph.at(end).reachable for end in ends) and ends not in topic.connections:
            yield ends


def launched_rows(apps: Iterable[Workload], graphs: Graphs) -> tuple[list[Trouble], list[rows.Ended]]:
    """Problems, and processes that have ended nobody knows how."""
    known = list(apps)
    problems: list[Trouble] = []
    ended: list[rows.Ended] = []
    for robot, one in sorted(graphs.items()):
        owners = owners_of(apps_of(robot, known))
        for process in one.launched:
            row = rows.Ended(*owners.get(process.host, (robot, "")), process.node, process.host)
            if process.crash:
                told = row.told()
                problems.append(Trouble(told.where, f"{process.node} {process.crash}", told.todo))
            elif not process.alive and process.exit_code is None:
                ended.append(row)
    return problems, ended
