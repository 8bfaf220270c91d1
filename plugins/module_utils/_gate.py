# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The gate: conditions on the ROS graph, and one check with a verdict and a reason for each.

Pure but for `look`, which asks an object that is handed in. It knows no XML-RPC: another backend with the same three
methods will do. `wait` is the verdict for everything that time may mend; `fail` only for what a living node itself
contradicts. Runs on Python 3.8 with the standard library, on hosts and in pods.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Iterable, Mapping, Protocol

from ._conditions import ActionCondition, Conditions, TopicCondition
from ._errors import RosError
from ._graph import (
    ANY_TYPE,
    BUSY_STATES,
    GOAL_STATES,
    Graph,
    MasterState,
    Node,
    Questions,
    Rate,
    StatusReading,
    Topic,
)
from ._poll import FAIL, PASS, WAIT, overall

RATE_TOLERANCE = 0.01  # what a window of one second can tell apart; a publisher at just min_rate must not flap
RATE_WINDOW = 1.0
RATE_WINDOW_MAX = 20.0
RATE_MESSAGES = 4  # one before the first interval, and three intervals


def questions(state: MasterState, conditions: Conditions) -> Questions:
    """What has to be asked of whom to judge these conditions, and no more."""
    nodes: dict[str, set[str]] = {}
    registered = set(state.nodes())
    for name in (*conditions.nodes, *conditions.absent):
        if name in registered:
            nodes.setdefault(name, set())
    for topic in conditions.topics:
        publishers, subscribers = state.publishers.get(topic.name, ()), state.subscribers.get(topic.name, ())
        for name in (*publishers, *subscribers):
            nodes.setdefault(name, set()).update({"types"} if topic.type else ())
        for name in publishers if topic.connected else ():
            nodes[name].add("bus")
    return Questions(
        {name: frozenset(calls) for name, calls in nodes.items()},
        tuple(dict.fromkeys(name for name in conditions.services if name in state.services)),
        tuple(dict.fromkeys(action.name for action in conditions.actions)),
    )


def sample_seconds(min_rate: float) -> float:
    """How long to count messages to judge this rate."""
    return min(max(RATE_WINDOW, RATE_MESSAGES / min_rate), RATE_WINDOW_MAX)


# ---- checks


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


def _living(graph: Graph, names: Iterable[str]) -> tuple[list[str], list[str]]:
    """Names split into those that answered and, with the reason, those that did not."""
    alive, dead = [], []
    for name in names:
        node = graph.nodes.get(name, Node(name))
        if node.reachable:
            alive.append(name)
        else:
            dead.append(f"{name} ({node.error or 'not asked'})")
    return alive, dead


def _check_number(graph: Graph, what: str, names: tuple[str, ...], least: int) -> tuple[str, str]:
    alive, dead = _living(graph, names)
    reason = count(len(alive), what)
    if len(alive) < least:
        reason += f" of at least {least}"
    if dead:
        reason += f"; registered, but down: {listed(dead)}"
    return (PASS if len(alive) >= least else WAIT), reason


def _check_type(graph: Graph, topic: Topic, wanted: str) -> tuple[str, str]:
    """A living publisher's own word counts; the master may still know the type of one that is gone."""
    publishers, _dead = _living(graph, topic.publishers)
    subscribers, _dead = _living(graph, topic.subscribers)
    claims = {name: graph.nodes[name].own_types.get(topic.name, "") for name in (*publishers, *subscribers)}
    claims = {name: claim for name, claim in claims.items() if claim not in ("", ANY_TYPE)}
    wrong = {name: claim for name, claim in claims.items() if claim != wanted}
    if wrong:
        return FAIL, f"the type is {listed({f'{claim} at {name}' for name, claim in wrong.items()})}, not {wanted}"
    if claims or topic.type == wanted:
        return PASS, f"type {wanted}"
    return WAIT, f"the type is {topic.type or 'not known'} to the master, not {wanted}"


def _check_connected(graph: Graph, topic: Topic) -> tuple[str, str, list[str]]:
    """Every registered subscriber must be a destination of every publisher, by the publisher's own word.

    The subscriber's word is worth nothing here: it reports a connection before the handshake.
    """
    if not topic.publishers or not topic.subscribers:
        lacking = "publisher" if not topic.publishers else "subscriber"
        return WAIT, f"not connected: no {lacking} is registered", []
    reasons: list[str] = []
    missing_all: set[str] = set()
    done = 0
    for publisher in topic.publishers:
        node = graph.nodes.get(publisher, Node(publisher))
        if node.connections is None:
            reasons.append(f"the connections of {publisher} are not known ({node.error or 'it did not tell them'})")
            missing_all.update(topic.subscribers)
            continue
        ends = {peer for name, peer in topic.connections if name == publisher}
        missing = [name for name in topic.subscribers if name not in ends]
        missing_all.update(missing)
        if not missing:
            done += 1
            continue
        have = len(topic.subscribers) - len(missing)
        told = [f"{name} (down: {graph.nodes[name].error})" if _down(graph, name) else name for name in missing]
        reasons.append(f"{have} of {count(len(topic.subscribers), 'subscriber')} connected to {publisher}: "
                       f"missing {listed(told)}")  # fmt: skip
    if reasons:
        return WAIT, "; ".join(reasons), sorted(missing_all)
    return PASS, f"{count(len(topic.subscribers), 'subscriber')} connected to {count(done, 'publisher')}", []


