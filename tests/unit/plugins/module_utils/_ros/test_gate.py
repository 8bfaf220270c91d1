# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import FAIL, PASS, WAIT
from ansible_collections.rosops.fleet.plugins.module_utils._ros import gate as _gate
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import MasterState, Questions
from ansible_collections.rosops.fleet.plugins.module_utils._ros.checks import Check
from ansible_collections.rosops.fleet.plugins.module_utils._ros.conditions import (
    ActionCondition,
    Conditions,
    EdgeCondition,
    TopicCondition,
    ValueCondition,
)
from ansible_collections.rosops.fleet.plugins.module_utils._ros.gate import (
    Silence,
    evaluate,
    look,
    questions,
    rate_window,
)
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import (
    GOAL_STATES,
    PATIENCE,
    Graph,
    Handshake,
    Node,
    NodeKey,
    Rate,
    ServiceProbe,
    StatusReading,
    names_of,
)
from ansible_collections.rosops.fleet.plugins.module_utils._ros.replies import NodeAnswer, build
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import DEAD, recorded_answers, recorded_state

HUNG = NodeAnswer("http://h:1/", error="no answer from http://h:1/ within 2 s")
IDLE = StatusReading(((), (3, 4)))


def without(state: MasterState, node: str) -> MasterState:
    """The registrations of one node taken back."""

    def less(part: Mapping[str, tuple[str, ...]]) -> dict[str, tuple[str, ...]]:
        kept = {name: tuple(n for n in nodes if n != node) for name, nodes in part.items()}
        return {name: nodes for name, nodes in kept.items() if nodes}

    return replace(
        state, publishers=less(state.publishers), subscribers=less(state.subscribers), services=less(state.services)
    )


def graph(
    answers: Mapping[str, NodeAnswer] | None = None,
    probes: Mapping[str, ServiceProbe] | None = None,
    statuses: Mapping[str, Mapping[str, StatusReading]] | None = None,
    gone: str = "",
    **state: Any,
) -> Graph:
    """The recorded graph, with some answers, registrations or types replaced, or one node gone."""
    return build(
        replace(without(recorded_state(), gone), **state), {**recorded_answers(), **(answers or {})}, probes, statuses
    )


# ---- what is asked


def test_only_what_the_conditions_need_is_asked() -> None:
    state = recorded_state()
    assert questions(state, Conditions()) == Questions()
    wanted = questions(
        state,
        Conditions(
            nodes=("/relay", "/nobody"),
            topics=(TopicCondition("/chatter_relay", connected=True), TopicCondition("/work/goal", "a/B")),
            services=("/trigger", "/nothing"),
            actions=(ActionCondition("/work"), ActionCondition("/nothing")),
            absent=("/helper", "/gone"),
        ),
    )
    assert wanted.nodes == {
        "/relay": {"bus"},
        "/listener_relay": frozenset(),
        "/asker": {"types"},
        "/worker": {"types"},
        "/helper": frozenset(),
    }
    assert wanted.services == ("/trigger",)
    assert wanted.actions == ("/work", "/nothing")


def test_of_one_publishers_topic_only_that_one_and_its_subscribers_are_asked() -> None:
    state = recorded_state()

    def asked(**wanted: Any) -> Mapping[str, frozenset[str]]:
        return questions(state, Conditions(topics=(TopicCondition("/chatter", publisher="/talker_a", **wanted),))).nodes

    assert asked() == {"/talker_a": frozenset()}
    assert asked(type="a/B", min_rate=5.0) == {"/talker_a": {"types"}}
    listeners = {"/relay", "/listener_a", "/listener_b", DEAD}
    assert asked(connected=True) == {"/talker_a": {"bus"}, **dict.fromkeys(listeners, frozenset())}
    assert set(asked(publishers=2)) == {"/talker_a", "/talker_b"}


def test_of_an_edge_its_ends_are_asked_and_of_a_topic_that_nobody_registered_nobody() -> None:
    edges = (EdgeCondition("/talker_a", "/chatter", DEAD), EdgeCondition("/nobody", "/chatter", "/relay"))
    topics = (TopicCondition("/nothing", "a/B", connected=True), TopicCondition("/none", publisher="/x", publishers=1))
    wanted = questions(recorded_state(), Conditions(topics=topics, edges=edges))
    assert wanted.nodes == {"/talker_a": {"bus"}, DEAD: frozenset(), "/relay": frozenset()}


# ---- one condition on one graph


def on(**wanted: Any) -> Conditions:
    """On a topic."""
    return Conditions(topics=(TopicCondition(**{"name": "/chatter", **wanted}),))


