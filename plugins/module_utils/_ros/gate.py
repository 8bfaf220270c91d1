# SPDX-License-Identifier: GPL-3.0-or-later
"""The gate: conditions on the ROS graph, and one check with a verdict and a reason for each.

Pure but for `look`, which asks the `Backend` that is handed in. `checks` says which verdict is for what.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Callable, Iterable, List, Mapping, Optional, Tuple

from .._common.errors import RosError
from .._common.poll import PASS, WAIT, overall
from .backend import Backend, MasterState, Questions
from .checks import (
    Check,
    check_absent,
    check_action,
    check_edge,
    check_latched,
    check_node,
    check_rate,
    check_service,
    check_topic,
)
from .conditions import Conditions
from .graph import Graph, Handshake, Rate
from .names import by_pod

# Gate and startup probe count for the same time, so that what one of them lets pass is no surprise to the other. In a
# second, a publisher that is 10 ms late is within checks.RATE_TOLERANCE; a slow one needs longer.
RATE_WINDOW, RATE_WINDOW_MAX = 1.0, 20.0
_STREAMED = ("rate", "latched")  # kinds of checks for which streams are opened
RATE_MESSAGES = 4  # one before the first interval, and three intervals


def questions(state: MasterState, conditions: Conditions) -> Questions:
    """What has to be asked of whom to judge these conditions, and no more."""
    nodes: dict[str, set[str]] = {}
    registered = set(state.nodes())

    def ask(names: Iterable[str], *calls: str) -> None:
        for name in names:
            if name in registered:
                nodes.setdefault(name, set()).update(calls)

    ask((*conditions.nodes, *conditions.absent))
    for topic in conditions.topics:
        publishers, subscribers = state.publishers.get(topic.name, ()), state.subscribers.get(topic.name, ())
        types = ("types",) if topic.type else ()
        if topic.publisher:
            ask([topic.publisher], *types, *(("bus",) if topic.connected else ()))
            ask(publishers if topic.publishers is not None else ())
            ask(subscribers if topic.connected or topic.subscribers is not None else ())
        else:
            ask((*publishers, *subscribers), *types)
            ask(publishers if topic.connected else (), "bus")
    for edge in conditions.edges:
        ask([edge.publisher], "bus")
        ask([edge.subscriber])
    return Questions(
        {name: frozenset(calls) for name, calls in nodes.items()},
        tuple(dict.fromkeys(name for name in conditions.services if name in state.services)),
        tuple(dict.fromkeys(action.name for action in conditions.actions)),
    )


def as_registered(ros: Backend, state: MasterState, conditions: Conditions) -> Conditions:
    """The conditions with the names that the nodes of revisions have now, each in its pod.

    While one pod of a revision takes another's place there are two, of which one that lives is meant. What is to be
    absent is so in all pods.
    """
    pods = by_pod(state.nodes())
    several = [name for names in pods.values() for name in names if len(names) > 1]
    graph = ros.ask(state, Questions(dict.fromkeys(several, frozenset()))) if several else state.graph
    now = {name: max(names, key=lambda one: graph.node(one).reachable) for name, names in pods.items()}
    absent = tuple(one for name in conditions.absent for one in pods.get(name, [name]))
    return replace(conditions.renamed(now), absent=absent)


def rate_window(min_rate: float) -> float:
    """Seconds to count messages for, to judge this rate."""
    return min(max(RATE_WINDOW, RATE_MESSAGES / min_rate), RATE_WINDOW_MAX)


Said = Mapping[Tuple[str, Optional[str]], Handshake]  # by topic and the publisher that is asked for
Ears = Callable[[Graph], List[Check]]  # one check per value that messages have to say: `listener.Listener.checks`


def evaluate(
    graph: Graph,
    conditions: Conditions,
    rates: Mapping[str, Rate] | None = None,
    said: Said | None = None,
    ears: Ears | None = None,
) -> list[Check]:
    """One check per condition, in the order of the options; a topic's rate and its latching are checks of their own."""
    checks = [check_node(graph, name) for name in conditions.nodes]
    for topic in conditions.topics:
        checks.append(check_topic(graph, topic))
        if topic.min_rate:
            checks.append(check_rate(topic, (rates or {}).get(topic.name)))
        if topic.latched:
            checks.append(check_latched(topic, (said or {}).get((topic.name, topic.publisher))))
    checks += [check_service(graph, name) for name in conditions.services]
    checks += [check_action(graph, action) for action in conditions.actions]
    checks += [check_edge(graph, edge) for edge in conditions.edges]
    checks += [check_absent(graph, name) for name in conditions.absent]
    silent = (Check("value", str(value), WAIT, "nobody listens to it") for value in conditions.values)
    return [*checks, *(ears(graph) if ears else silent)]


