# SPDX-License-Identifier: GPL-3.0-or-later
"""The startup probe: look until the pod's own nodes are wholly in the graph, and say why not where they are not.

Kubernetes stops the old pod once this has passed, so it is what an update's losses depend on.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Callable, Collection, Iterable, Mapping, Sequence

from .._common.errors import RosError
from .._common.poll import FAIL, PASS, WAIT, Polled, Seen, overall, poll
from .._ros.backend import Backend, MasterState, Questions
from .._ros.checks import Check, check_rate
from .._ros.client import Ros1Client
from .._ros.conditions import Conditions, EdgeCondition
from .._ros.contract import Contract, Intended, record
from .._ros.gate import Silence, rate_plan
from .._ros.graph import Graph, Node, host_of
from .._ros.keeper_client import FORGETFUL, KeeperCalls
from .._ros.names import by_pod, by_revision, is_tool, is_version, stem
from .._ros.roslaunch import Child, children, crash
from .._step.record import Record, record_of
from .._step.words import CONTRACT, HOPELESS
from .judge import UNCOUNTED, check_sums, first_questions, gaps, is_forgiven, judge, rated
from .launch import MANAGER, named
from .own_node import is_here, names_here, places, service_uris
from .state import CALLER, Settings, State, load_settings, load_state, ros_of, save_state

HERE = Path(__file__).parent
SECONDS = 10.0  # of looking in one call, before a reason is given
INTERVAL, SLOW_INTERVAL = 0.1, 0.5  # slow once a call has ended in vain: then nobody waits for a tenth of a second
CHILDREN_INTERVAL = 1.0
MISSED = 2.0  # s without a connection, after which a subscriber is told of its publishers once more
SETTLE = 0.5  # without a contract or a command nothing says what the node is still going to register
SETTLE_LAUNCH = 3.0  # nodes of a launch file start one after the other
COMMAND_TIMEOUT = 5.0
OUTPUT = 4096  # bytes of the command's, of which the last line is told
PAUSE = 0.01  # s between two looks whether it has ended


def main(_words: list[str]) -> int:
    settings = load_settings(os.environ)
    before = load_state(settings.node)
    ros = ros_of(os.environ)
    here, there = partial(names_here, ros, settings), partial(places, ros, settings)
    told = partial(children, ros), partial(introduce, ros), partial(load_owed, settings)
    outside = Outside(run_command, here, is_here, there, *told, save_state)
    if settings.keeper:
        keeper = KeeperCalls(settings.keeper, CALLER)
        outside = replace(outside, is_whole=lambda since: keeper.is_whole(time.monotonic() - since))
    reason = started(settings, before, ros, outside)
    if reason:
        save_state(settings.node, State(failed=True))
        sys.stdout.write(f"{reason}\n")
    return 1 if reason else 0


def introduce(ros: Ros1Client, subscribers: Mapping[EdgeCondition, Node]) -> None:
    """Tell the subscriber of each gap who publishes its topic."""
    # hardly a call needs them, and the kubelet makes one every second as long as a pod starts
    from .._ros.registrar import Registrar  # noqa: PLC0415
    from .._ros.registrations import SUBSCRIBER, Call  # noqa: PLC0415

    calls = [Call(SUBSCRIBER, node.name, gap.topic, "", node.uri) for gap, node in subscribers.items()]
    Registrar(ros.uri, ros.timeout, ros.caller).introduce(calls)


@dataclass(frozen=True)
class Outside:
    """What a look needs beside the graph: the app's command, which nodes are this pod's, what it owes, and the clocks.

    A pod looks at itself, or the robot's resident process looks at it (`_robot/readiness.py`).
    """

    run: Callable[[list[str], float], str]  # why it failed
    here: Callable[[MasterState], Mapping[str, str]]  # name -> address
    is_here: Callable[[str], bool]  # whether the address is one of this pod
    places: Callable[[MasterState], Mapping[str, str]]  # the same of all nodes that may be the app's
    children: Callable[[Collection[str]], Iterable[Child]]  # what roslaunch at these addresses started
    introduce: Callable[[Mapping[EdgeCondition, Node]], None]  # tell the subscriber of each gap who publishes its topic
    owed: Callable[[], Owed]
    keep: Callable[[str, State], object]  # where the node is, once it is found
    # the graph with what these nodes of versions before send, for whoever has the time to listen
    measured: Callable[[Graph, Sequence[str]], Graph] = lambda graph, _nodes: graph
    now: Callable[[], float] = time.monotonic
    sleep: Callable[[float], None] = time.sleep
    # whether the master had, at that time by `now`, been given back what the one before had
    is_whole: Callable[[float], bool] = lambda _since: True
    # whether the app's own word, which somebody else asks for, is there; a contract says without it what is to come
    agreed: Callable[[], bool] = lambda: True


def started(settings: Settings, before: State, ros: Backend, outside: Outside) -> str:
    """Why the app is not ready, beginning with how bad that is; or nothing. `before`: what the last call left."""
    look = Starting(settings, ros, outside)

    def probe() -> Seen:
        checks = look()
        verdict = overall([check.verdict for check in checks])
        # what cannot be mended is told at once, but not once a second for ever
        return Seen(WAIT if verdict == FAIL and before.failed else verdict, checks)

    pause = SLOW_INTERVAL if before.failed else INTERVAL
    ended: Polled = poll(probe, SECONDS, pause, now=outside.now, sleep=outside.sleep)
    return "" if ended.verdict == PASS else message(ended.last)


@dataclass(frozen=True)
class Owed:
    """What a step of an update says that this version owes. `other`: the revision that it has on trial instead.

    `ignore`: what may be missing, whoever brings a version.
    """

    contract: Contract | None = None
    other: str = ""
    ignore: tuple[str, ...] = ()


def load_owed(settings: Settings, directory: Path = HERE) -> Owed:
    """By the file that a step writes beside the pod."""
    try:
        found = record_of({"data": {CONTRACT: (directory / CONTRACT).read_text("utf-8")}})
    except (OSError, ValueError):
        return Owed()
    return owed_by(found, settings.revision)


def owed_by(found: Record, revision: str) -> Owed:
    """By a step's record, for a pod of that revision.

    It counts until its version is proven. No clock ends it: a version that nobody proved is no better for waiting.
    """
    # from when it is judged on the keeper looks at it
    if found.proven or found.soak or not found.contract.nodes:
        return Owed(ignore=found.ignore)
    mine = found.revision == revision
    return Owed(found.contract if mine else None, "" if mine else found.revision, found.ignore)


def message(checks: list[Check]) -> str:
    """One line; the same as long as nothing changes, so that Kubernetes counts an event instead of making new ones."""
    worst = overall([check.verdict for check in checks])
    how = HOPELESS if worst == FAIL else "not ready: "
    return how + "; ".join(str(check) for check in checks if check.verdict == worst)


class Starting:
    """One look after the other, and what has to be remembered between them."""

    def __init__(self, settings: Settings, ros: Backend, outside: Outside) -> None:
        self.settings, self.ros, self.outside, self.now = settings, ros, outside, outside.now
        self.unregistered = False  # by the last look: the master answers, and knows none of the own nodes
        self.registered: Any = None
        self.since = 0.0
        self.missing: dict[EdgeCondition, float] = {}  # since when
        self.introduced: set[EdgeCondition] = set()
        self.silence = Silence(self.now)
        self.fallen: list[Check] = []  # as it was at this moment
        self.fallen_at: float | None = None

    def __call__(self) -> list[Check]:
        self.unregistered = False
        # first the command: what the app registered before it agreed is in the graph that is looked at then
        command, agreed = self.settings.command, self.outside.agreed()
        reason = self.outside.run(command, COMMAND_TIMEOUT) if command else ""
        checks = [Check("command", "readiness", WAIT, reason)] if reason else []
        # read at every look: an update's contract may come to the pod after it has started
        owed = self.outside.owed()
        if not (self.settings.expect_node or self.settings.launch or owed.contract):
            return checks
        began = self.now()
        try:
            checks = [*self._graph(owed, agreed, not checks), *checks]
        except RosError as error:
            return [Check("master", self.ros.uri, WAIT, str(error)), *checks]
        # a peer that a master begun anew does not know yet is no peer that has gone
        if overall([check.verdict for check in checks]) == PASS and not self.outside.is_whole(began):
            return [Check("master", self.ros.uri, WAIT, FORGETFUL)]
        return checks

    def _graph(self, owed: Owed, agreed: bool, whole: bool) -> list[Check]:
        state = self.ros.state(types=True)
        ended = self._ended(state)
        if overall([check.verdict for check in ended]) == FAIL:  # all else only follows from it
            return ended
        found, lacking = self._own(state)
        self.unregistered = not found
        if lacking:
            return lacking
        contract = self._contract(state, found, owed)
        began = self.now()
        graph = self.ros.ask(state, first_questions(state, found))
        own = [graph.node(name) for name in found]
        for node in own:
            if node.reachable and not self.outside.is_here(node.uri):
                return [Check("node", node.name, WAIT, f"registered from {node.uri}, which is not this pod")]
        graph = self.silence.noted(self._peers(state, graph, found), began)
        self.missing = {gap: self.missing.get(gap, self.now()) for gap in gaps(graph, found)}
        self._introduce(graph)
        awaited = [gap for gap, since in self.missing.items() if not is_forgiven(gap, contract, self.now() - since)]
        checks = judge(graph, found, contract, awaited)
        checks += self._settled(own) if not (owed.contract or self.settings.command) else []
        checks += [] if agreed or contract else [Check("command", "readiness", WAIT, "it has not passed yet")]
        if whole and all(check.verdict == PASS for check in checks):
            checks += [*self._streams(graph, own, contract), *self._ended(state, now=True)]
            if self.settings.expect_node and all(check.verdict == PASS for check in checks):
                uris = service_uris(graph.services, own[0].services)
                self.outside.keep(own[0].name, State(own[0].uri, own[0].pid, uris))
        return checks

    def _own(self, state: MasterState) -> tuple[tuple[str, ...], list[Check]]:
        """The own nodes, or what is waited for: the one of the app's name, or all that its launch file started."""
        if self.settings.expect_node:
            node = self.settings.node
            if node in state.nodes():
                return (node,), []
            return (), [Check("node", node, WAIT, "not registered with the master")]
        found = tuple(name for name in sorted(self.outside.here(state)) if not is_tool(name))
        if not found:
            return (), [Check("node", self.settings.app, WAIT, "none is registered from this pod's address")]
        return found, self._misplaced(state, found)

    def _contract(self, state: MasterState, own: Sequence[str], owed: Owed) -> Contract | None:
        """What the own nodes owe, by the names that nodes have in their pods.

        Without a step somebody else has brought this version (`kubectl rollout restart`), and it owes what the pods
        have now that it is to replace.
        """
        if owed.contract:
            # others of the same step may have come by now, and be called by their pods, too
            now = {name: nodes[-1] for name, nodes in by_pod((*state.nodes(), *own)).items()}
            return owed.contract.renamed(now)
        before = {} if self.settings.on_demand else self._before(state, own, owed.other)
        if not before:
            return None
        wanted = first_questions(state, before)
        heard = [name for node in before for topic in state.graph.node(node).publications if topic not in UNCOUNTED
                 for name in state.subscribers.get(topic, ()) if not is_tool(name)]  # fmt: skip
        wanted = replace(wanted, nodes={**dict.fromkeys(heard, frozenset()), **wanted.nodes})
        graph = self.outside.measured(self.ros.ask(state, wanted), [*before])
        found = record(graph, [*before], before, Intended(owed.ignore))
        return found if found.nodes else None

    def _before(self, state: MasterState, own: Sequence[str], other: str) -> dict[str, str]:
        """Nodes of other versions of the app, where versions overlap: what each is called in this one.

        Without those of a revision that is on trial: this pod is older, and was only started once more. And without
        those of which there must not be two: they begin when the others have ended.
        """
        suffix = f"_{self.settings.version}"
        bases = [node[: -len(suffix)] for node in own if node.endswith(suffix)]
        found = [node for node in state.nodes() if node not in own and any(is_version(node, base) for base in bases)]
        found = [node for node in found if not (other and by_revision(node).endswith(f"_{other}"))]
        if found and self.settings.launch:  # and what else they have started
            places = self.outside.places(state)
            hosts = {host_of(places.get(node, "")) for node in found} - {""}
            found = [node for node, uri in places.items() if host_of(uri) in hosts and not is_tool(node)]
        plain = {node: stem(node) for node in found}
        held = {one for word in self.settings.held for one in named(word, plain.values())}
        return {node: base + suffix for node, base in plain.items() if base not in held}

    def _misplaced(self, state: MasterState, own: Iterable[str]) -> list[Check]:
        """Private names of this version alone: the launcher is about to give them the place that others know."""
        suffix = f"_{self.settings.version}"
        words = "is private to this version, and has to move to the name that others know"
        renamed = [node for node in own if node.endswith(suffix) and self.settings.launch == "overlap"]
        kept = {f"{node}/{word}" for node in renamed for word in MANAGER}
        loose = sorted({*state.publishers, *state.subscribers, *state.services} - kept)
        private = tuple(f"{node}/" for node in renamed)
        return [Check("topic", name, WAIT, words) for name in loose if name.startswith(private)]

    def _ended(self, state: MasterState, now: bool = False) -> list[Check]:
        """Processes of the launch file that ended by an error, and are not up again: roslaunch goes on without them.

        One that it does not start again is the end of this version. They are asked for `now`, or once a second.
        """
        # with the host's network the address is others', too
        alone = self.settings.launch and not self.settings.host_network
        due = now or self.fallen_at is None or self.now() - self.fallen_at >= CHILDREN_INTERVAL
        if alone and due:
            hosts = {host_of(uri) for uri in self.outside.here(state).values()}
            ended = [child for child in self.outside.children(hosts) if not child.alive] if hosts else []
            lasting = FAIL, ", and is not started again (no respawn in the launch file)"
            words = ((child, crash(child), *((WAIT, "") if child.respawn else lasting)) for child in ended)
            self.fallen = [Check("node", child.node, how, said + more) for child, said, how, more in words if said]
            self.fallen_at = self.now()
        return self.fallen

    def _peers(self, state: MasterState, graph: Graph, own: Sequence[str]) -> Graph:
        """The graph with the answers of those that the own nodes are not connected to."""
        ends = {end for gap in gaps(graph, own) for end in (gap.publisher, gap.subscriber)}
        unasked = {name for name in ends if not graph.node(name).asked}
        if not unasked:
            return graph
        answers = self.ros.ask(state, Questions({name: frozenset() for name in unasked}))
        return graph.answered(map(answers.node, unasked))

    def _introduce(self, graph: Graph) -> None:
        """Tell subscribers that are still not connected who publishes their topic, as the master did; once in a call.

        Who subscribes at the very moment in which a publisher comes may never connect: rospy takes the list of
        publishers from the master's answer for newer than the one that the master sent meanwhile.
        """
        late = [gap for gap, since in self.missing.items() if self.now() - since >= MISSED]
        nodes = {gap: graph.node(gap.subscriber) for gap in late if gap not in self.introduced}
        due = {gap: node for gap, node in nodes.items() if node.reachable}
        self.introduced.update(due)
        if due:
            self.outside.introduce(due)

    def _settled(self, own: Iterable[Node]) -> list[Check]:
        registered = [(node.name, node.publications, node.subscriptions, node.services) for node in own]
        if registered != self.registered:
            self.registered, self.since = registered, self.now()
        settled = self.now() - self.since >= (SETTLE_LAUNCH if self.settings.launch else SETTLE)
        return [] if settled else [Check("node", registered[0][0], WAIT, "it has only just registered what it has")]

    def _streams(self, graph: Graph, own: Sequence[Node], contract: Contract | None) -> list[Check]:
        """What the nodes say of their topics, and their rates, as these nodes alone publish them."""
        mine = {topic: [node.name for node in own if topic in node.publications] for topic in graph.topics}
        alone = graph.published_by(mine)
        promised = [name for name in (contract.topics if contract else ()) if mine.get(name)]
        checks = check_sums(graph, contract, self.ros.handshakes(alone, promised) if promised else {})
        rates = rated(own, contract, self.settings.min_rates)
        if rates and all(check.verdict == PASS for check in checks):
            counted = self.ros.rates(alone, rate_plan(Conditions(topics=tuple(rates)))[0])
            checks += [check_rate(one, counted.get(one.name)) for one in rates]
        return checks