def node(name: str) -> Conditions:
    return Conditions(nodes=(name,))


def absent(name: str) -> Conditions:
    return Conditions(absent=(name,))


def served(name: str) -> Conditions:
    return Conditions(services=(name,))


def action(state: str = "up", server: str = "", name: str = "/work") -> Conditions:
    return Conditions(actions=(ActionCondition(name, state, server),))


def edge(publisher: str, subscriber: str, peer: str = "", topic: str = "/chatter") -> Conditions:
    return Conditions(edges=(EdgeCondition(publisher, topic, subscriber, peer),))


def rows_without(node: str, *peers: str) -> dict[str, NodeAnswer]:
    """The recorded answer of a publisher that is not connected to these subscribers."""
    answer = recorded_answers()[node]
    return {node: replace(answer, bus=[row for row in answer.bus if row[1] not in peers])}


def silent(name: str) -> dict[str, NodeAnswer]:
    """One that does not know getBusInfo."""
    return {name: replace(recorded_answers()[name], bus=None)}


def long_silent(of: Graph) -> Graph:
    """The graph as it is told once nobody of these has answered in any look for long."""
    return Silence(lambda: PATIENCE).noted(of, 0.0)


def hung(*names: str, gone: str = DEAD) -> Graph:
    return graph(dict.fromkeys(names, HUNG), gone=gone)


def forgotten() -> Graph:
    """The graph in which nobody knows the dead node any more."""
    of = graph(gone=DEAD)
    return replace(of, nodes={key: node for key, node in of.nodes.items() if key.name != DEAD})


def probed(**probe: str) -> Graph:
    return graph(probes={"/trigger": ServiceProbe("rosrpc://h:1", **probe)})


def working(*readings: tuple[int, ...]) -> Graph:
    return graph(statuses={"/work": {"/worker": StatusReading(readings)}})


def two_servers(other: str, status: StatusReading) -> Graph:
    state, two = recorded_state(), (other, "/worker")
    return graph(
        statuses={"/work": {"/worker": IDLE, other: status}},
        publishers={**state.publishers, "/work/status": two},
        subscribers={**state.subscribers, "/work/goal": two, "/work/cancel": two},
    )


ALL, HEALTHY = graph(), graph(gone=DEAD)  # without the node that was killed
LATE, LOST = hung("/relay", gone=""), rows_without("/talker_a", "/listener_a")
LOST_AND_LATE = {**LOST, "/listener_a": HUNG}
OTHERS_LOST = graph(rows_without("/talker_b", "/listener_a"), gone=DEAD)
NO_ANSWER = "no answer from http://h:1/ within 2 s"
NOT_CONNECTED = [
    [*row[:5], 0, *row[6:]] if row[1] == "/listener_relay" else row for row in recorded_answers()["/relay"].bus
]
KEEPER = {"/ros_keeper": NodeAnswer("http://127.0.0.1:40009/", 9)}
KEPT = graph(KEEPER, publishers={"/chatter": ("/ros_keeper", "/talker_a")})
WRONG_TYPE = graph(
    {"/talker_b": replace(recorded_answers()["/talker_b"], publications=[["/chatter", "std_msgs/Int32"]])}
)
LISTENERS = ("/listener_a", "/listener_b", "/relay")
REMEMBERED = hung("/talker_a", "/talker_b", "/listener_a", "/listener_b")
TAKES_ANY = build(
    MasterState({}, {"/chatter": ("/relay",)}, {}, {"/chatter": "std_msgs/Int32"}),
    {"/relay": recorded_answers()["/relay"]},
)
NO_CANCEL = graph(statuses={"/work": {}}, subscribers={**recorded_state().subscribers, "/work/cancel": ()})
MUTE = StatusReading(error=NO_ANSWER)
LEFT = "passes unconnected, as its peer left: "