def _down(graph: Graph, name: str) -> bool:
    node = graph.nodes.get(name)
    return node is not None and node.asked and not node.reachable


def check_topic(graph: Graph, wanted: TopicCondition) -> Check:
    topic = graph.topics.get(wanted.name)
    if topic is None:
        return Check("topic", wanted.name, WAIT, "nobody has registered it with the master")
    parts: list[tuple[str, str]] = []
    observed: dict[str, Any] = {
        "type": topic.type,
        "publishers": list(topic.publishers),
        "subscribers": list(topic.subscribers),
    }
    if wanted.type:
        parts.append(_check_type(graph, topic, wanted.type))
    least = wanted.publishers
    if least is None and wanted.subscribers is None and not wanted.connected:
        least = 1
    if least is not None:
        parts.append(_check_number(graph, "publisher", topic.publishers, least))
    if wanted.subscribers is not None:
        parts.append(_check_number(graph, "subscriber", topic.subscribers, wanted.subscribers))
    if wanted.connected:
        verdict, reason, missing = _check_connected(graph, topic)
        parts.append((verdict, reason))
        observed["missing"] = missing
        observed["connections"] = len(topic.connections)
    verdict = overall([part[0] for part in parts])
    # what is wrong says the most; what is right is told only when nothing is wrong
    reasons = [reason for part, reason in parts if part != PASS or verdict == PASS]
    return Check("topic", wanted.name, verdict, "; ".join(reasons), observed)


def check_rate(name: str, least: float, rate: Rate | None) -> Check:
    if rate is None:
        return Check("rate", name, WAIT, f"not measured: at least {least:g} Hz is looked at once all else passes")
    observed = {"rate": round(rate.hz, 3), "messages": rate.messages, "seconds": round(rate.seconds, 3)}
    if rate.error:
        return Check("rate", name, WAIT, f"not measured: {rate.error}", observed)
    seen = f"{rate.hz:.1f} Hz ({count(rate.messages, 'message')} in {rate.seconds:.1f} s)"
    if rate.hz >= least * (1 - RATE_TOLERANCE):
        return Check("rate", name, PASS, f"{seen}, at least {least:g} Hz", observed)
    return Check("rate", name, WAIT, f"{seen} of at least {least:g} Hz", observed)


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


def evaluate(graph: Graph, conditions: Conditions, rates: Mapping[str, Rate] | None = None) -> list[Check]:
    """One check per condition, in the order of the options; a topic's rate is a check of its own."""
    checks = [check_node(graph, name) for name in conditions.nodes]
    for topic in conditions.topics:
        checks.append(check_topic(graph, topic))
        if topic.min_rate:
            checks.append(check_rate(topic.name, topic.min_rate, (rates or {}).get(topic.name)))
    checks += [check_service(graph, name) for name in conditions.services]
    checks += [check_action(graph, action) for action in conditions.actions]
    return checks + [check_absent(graph, name) for name in conditions.absent]


def without_master(uri: str, why: str, conditions: Conditions) -> list[Check]:
    """The checks when there is no master to ask: itself, and every condition as not known."""
    unknown = "not known without the master"
    names = [
        *(("node", name) for name in conditions.nodes),
        *(("topic", topic.name) for topic in conditions.topics),
        *(("rate", topic.name) for topic in conditions.topics if topic.min_rate),
        *(("service", name) for name in conditions.services),
        *(("action", action.name) for action in conditions.actions),
        *(("absent", name) for name in conditions.absent),
    ]
    return [Check("master", uri, WAIT, why), *(Check(kind, name, WAIT, unknown) for kind, name in names)]


# ---- one look


class Ros(Protocol):
    """What a look needs of a ROS backend. `_ros_master.RosMaster` is the one for ROS 1."""

    uri: str

    def state(self, types: bool = False) -> MasterState: ...

    def ask(self, state: MasterState, wanted: Questions) -> Graph: ...

    def rates(self, graph: Graph, seconds: Mapping[str, float]) -> dict[str, Rate]: ...


@dataclass(frozen=True)
class Look:
    verdict: str
    checks: list[Check]

    @property
    def unmet(self) -> list[Check]:
        return [check for check in self.checks if check.verdict != PASS]


def look(ros: Ros, conditions: Conditions) -> Look:
    """Ask once and judge. Rates are measured only when all else passes: that takes a window, the rest does not."""
    try:
        state = ros.state(types=any(topic.type for topic in conditions.topics))
        graph = ros.ask(state, questions(state, conditions))
    except RosError as error:
        checks = without_master(ros.uri, str(error), conditions)
        return Look(overall([check.verdict for check in checks]), checks)
    checks = [Check("master", ros.uri, PASS, "answers"), *evaluate(graph, conditions)]
    rated = {topic.name: topic.min_rate for topic in conditions.topics if topic.min_rate}
    if rated and all(check.verdict == PASS for check in checks if check.kind != "rate"):
        rates = ros.rates(graph, {name: sample_seconds(least) for name, least in rated.items()})
        checks = [checks[0], *evaluate(graph, conditions, rates)]
    return Look(overall([check.verdict for check in checks]), checks)
