# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The startup probe: look until the pod's own node is wholly in the graph, and say why not where it is not.

Kubernetes stops the old pod once this has passed, so it is what an update's losses depend on.
"""

from __future__ import annotations

import os
import sys
import time
from dataclasses import replace
from typing import Any, Callable, Mapping

from .._common.errors import RosError
from .._common.poll import FAIL, PASS, WAIT, Polled, Seen, overall, poll
from .._ros.backend import Backend
from .._ros.checks import Check
from .._ros.gate import rate_window
from .._ros.graph import Graph, MasterState, Node, Questions
from .._ros.silence import Silence
from .command import run_command
from .judge import Gap, Wanted, check_rates, check_sums, first_questions, forgiven, gaps, judge, least_rates
from .own_node import is_here, ros_of, service_uris, state_of
from .state import load_contract, load_settings, load_state, save_state

SECONDS = 10.0  # of looking in one call, before a reason is given
INTERVAL, SLOW_INTERVAL = 0.1, 0.5  # slow once a call has ended in vain: then nobody waits for a tenth of a second
SETTLE = 0.5  # without a contract or a command nothing says what the node is still going to register
COMMAND_TIMEOUT = 5.0


def main(_words: list[str]) -> int:
    settings = load_settings(os.environ)
    before = load_state(settings["node"])
    reason = started(settings, before, ros_of(os.environ), run_command)
    if reason:
        save_state(settings["node"], {"failed": reason})
        sys.stdout.write(f"{reason}\n")
    return 1 if reason else 0


def started(  # noqa: PLR0913 - the clocks are the price of tests that never wait
    settings: Mapping[str, Any],
    before: Mapping[str, Any],
    ros: Backend,
    run: Callable[[list[str], float], str],
    now: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> str:
    """Why the app is not ready, beginning with how bad that is; or nothing. `before`: what the last call left."""
    look = Starting(settings, ros, run, now)
    patient = bool(before.get("failed"))

    def probe() -> Seen:
        checks = look()
        verdict = overall([check.verdict for check in checks])
        # what cannot be mended is told at once, but not once a second for ever
        return Seen(WAIT if verdict == FAIL and patient else verdict, checks)

    ended: Polled = poll(probe, SECONDS, SLOW_INTERVAL if patient else INTERVAL, now=now, sleep=sleep)
    return "" if ended.verdict == PASS else message(ended.last)


def message(checks: list[Check]) -> str:
    """One line; the same as long as nothing changes, so that Kubernetes counts an event instead of making new ones."""
    worst = overall([check.verdict for check in checks])
    how = "cannot become ready" if worst == FAIL else "not ready"
    return f"{how}: " + "; ".join(str(check) for check in checks if check.verdict == worst)


class Starting:
    """One look after the other, and what has to be remembered between them."""

    def __init__(
        self,
        settings: Mapping[str, Any],
        ros: Backend,
        run: Callable[[list[str], float], str],
        now: Callable[[], float],
    ) -> None:
        self.settings, self.ros, self.run, self.now = settings, ros, run, now
        self.registered: Any = None
        self.since = 0.0
        self.missing: dict[Gap, float] = {}  # since when
        self.silence = Silence(now)

    def __call__(self) -> list[Check]:
        # first the command: what the app registered before it agreed is in the graph that is looked at then
        command = self.settings["command"]
        reason = self.run(command, COMMAND_TIMEOUT) if command else ""
        checks = [Check("command", "readiness", WAIT, reason)] if reason else []
        if not self.settings["expect_node"]:
            return checks
        try:
            return [*self._graph(not checks), *checks]
        except RosError as error:
            return [Check("master", self.ros.uri, WAIT, str(error)), *checks]

    def _graph(self, whole: bool) -> list[Check]:
        node = self.settings["node"]
        state = self.ros.state(types=True)
        if node not in state.nodes():
            return [Check("node", node, WAIT, "not registered with the master")]
        # read at every look: an update's contract may come to the pod after it has started
        wanted = Wanted(node, load_contract(os.environ), self.settings["min_rates"])
        began = self.now()
        graph = self.ros.ask(state, first_questions(state, node))
        own = graph.nodes[node]
        if own.reachable and not is_here(own.uri):
            return [Check("node", node, WAIT, f"registered from {own.uri}, which is not this pod")]
        graph = self.silence.noted(self._peers(state, graph, node), began)
        checks = judge(graph, state, wanted, self._forgiving(state, graph, wanted))
        checks += self._settled(own) if not (wanted.contract or self.settings["command"]) else []
        if whole and all(check.verdict == PASS for check in checks):
            checks += self._streams(graph, own, wanted)
            if all(check.verdict == PASS for check in checks):
                save_state(node, state_of(own, service_uris(graph.services, own.services)))
        return checks

    def _peers(self, state: MasterState, graph: Graph, node: str) -> Graph:
        """The graph with the answers of those that the own node is not connected to."""
        unasked = {gap.peer for gap in gaps(state, graph, node) if not graph.nodes[gap.peer].asked}
        if not unasked:
            return graph
        answers = self.ros.ask(state, Questions({name: frozenset() for name in unasked})).nodes
        return replace(graph, nodes={**graph.nodes, **{name: answers[name] for name in unasked}})

    def _forgiving(self, state: MasterState, graph: Graph, wanted: Wanted) -> Mapping[Gap, str]:
        """The connections that are not there and are not waited for, each with the reason."""
        self.missing = {gap: self.missing.get(gap, self.now()) for gap in gaps(state, graph, wanted.node)}
        return {gap: forgiven(gap, graph, wanted, self.now() - since) for gap, since in self.missing.items()}

    def _settled(self, own: Node) -> list[Check]:
        registered = (own.publications, own.subscriptions, own.services)
        if registered != self.registered:
            self.registered, self.since = registered, self.now()
        if self.now() - self.since < SETTLE:
            return [Check("node", own.name, WAIT, "it has only just registered what it has")]
        return []

    def _streams(self, graph: Graph, own: Node, wanted: Wanted) -> list[Check]:
        """What the node says of its topics, and their rates, as this node alone publishes them."""
        topics = {name: replace(topic, publishers=(own.name,)) for name, topic in graph.topics.items()}
        alone = replace(graph, topics=topics)
        promised = [name for name in (wanted.contract or {}).get("topics", ()) if name in own.publications]
        checks = check_sums(graph, wanted.contract, self.ros.handshakes(alone, promised) if promised else {})
        least = least_rates(own, wanted)
        if least and not checks:
            seconds = {name: rate_window(hz) for name, hz in least.items()}
            checks += check_rates(least, own.name, self.ros.rates(alone, seconds))
        return checks