@pytest.mark.parametrize(
    ("of", "wanted", "verdict", "reason"),
    [
        (ALL, node("/talker_a"), PASS, "up, process * at http://*"),
        (ALL, node(DEAD), WAIT, "registered, but down: nothing listens at http://127.0.0.1:9/"),
        (ALL, node("/nobody"), WAIT, "not registered with the master"),
        (LATE, node("/relay"), WAIT, f"registered, but down: {NO_ANSWER}"),
        (ALL, absent("/nobody"), PASS, "gone from the graph"),
        (ALL, absent("/talker_a"), WAIT, "still registered, and answers"),
        (ALL, absent(DEAD), PASS, "gone, what is registered is stale: nothing listens at *"),
        (LATE, absent("/relay"), WAIT, f"still registered, and may only be late: {NO_ANSWER}"),
        (long_silent(LATE), absent("/relay"), PASS, f"gone, what is registered is stale: {NO_ANSWER}"),
        # by its name alone a topic needs a living publisher
        (HEALTHY, on(name="/nothing", publishers=0), WAIT, "nobody has registered it with the master"),
        (hung("/talker_a"), on(), PASS, f"1 publisher; registered, but down: /talker_a ({NO_ANSWER})"),
        (hung("/talker_a", "/talker_b"), on(), WAIT, "0 publishers of at least 1; *"),
        (HEALTHY, on(subscribers=0), PASS, "3 subscribers"),
        (HEALTHY, on(publishers=3, subscribers=4), WAIT, "2 publishers of at least 3; 3 subscribers of at least 4"),
        # what passes is not told beside what does not
        (HEALTHY, on(publishers=2, subscribers=4), WAIT, "3 subscribers of at least 4"),
        (ALL, on(subscribers=4), WAIT, f"3 subscribers of at least 4; registered, but down: {DEAD} (nothing *)"),
        # what the keeper gives, one had latched that was replaced: it says nothing of the next one
        (KEPT, on(publishers=2), WAIT, "1 publisher of at least 2"),
        (graph(KEEPER, publishers={"/chatter": ("/ros_keeper",)}), on(), WAIT, "0 publishers of at least 1"),
        (HEALTHY, on(type="std_msgs/String"), PASS, "type std_msgs/String; 2 publishers"),
        (HEALTHY, on(type="std_msgs/Int32"), FAIL, "the type is *std_msgs/String at /talker_a*, not std_msgs/Int32"),
        # the publisher that had it is gone; the one that is to come may have the right one
        (REMEMBERED, on(type="a/B", publishers=0), WAIT, "the type is std_msgs/String to the master, not a/B"),
        (REMEMBERED, on(type="std_msgs/String", publishers=0), PASS, "*type std_msgs/String*"),
        (TAKES_ANY, on(type="std_msgs/Int32", subscribers=1), PASS, "*type std_msgs/Int32*"),
        (graph(types={}), on(type="std_msgs/String"), PASS, "*type std_msgs/String*"),  # by the nodes' own word
        # connected is what every publisher says of every subscriber; the subscribers' own rows are worth nothing
        (HEALTHY, on(connected=True), PASS, "3 subscribers connected to 2 publishers"),
        (KEPT, on(connected=True), PASS, "*"),
        (HEALTHY, on(name="/chatter_relay", connected=True), PASS, "1 subscriber connected to 1 publisher"),  # roscpp's
        (graph(rows_without("/talker_b", "/listener_b"), gone=DEAD), on(connected=True), WAIT,
         "2 of 3 subscribers connected to /talker_b: missing /listener_b"),
        (graph({"/relay": replace(recorded_answers()["/relay"], bus=NOT_CONNECTED)}),
         on(name="/chatter_relay", connected=True), WAIT, "*: missing /listener_relay"),
        (long_silent(hung("/talker_b")), on(connected=True), PASS,
         "3 subscribers connected to 1 publisher; down, so not counted: /talker_b"),
        (long_silent(hung("/talker_a", "/talker_b")), on(connected=True), WAIT,
         "not connected: every publisher is registered, but down: /talker_a (no answer *"),
        (long_silent(hung(*LISTENERS)), on(connected=True), WAIT,
         "not connected: every subscriber is registered, but down: *"),
        # whoever is late once is counted
        (hung("/talker_b"), on(connected=True), WAIT, f"the connections of /talker_b are not known ({NO_ANSWER})"),
        (graph(LOST_AND_LATE, gone=DEAD), on(connected=True), WAIT, "* missing /listener_a"),
        (graph(silent("/talker_b"), gone=DEAD), on(connected=True), WAIT,
         "the connections of /talker_b are not known (it did not tell them)"),
        (ALL, on(connected=True), PASS, f"3 subscribers connected to 2 publishers; down, so not counted: {DEAD}"),
        (build(MasterState({}, {"/chatter": ("/listener_a",)}), recorded_answers()), on(connected=True), WAIT,
         "not connected: no publisher is registered"),
        # one publisher, whatever the others do
        (ALL, on(publisher="/relay", connected=True), WAIT, "/relay lives, but does not publish it"),
        (hung("/talker_a", gone=""), on(publisher="/talker_a", connected=True), WAIT,
         f"/talker_a is registered, but down: {NO_ANSWER}"),
        (hung("/talker_b", gone=""), on(publisher="/talker_a"), PASS, "published by /talker_a"),
        (OTHERS_LOST, on(connected=True, publisher="/talker_a"), PASS,
         "published by /talker_a; 3 subscribers connected to /talker_a"),
        (OTHERS_LOST, on(connected=True, publisher="/talker_b"), WAIT,
         "2 of 3 subscribers connected to /talker_b: missing /listener_a"),
        (long_silent(graph(LOST_AND_LATE)), on(connected=True, publisher="/talker_a"), PASS, "*"),
        (graph(subscribers={}), on(connected=True, publisher="/talker_a"), PASS, "*; 0 subscribers connected to *"),
        (graph(subscribers={}), on(connected=True), WAIT, "not connected: no subscriber is registered"),
        (graph(subscribers={}), on(connected=True, publisher="/talker_a", subscribers=1), WAIT,
         "0 subscribers of at least 1"),
        (WRONG_TYPE, on(type="std_msgs/String"), FAIL, "the type is std_msgs/Int32 at /talker_b, not std_msgs/String"),
        (WRONG_TYPE, on(type="std_msgs/String", publisher="/talker_a"), PASS, "*"),
        (ALL, served("/nothing"), WAIT, "not registered with the master"),
        (ALL, served("/trigger"), WAIT, "registered by /helper, not asked"),
        (probed(provider="/helper"), served("/trigger"), PASS, "served by /helper"),
        (probed(error="refused: no"), served("/trigger"), WAIT, "registered by /helper, but not served: refused: no"),
        (probed(provider="/other"), served("/trigger"), WAIT,
         "registered by /helper, but /other answers at rosrpc://h:1: a stale registration"),
        (probed(), served("/trigger"), PASS, "served by /helper"),  # a peer without a callerid
        (graph(statuses={"/nothing": {}}), action(name="/nothing"), WAIT,
         "no action server is registered with the master"),
        (graph(statuses={"/work": {"/worker": IDLE}}), action(), PASS, "served by /worker"),
        (graph(statuses={"/work": {"/worker": MUTE}}), action(), WAIT, f"no status can be read: /worker ({NO_ANSWER})"),
        (NO_CANCEL, action(), WAIT, "no whole action server: no node takes its cancels"),
        (two_servers("/relay", IDLE), action(), WAIT, "2 servers take the same goals: /relay, /worker"),
        # a second server that rests says nothing of the one that is to be replaced, and hangs
        (two_servers("/relay", MUTE), action("idle", "/relay"), WAIT, f"not known whether /relay is idle: {NO_ANSWER}"),
        (two_servers("/relay", replace(MUTE, refused=True)), action("idle", "/relay"), PASS, "idle on /worker, *"),
        (two_servers("/relay", MUTE), action("idle", "/worker"), PASS, "idle on /worker, seen twice"),
        (two_servers("/relay", MUTE), action("idle"), PASS, "idle on /worker, seen twice"),
        (two_servers(DEAD, replace(MUTE, refused=True)), action("idle"), PASS, "idle on /worker, seen twice"),
        (working((), ()), action("idle"), PASS, "idle on /worker, seen twice"),
        (working((2, 3, 4, 5, 8, 9), (3,)), action("idle"), PASS, "idle on /worker, seen twice"),
        (working(()), action("idle"), WAIT, "idle on /worker, seen once only: a second status is due"),
        *((working((state,)), action("idle"), WAIT, f"busy on /worker: 1 {GOAL_STATES[state]}")
          for state in (0, 1, 6, 7)),
        (working((), (3, 1, 1, 0)), action("idle"), WAIT, "busy on /worker: 2 ACTIVE, 1 PENDING"),
        (working((1,)), action(), PASS, "served by /worker"),
        (ALL, edge("/talker_a", "/relay"), PASS, "connected"),
        (ALL, edge("/talker_a", "/relay", topic="/nothing"), WAIT, "*"),
        # a page was closed, a recorder stopped: who takes part by himself leaves by himself
        *((graph(LOST), edge("/talker_a", "/listener_a", peer), WAIT, "/listener_a is not connected to /talker_a")
          for peer in ("", "publisher", "subscriber")),
        *((ALL, edge("/talker_a", "/helper", peer), WAIT, "/helper lives, but does not subscribe to it")
          for peer in ("", "publisher")),
        (ALL, edge("/talker_a", "/helper", "subscriber"), PASS, f"{LEFT}/helper lives, but does not subscribe to it"),
        *((ALL, edge("/helper", "/relay", peer), WAIT, "/helper lives, but does not publish it")
          for peer in ("", "subscriber")),
        (ALL, edge("/helper", "/relay", "publisher"), PASS, f"{LEFT}/helper lives, but does not publish it"),
        *((of, edge("/talker_a", DEAD, peer), verdict, f"{'' if verdict == WAIT else LEFT}*{words}*")
          for of, words in (
              (ALL, "registered, but down: nothing listens at"),
              (forgotten(), "is not registered with the master"),
              (long_silent(graph({DEAD: HUNG})), "registered, but down: no answer from"),
          )
          for peer, verdict in (("", WAIT), ("publisher", WAIT), ("subscriber", PASS))),
        (ALL, edge(DEAD, "/relay", "publisher"), PASS, f"{LEFT}*"),
        (ALL, edge(DEAD, "/relay", "subscriber"), WAIT, "*"),
        # one that is late once has not left
        (graph({DEAD: HUNG}), edge("/talker_a", DEAD, "subscriber"), WAIT, "* is registered, but down: *"),
        (graph(silent("/talker_a")), edge("/talker_a", "/relay", "subscriber"), WAIT,
         "the connections of /talker_a are not known (it did not tell them)"),
    ],
)  # fmt: skip
def test_what_a_graph_is_to_a_condition(of: Graph, wanted: Conditions, verdict: str, reason: str) -> None:
    [check] = evaluate(of, wanted)
    assert (check.verdict, fnmatchcase(check.reason, reason)) == (verdict, True), check.reason
    kinds = {"node": wanted.nodes, "topic": wanted.topics, "service": wanted.services, "action": wanted.actions}
    kinds |= {"absent": wanted.absent, "edge": wanted.edges}
    [(kind, (one,))] = [(kind, part) for kind, part in kinds.items() if part]
    assert (check.kind, check.name) == (kind, str(getattr(one, "name", one)))


