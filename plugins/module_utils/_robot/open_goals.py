# SPDX-License-Identifier: GPL-3.0-or-later
"""The goals that a step's new nodes work on: they would go with them. And whether such a node is to get any."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Callable, Mapping, Sequence

from .._common.errors import KubeError, RosError
from .._ros.backend import Backend, MasterState, Questions
from .._ros.graph import BUSY_STATES, GOAL_STATES, Graph
from .._ros.names import is_meant
from .._step.objects import Object, annotations_of, has_node, name_of, node_of, rolled_out
from .._step.record import PROVEN, mark_of
from .._step.words import MASTER, NODE
from .cluster_api import REFUSED, ApiError, Cluster, read_records
from .way_back import Step, member_of

PATIENCE = 10.0  # seconds for an API that does not answer


@dataclass(frozen=True)
class Goals:
    """What is under way, in words; what cannot be read; and who serves what, for a hold."""

    busy: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()
    servers: Mapping[str, str] = field(default_factory=dict)  # action -> its server, where that is the new node alone

    def waiting(self, patient: bool) -> str:
        """What is waited for, in words; where one is not `patient`, not for what cannot be read."""
        return ", ".join([*self.busy, *(self.unknown if patient else ())])


def open_goals(ros: Backend, step: Step) -> Goals:
    """Of the nodes that go if the step is taken back. A node whose address refuses connections works on nothing."""
    if any(member.name == MASTER for member in step.members):  # it serves none, and may not answer
        return Goals()
    return _goals(ros, lambda state: _served(ros, state, step))


def open_goals_at(ros: Backend, pod: Object) -> Goals:
    """Of the nodes in a pod."""

    def served(state: MasterState) -> dict[str, tuple[str, ...]]:
        servers = {name: state.servers(name) for name in state.graph.actions}
        here = _at(ros, state, servers, [pod]) | {annotations_of(pod).get(NODE, "")}
        return {name: tuple(one for one in all_of_it if one in here) for name, all_of_it in servers.items()}

    return _goals(ros, served)


def _goals(ros: Backend, served_in: Callable[[MasterState], Mapping[str, tuple[str, ...]]]) -> Goals:
    try:
        state = ros.state()
        served = {action: servers for action, servers in served_in(state).items() if servers}
        names = sorted({server for servers in served.values() for server in servers})
        graph = ros.ask(state, Questions({name: frozenset() for name in names}, (), tuple(served)))
    except RosError as error:
        return Goals(unknown=(str(error),))
    busy, unknown = [], []
    for action, servers in served.items():
        for server in servers:
            node = graph.node(server)
            reading = graph.actions[action].statuses[node.key]
            states = [state for states in reading.readings for state in states if state in BUSY_STATES]
            if states:
                busy.append(f"{action} {GOAL_STATES[states[-1]]}")
            elif len(reading.readings) < 2 and not node.refused:
                unknown.append(f"{action} of {server} ({reading.error or 'no second status'})")
    alone = {action: servers[0] for action, servers in served.items() if state.servers(action) == servers}
    return Goals(tuple(busy), tuple(unknown), alone)


def _served(ros: Backend, state: MasterState, step: Step) -> dict[str, tuple[str, ...]]:
    """Action -> the new nodes that serve it; a launch file's are those at its pod's address, and of its actions' names.

    An old node of another name works on by itself, and stays; so does one of the same name, beside which the new
    version only waits.
    """
    servers = {name: state.servers(name) for name in state.graph.actions}
    nodes = {node_of(member.deployment) for member in step.going_back} - {""}
    nodes -= _at(ros, state, servers, [pod for member in step.going_back for pod in member.others])
    nodes |= _at(ros, state, servers, [pod for member in step.going_back for pod in member.pods])
    old = {node_of(member.before) for member in step.going_back if member.before} - nodes
    known = {name for member in step.going_back for name in member.actions}
    found = {}
    for name, all_of_it in servers.items():
        own = tuple(one for one in all_of_it if is_meant(one, nodes))
        found[name] = own or tuple(one for one in all_of_it if name in known and not is_meant(one, old))
    return found


def _at(ros: Backend, state: MasterState, servers: Mapping[str, tuple[str, ...]], pods: Sequence[Object]) -> set[str]:
    """Those of the servers that are in these pods."""
    every = {name for found in servers.values() for name in found}
    asked = ros.ask(state, Questions({name: frozenset() for name in every})) if pods and every else Graph()
    return {node.name for node in asked.nodes.values() if any(has_node(pod, node.name, node.uri) for pod in pods)}


class Staying:
    """Whether the server of an action is the one that will stay: its version is proven, or got ready.

    Where nobody can say so, nobody can take it back either.
    """

    def __init__(self, cluster: Cluster, now: Callable[[], float] = time.monotonic) -> None:
        self.cluster, self.now = cluster, now
        self.of: dict[tuple[str, str], tuple[str, str]] = {}  # action and node -> the Deployment
        self.silent: float | None = None  # since when the API does not answer

    def __call__(self, action: str, node: str) -> bool:
        try:
            found = self._may_go_back(action, node)
            self.silent = None
        except KubeError:
            self.silent = self.now() if self.silent is None else self.silent
            return self.now() - self.silent >= PATIENCE
        return not found

    def _may_go_back(self, action: str, node: str) -> bool:
        found = self.of.get((action, node)) or self._find(action, node)
        if found is None:
            return False
        self.of[action, node] = found
        deployment = self.cluster.deployment(*found)
        if deployment is None or mark_of(deployment) is None or rolled_out(deployment):
            return False
        records = read_records(self.cluster, found[0], [found[1]])
        return member_of(deployment, records).state != PROVEN

    def _find(self, action: str, node: str) -> tuple[str, str] | None:
        """The Deployment of that node; a launch file's is the unproven one that served the action before."""
        for namespace in self.cluster.namespaces():
            try:
                there = self.cluster.deployments(namespace)
            except ApiError as error:
                if error.status not in REFUSED:
                    raise
                continue  # another one's, as far as anybody knows
            for item in there:
                if is_meant(node, [node_of(item)]):
                    return namespace, name_of(item)
            for item in there:
                if mark_of(item) is not None:
                    records = read_records(self.cluster, namespace, [name_of(item)])
                    if action in member_of(item, records).actions:
                        return namespace, name_of(item)
        return None