# ---- the app's command


def run_command(command: list[str], seconds: float) -> str:
    """Why an app's readiness command did not end with status 0, or nothing if it did.

    What it leaves behind may keep its output open, so the end of that is not waited for.
    """
    # as long to import as most of these commands last, and most apps have none
    from subprocess import PIPE, STDOUT, Popen  # noqa: PLC0415

    try:
        # there is no AnsibleModule in a pod, whose run_command would be called
        # pylint: disable-next=ansible-bad-function
        child = Popen(command, stdout=PIPE, stderr=STDOUT, bufsize=0, start_new_session=True)  # noqa: S603 - the app's
    except OSError as error:
        return f"readiness.command cannot be run: {command[0]}: {error.strerror}"
    said, end, over = b"", time.monotonic() + seconds, False
    with child.stdout as output:  # type: ignore[union-attr] # it is a pipe
        os.set_blocking(output.fileno(), False)
        while not over:
            time.sleep(PAUSE)
            over = child.poll() is not None
            said = (said + (output.read(1 << 16) or b""))[-OUTPUT:]
            if not over and time.monotonic() > end:
                os.killpg(child.pid, signal.SIGKILL)
                child.wait()
                return f"readiness.command did not end within {seconds:g} s"
    status = child.returncode
    if status == 0:
        return ""
    lines = said.decode("utf-8", "replace").strip().splitlines()
    how = f"exited with {status}" if status > 0 else f"was ended by signal {abs(status)}"
    return f"readiness.command {how}" + (f": {lines[-1][:200]}" if lines else "")