@pytest.mark.parametrize(
    ("of", "wanted", "observed"),
    [
        (ALL, node(DEAD), {"uri": "http://127.0.0.1:9/", "pid": None, "refused": True}),
        (HEALTHY, on(connected=True), {"missing": []}),
        (hung("/talker_a", "/talker_b"), on(connected=True), {"missing": sorted(LISTENERS)}),
        (OTHERS_LOST, on(connected=True, publisher="/talker_b"), {"missing": ["/listener_a"]}),
        (ALL, on(), {"publishers": ["/talker_a", "/talker_b"], "subscribers": [*LISTENERS[:2], DEAD, "/relay"]}),
        (working((3, 4)), action(), {"servers": ["/worker"], "goals": {"/worker": ["SUCCEEDED", "ABORTED"]}}),
        (ALL, edge("/talker_a", "/relay"), {"connected": True}),
        (ALL, edge("/talker_a", DEAD), {"connected": False, "silent": [DEAD]}),
    ],
)
def test_what_was_seen_is_data_by_names(of: Graph, wanted: Conditions, observed: dict[str, Any]) -> None:
    [check] = evaluate(of, wanted)
    assert {key: check.observed[key] for key in observed} == observed


@pytest.mark.parametrize("tool", ["/rqt_plot", "/rostopic_4711_1700000000000", "/rviz_1700000000000000000"])
def test_a_tool_that_somebody_opened_and_that_cannot_connect_does_not_count(tool: str) -> None:
    """It lives on a laptop that has no way to the pods, or takes another type."""
    laptop = NodeAnswer("http://192.0.2.9:4711/", 9, bus=[])
    state, answers = without(recorded_state(), DEAD), {**recorded_answers(), tool: laptop}
    for wanted in (on(connected=True), on(connected=True, publisher="/talker_a")):
        for part in ("publishers", "subscribers"):
            seen = {**getattr(state, part), "/chatter": (*getattr(state, part)["/chatter"], tool)}
            assert evaluate(build(replace(state, **{part: seen}), answers), wanted)[0].verdict == PASS
        alone = replace(
            state, subscribers={**state.subscribers, "/chatter": (tool,)}
        )  # an app may have such a name, too
        assert f"missing {tool}" in evaluate(build(alone, answers), wanted)[0].reason