# ---- one look


class Silence:
    """Since when each node has not answered, from look to look: one late answer takes nobody out of the graph.

    Any answer ends that, and so does a look that had nothing to ask of it. Startup probe and gate both look through it,
    so that a peer counts as gone for both after the same time.
    """

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self.now = now
        self.since: dict[str, float] = {}

    def noted(self, graph: Graph, began: float) -> Graph:
        """The graph, of which each node knows for how long it has been silent. `began`: when they were asked."""
        silent = [node for node in graph.nodes.values() if node.asked and not node.reachable]
        self.since = {node.name: self.since.get(node.name, began) for node in silent}
        ended = self.now()
        nodes = {node.key: replace(node, silent=ended - self.since[node.name]) for node in silent}
        return replace(graph, nodes={**graph.nodes, **nodes}) if nodes else graph


@dataclass(frozen=True)
class Look:
    verdict: str
    checks: list[Check]

    @property
    def unmet(self) -> list[Check]:
        return [check for check in self.checks if check.verdict != PASS]


def rate_plan(conditions: Conditions) -> tuple[dict[str, float], dict[str, list[str]]]:
    """How long to count each topic's messages, and which nodes', where that is not everybody's."""
    seconds: dict[str, float] = {}
    whose: dict[str, list[str]] = {}
    for topic in conditions.topics:
        if topic.min_rate:
            seconds[topic.name] = max(seconds.get(topic.name, 0.0), rate_window(topic.min_rate))
            whose.setdefault(topic.name, []).append(topic.publisher or "")
    return seconds, {name: names for name, names in whose.items() if all(names)}


def handshakes(ros: Backend, graph: Graph, conditions: Conditions) -> Said:
    """What the publishers say of the topics that have to be latched."""
    found = {}
    for topic in conditions.topics:
        if topic.latched:
            alone = graph.published_by({topic.name: [topic.publisher]} if topic.publisher else {})
            said = ros.handshakes(alone, [topic.name])
            found.update({(name, topic.publisher): handshake for name, handshake in said.items()})
    return found


def look(ros: Backend, conditions: Conditions, silence: Silence | None = None, ears: Ears | None = None) -> Look:
    """Ask and judge. Streams are opened only when all else passes: to measure rates takes a window, the rest does not.

    After the window all else is asked again, so that what the look says was true at its beginning and at its end.
    `silence` is what the looks before found of peers that do not answer; a single look waits for each of them. `ears`
    hear what messages say, if any are asked for.
    """
    silence = silence or Silence()

    def seen(
        rates: Mapping[str, Rate] | None = None, said: Said | None = None
    ) -> tuple[Graph, Conditions, list[Check]]:
        state = ros.state(types=any(topic.type for topic in conditions.topics))
        wanted, began = as_registered(ros, state, conditions), silence.now()
        graph = silence.noted(ros.ask(state, questions(state, wanted)), began)
        checks = evaluate(graph, wanted, rates, said, ears)
        return graph, wanted, [Check("master", ros.uri, PASS, "answers"), *checks]

    try:
        graph, wanted, checks = seen()
        streamed = [check for check in checks if check.kind in _STREAMED]
        if streamed and all(check.verdict == PASS for check in checks if check not in streamed):
            seconds, only = rate_plan(wanted)
            rates = ros.rates(graph.published_by(only), seconds) if seconds else {}
            _graph, _wanted, checks = seen(rates, handshakes(ros, graph, wanted))
    except RosError as error:
        unknown = evaluate(Graph(), conditions)
        told = (Check(check.kind, check.name, WAIT, "not known without the master") for check in unknown)
        checks = [Check("master", ros.uri, WAIT, str(error)), *told]
    return Look(overall([check.verdict for check in checks]), checks)
