# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks of nodes, services and actions: one condition judged, with its reason.

Pure. `wait` is the verdict for everything that time may mend. Runs on Python 3.8 with the standard library, on hosts
and in pods.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Iterable

from .._common.poll import PASS, WAIT
from .conditions import ActionCondition
from .graph import BUSY_STATES, GOAL_STATES, Graph, Node, StatusReading


@dataclass(frozen=True)
class Check:
    """One condition judged. `reason` stands alone in a message; `observed` has the same as data."""

    kind: str
    name: str
    verdict: str
    reason: str
    observed: dict[str, Any] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)

    def __str__(self) -> str:
        return f"{self.kind} {self.name}: {self.reason}"


def count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def listed(names: Iterable[str]) -> str:
    return ", ".join(sorted(names))


def living(graph: Graph, names: Iterable[str]) -> tuple[list[str], list[str]]:
    """Names split into those that answered and, with the reason, those that did not."""
    alive, dead = [], []
    for name in names:
        node = graph.nodes.get(name, Node(name))
        if node.reachable:
            alive.append(name)
        else:
            dead.append(f"{name} ({node.error or 'not asked'})")
    return alive, dead


def is_down(graph: Graph, name: str) -> bool:
    node = graph.nodes.get(name)
    return node is not None and node.asked and not node.reachable


def check_node(graph: Graph, name: str) -> Check:
    node = graph.nodes.get(name)
    if node is None:
        return Check("node", name, WAIT, "not registered with the master")
    observed = {"uri": node.uri, "pid": node.pid}
    if not node.reachable:
        return Check("node", name, WAIT, f"registered, but down: {node.error}", observed)
    return Check("node", name, PASS, f"up, process {node.pid} at {node.uri}", observed)


def check_absent(graph: Graph, name: str) -> Check:
    node = graph.nodes.get(name)
    if node is None:
        return Check("absent", name, PASS, "gone from the graph")
    state = "and answers" if node.reachable else f"though it is down ({node.error}): a stale registration"
    return Check("absent", name, WAIT, f"still registered, {state}", {"uri": node.uri, "pid": node.pid})


def check_service(graph: Graph, name: str) -> Check:
    service = graph.services.get(name)
    if service is None:
        return Check("service", name, WAIT, "not registered with the master")
    providers = listed(service.providers)
    probe = service.probe
    if probe is None:
        return Check("service", name, WAIT, f"registered by {providers}, not asked")
    observed = {"provider": probe.provider, "type": probe.type, "uri": probe.uri}
    if probe.error:
        return Check("service", name, WAIT, f"registered by {providers}, but not served: {probe.error}", observed)
    if probe.provider and probe.provider not in service.providers:
        reason = f"registered by {providers}, but {probe.provider} answers at {probe.uri}: a stale registration"
        return Check("service", name, WAIT, reason, observed)
    return Check("service", name, PASS, f"served by {probe.provider or providers}", observed)


def _idle(server: str, status: StatusReading) -> tuple[str, str]:
    """Idle must be seen twice: a goal that is on its way stands in no list yet."""
    busy = [state for reading in status.readings for state in reading if state in BUSY_STATES]
    if busy:
        last = [state for state in status.readings[-1] if state in BUSY_STATES] or busy
        states = [GOAL_STATES[state] for state in last]
        told = ", ".join(f"{states.count(state)} {state}" for state in dict.fromkeys(states))
        return WAIT, f"busy on {server}: {told}"
    if len(status.readings) < 2:
        return WAIT, f"idle on {server}, seen once only: {status.error or 'a second status is due'}"
    return PASS, f"idle on {server}, seen twice"


def check_action(graph: Graph, wanted: ActionCondition) -> Check:
    action = graph.actions.get(wanted.name)
    if action is None or not (action.status_publishers or action.goal_subscribers):
        return Check("action", wanted.name, WAIT, "no action server is registered with the master")
    observed: dict[str, Any] = {"servers": list(action.servers)}
    if not action.servers:
        has = {
            "publishes its status": action.status_publishers,
            "takes its goals": action.goal_subscribers,
            "takes its cancels": action.cancel_subscribers,
        }
        lacking = " and ".join(what for what, names in has.items() if not names) or "does all of it at once"
        return Check("action", wanted.name, WAIT, f"no whole action server: no node {lacking}", observed)
    read = {name: action.statuses.get(name, StatusReading(error="not asked")) for name in action.servers}
    alive = [name for name, status in read.items() if status.readings]
    observed["goals"] = {name: [GOAL_STATES.get(s, str(s)) for s in read[name].readings[-1]] for name in alive}
    if not alive:
        told = listed(f"{name} ({status.error})" for name, status in read.items())
        return Check("action", wanted.name, WAIT, f"no status can be read: {told}", observed)
    if len(alive) > 1:
        reason = f"{len(alive)} servers take the same goals: {listed(alive)}"
        return Check("action", wanted.name, WAIT, reason, observed)
    if wanted.state == "up":
        return Check("action", wanted.name, PASS, f"served by {alive[0]}", observed)
    verdict, reason = _idle(alive[0], read[alive[0]])
    return Check("action", wanted.name, verdict, reason, observed)