# ---- rates

BOTH = {NodeKey("/talker_a"): Rate(50.0, 50, 1.0), NodeKey("/talker_b"): Rate(error="/talker_b: gone")}
SUM = Rate(90.0, 90, 1.0, by=BOTH)


@pytest.mark.parametrize(
    ("rate", "publisher", "verdict", "reason"),
    [
        (None, None, WAIT, "not measured: at least 60 Hz is looked at once all else passes"),
        (Rate(error="no publisher"), None, WAIT, "not measured: no publisher"),
        (Rate(59.3, 59, 1.0), None, WAIT, "59.3 Hz (59 messages in 1.0 s) of at least 60 Hz"),
        (Rate(59.5, 59, 1.0), None, PASS, "59.5 Hz (59 messages in 1.0 s), at least 60 Hz"),
        # its own alone
        (SUM, "/talker_a", WAIT, "50.0 Hz by /talker_a (50 messages in 1.0 s) of at least 60 Hz"),
        (SUM, "/talker_b", WAIT, "not measured: /talker_b: gone"),
        (SUM, "/relay", WAIT, "not measured: /relay does not publish it"),
    ],
)
def test_rates(rate: Rate | None, publisher: str | None, verdict: str, reason: str) -> None:
    check = evaluate(HEALTHY, on(min_rate=60.0, publisher=publisher), {"/chatter": rate} if rate else None)[1]
    assert (check.kind, check.verdict, check.reason) == ("rate", verdict, reason)


def test_whose_messages_are_counted_and_how_long() -> None:
    def plan(*topics: TopicCondition) -> Any:
        return _gate.rate_plan(Conditions(topics=topics))

    assert [rate_window(hz) for hz in (500, 4, 2, 0.5, 0.01)] == [1, 1, 2, 8, 20]
    fast = TopicCondition("/t", min_rate=100.0, publisher="/a")
    slow = TopicCondition("/t", min_rate=2.0, publisher="/b")
    assert plan(fast, slow, TopicCondition("/u", publisher="/a")) == ({"/t": 2.0}, {"/t": ["/a", "/b"]})
    assert plan(slow, fast)[0] == {"/t": 2.0}
    assert plan(fast, TopicCondition("/t", min_rate=5.0)) == ({"/t": 1.0}, {})
    ros = FakeRos(HEALTHY, Rate(1.0, by={NodeKey("/talker_a"): Rate(100.0, 100, 1.0)}))
    assert look(ros, on(min_rate=90.0, publisher="/talker_a")).verdict == PASS
    assert ros.heard == {"/chatter": ["/talker_a"]}


# ---- the look


LATE_NODE, UP = Node("/a", asked=True, error="no answer"), Node("/a", pid=7, asked=True)


def test_silence_begins_when_it_was_asked_and_any_answer_ends_it_or_a_look_that_had_nothing_to_ask() -> None:
    at = [0.0]
    silence = Silence(lambda: at[0])

    def seen(node: Node, began: float, seconds: float = 0.0) -> Node:
        at[0] = began + seconds
        return silence.noted(Graph({node.key: node}), began).node("/a")

    assert [seen(LATE_NODE, 0.0, 2.0).silent, seen(LATE_NODE, 2.0, 2.0).silent] == [2.0, 4.0]
    assert seen(UP, 4.0) == UP
    assert seen(LATE_NODE, 6.0, 2.0).silent == 2.0
    assert [seen(LATE_NODE, 6.0 + PATIENCE + more).gone for more in (-0.1, 0.0)] == [False, True]
    assert seen(Node("/a"), 13.0) == Node("/a")  # it was connected then
    assert seen(LATE_NODE, 14.0).silent == 0.0
    assert seen(replace(LATE_NODE, refused=True), 14.0).gone  # a closed port needs no patience
    assert not (Node("/a").gone or UP.gone)


def test_from_look_to_look_a_peer_has_to_be_silent_throughout() -> None:
    """A bad version, not connected to a peer that lives, and answers late now and then."""
    lost = {**rows_without("/talker_a", "/listener_a")}
    late = graph({**lost, "/listener_a": HUNG})
    wanted = Conditions(edges=(EdgeCondition("/talker_a", "/chatter", "/listener_a", "subscriber"),))
    at = [0.0]
    silence = Silence(lambda: at[0])

    def seen(of: Graph, seconds: float) -> str:
        at[0] = seconds
        return look(FakeRos(of), wanted, silence).verdict

    assert [seen(late, second) for second in (0, 3, PATIENCE - 0.1)] == [WAIT] * 3
    assert seen(graph(lost), PATIENCE) == WAIT
    assert [seen(late, PATIENCE + second) for second in (1, 5)] == [WAIT] * 2
    assert seen(late, 2 * PATIENCE + 1) == PASS


class FakeRos:
    """A backend that plays a graph."""

    uri = "http://master:11311/"

    def __init__(self, of: Graph, rate: Rate | None = None, error: str = "") -> None:
        self.graph, self.rate, self.error = of, rate, error
        self.types: bool | None = None
        self.sampled: dict[str, float] = {}
        self.latching: set[str] = set()  # publishers
        self.greeted: list[tuple[str, tuple[str, ...]]] = []
        self.heard: dict[str, list[str]] = {}
        self.asked: list[tuple[MasterState, Questions]] = []

    def state(self, types: bool = False) -> MasterState:
        self.types = types
        if self.error:
            raise RosError(self.error)
        return recorded_state()

    def ask(self, state: MasterState, wanted: Questions) -> Graph:
        self.asked.append((state, wanted))
        return self.graph

    def rates(self, graph: Graph, seconds: Mapping[str, float]) -> dict[str, Rate]:
        self.sampled = dict(seconds)
        self.heard = {name: names_of(graph.topics[name].publishers) for name in seconds}
        return dict.fromkeys(seconds, self.rate or Rate(error="none"))

    def handshakes(self, graph: Graph, topics: Iterable[str]) -> dict[str, Handshake]:
        found = {name: graph.topics[name].publishers for name in topics}
        self.greeted += [(name, tuple(names_of(keys))) for name, keys in found.items()]
        return {name: Handshake(keys[0], "", keys[0].name in self.latching) for name, keys in found.items()}


def test_a_look_that_passes() -> None:
    ros = FakeRos(HEALTHY)
    wanted = Conditions(nodes=("/relay",), topics=(TopicCondition("/chatter", connected=True),))
    seen = look(ros, wanted)
    assert seen.checks[0] == Check("master", ros.uri, PASS, "answers")
    assert ros.asked == [(recorded_state(), questions(recorded_state(), wanted))]
    assert (seen.verdict, [check.kind for check in seen.checks], seen.unmet) == (PASS, ["master", "node", "topic"], [])
    assert ros.types is False
    wrong = look(ros, Conditions(nodes=("/nobody",), topics=(TopicCondition("/chatter", type="std_msgs/Int32"),)))
    assert (wrong.verdict, ros.types) == (FAIL, True)  # which outweighs what may still come
    assert look(FakeRos(HEALTHY), Conditions()).verdict == PASS


@pytest.mark.parametrize(
    ("latching", "verdict", "reasons"),
    [
        ({"/talker_a", "/talker_b"}, PASS, ["latched by /talker_b", "latched by /talker_a"]),
        ({"/talker_a"}, FAIL, ["/talker_b publishes it without latching", "latched by /talker_a"]),
    ],
)
def test_who_has_to_latch_is_asked_once_all_else_passes(latching: set[str], verdict: str, reasons: list[str]) -> None:
    ros = FakeRos(HEALTHY)
    ros.latching = latching
    latched = (
        TopicCondition("/chatter", publisher="/talker_b", latched=True),
        TopicCondition("/chatter", latched=True),
    )
    topics = (*latched, TopicCondition("/chatter_relay"))
    seen = look(ros, Conditions(topics=topics))
    checks = [check for check in seen.checks if check.kind == "latched"]
    assert (seen.verdict, [check.reason for check in checks]) == (verdict, reasons)
    assert ros.greeted == [("/chatter", ("/talker_b",)), ("/chatter", ("/talker_a", "/talker_b"))]
    assert ros.sampled == {}
    missing = look(ros, Conditions(topics=topics, nodes=("/nobody",)))
    assert [check.verdict for check in missing.checks if check.kind == "latched"] == [WAIT, WAIT]
    assert len(ros.greeted) == 2


def test_what_is_lost_while_rates_are_measured_is_seen() -> None:
    class Losing(FakeRos):
        def rates(self, *args: Any, **kwargs: Any) -> dict[str, Rate]:
            self.error = "nothing listens"
            return super().rates(*args, **kwargs)

    wanted = Conditions(topics=(TopicCondition("/chatter", min_rate=90.0),))
    seen = look(Losing(HEALTHY, Rate(100.0, 100, 1.0)), wanted)
    assert seen.verdict == WAIT
    assert "nothing listens" in str(seen.unmet[0])


REVISION, ONE, TWO, OTHER = "/a_1a2b3c4d", "/a_1a2b3c4d_4", "/a_1a2b3c4d_5", "/b_99999999_6"


class Pods(FakeRos):
    """Pods of a revision, each with its node, of which some live."""

    def __init__(self, alive: list[str], dead: list[str], late: str = "") -> None:
        super().__init__(graph())
        self.alive, self.late, self.there = alive, late, (*alive, *dead, OTHER)

    def state(self, types: bool = False) -> MasterState:
        del types
        own = {f"{name}/debug": (name,) for name in self.there}
        return MasterState({"/t": self.there, **own}, {"/t": ("/c",)}, {f"{ONE}/reset": (ONE,)})

    def ask(self, state: MasterState, wanted: Questions) -> Graph:
        self.asked.append((state, wanted))
        bus = [[1, "/c", "o", "TCPROS", "/t", True]]
        answers = {
            name: NodeAnswer(f"http://{name[1:]}:1/", 1, bus=bus)
            if name in (*self.alive, OTHER, "/c")
            else NodeAnswer(f"http://{name[1:]}:1/", error="dead", refused=name != self.late)
            for name in wanted.nodes
        }
        probes = {name: ServiceProbe("rosrpc://x:1", ONE) for name in wanted.services}
        return build(state, answers, probes)


@pytest.mark.parametrize(("alive", "dead"), [([ONE], []), ([ONE], [TWO]), ([ONE], ["/a_1a2b3c4d_2"])])
def test_a_revisions_name_means_the_node_of_its_pod_that_lives(alive: list[str], dead: list[str]) -> None:
    wanted = Conditions(
        nodes=(REVISION, OTHER),
        topics=(TopicCondition("/t", publisher=REVISION), TopicCondition(f"{REVISION}/debug")),
        services=(f"{REVISION}/reset",),
        edges=(EdgeCondition(REVISION, "/t", "/c"),),
    )
    ros = Pods(alive, dead)
    seen = look(ros, wanted)
    assert (seen.verdict, seen.unmet) == (PASS, [])
    found = [check.name for check in seen.checks if check.kind in ("node", "service", "topic")]
    assert found == [ONE, OTHER, "/t", f"{ONE}/debug", f"{ONE}/reset"]
    assert len(ros.asked) == 1 + bool(dead)
    assert look(Pods([], [ONE]), wanted).verdict == WAIT
    another = Check("node", "/a_99999999", WAIT, "not registered with the master")
    assert look(ros, Conditions(nodes=("/a_99999999",))).unmet == [another]


@pytest.mark.parametrize(
    ("alive", "dead", "late", "verdict"),
    [
        ([], [], "", PASS),
        ([ONE], [], "", WAIT),
        ([TWO], [ONE], "", WAIT),
        ([], [ONE, TWO], "", PASS),
        ([], [ONE, TWO], TWO, WAIT),
    ],
)
def test_a_revision_is_absent_in_all_its_pods(alive: list[str], dead: list[str], late: str, verdict: str) -> None:
    assert look(Pods(alive, dead, late), Conditions(absent=(REVISION,))).verdict == verdict


def test_without_a_master_every_condition_is_unmet_and_named() -> None:
    edges, values = (EdgeCondition("/p", "/t", "/s"),), (ValueCondition("/t", quiet=1.0),)
    topics, actions = (TopicCondition("/t", min_rate=1.0, latched=True),), (ActionCondition("/a"),)
    wanted = Conditions(("/n",), topics, ("/s",), actions, ("/x",), edges, values)
    seen = look(FakeRos(HEALTHY, error="the ROS master does not answer: nothing listens"), wanted)
    assert seen.verdict == WAIT
    assert [f"{check.kind} {check.name}" for check in seen.unmet] == [
        "master http://master:11311/", "node /n", "topic /t", "rate /t", "latched /t", "service /s", "action /a",
        "edge /p -> /t -> /s", "absent /x", "value /t quiet for 1 s",
    ]  # fmt: skip
    assert "nothing listens" in str(seen.unmet[0])
    assert {(check.verdict, check.reason) for check in seen.unmet[1:]} == {(WAIT, "not known without the master")}


def ears(*verdicts: str) -> _gate.Ears:
    """Have heard this, look by look."""
    said = iter(verdicts)
    return lambda _graph: [Check("value", "/t", next(said), "heard")]


def test_what_messages_say_is_part_of_the_verdict() -> None:
    wanted = Conditions(nodes=("/talker_a",), values=(ValueCondition("/t", quiet=1.0),))
    for verdict in (PASS, WAIT, FAIL):
        assert look(FakeRos(HEALTHY), wanted, ears=ears(verdict)).verdict == verdict
    assert look(FakeRos(HEALTHY), wanted).verdict == WAIT  # nobody has listened
    rated = Conditions(topics=(TopicCondition("/chatter", min_rate=90.0),), values=wanted.values)
    ros = FakeRos(HEALTHY)
    assert (look(ros, rated, ears=ears(WAIT)).verdict, ros.sampled) == (WAIT, {})
    assert look(ros, rated, ears=ears(PASS, WAIT)).verdict == WAIT  # nor may it end while rates are measured
