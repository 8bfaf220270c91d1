# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import FAIL, PASS, WAIT
from ansible_collections.rosops.fleet.plugins.module_utils._ros import gate as _gate
from ansible_collections.rosops.fleet.plugins.module_utils._ros.checks import Check
from ansible_collections.rosops.fleet.plugins.module_utils._ros.conditions import (
    ActionCondition,
    Conditions,
    EdgeCondition,
    TopicCondition,
    ValueCondition,
)
from ansible_collections.rosops.fleet.plugins.module_utils._ros.gate import (
    evaluate,
    look,
    questions,
    rate_window,
    without_master,
)
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import (
    PATIENCE,
    Graph,
    Handshake,
    MasterState,
    NodeKey,
    Questions,
    Rate,
    ServiceProbe,
    StatusReading,
    names_of,
)
from ansible_collections.rosops.fleet.plugins.module_utils._ros.replies import NodeAnswer, build
from ansible_collections.rosops.fleet.plugins.module_utils._ros.silence import Silence
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


def only(conditions: Conditions, of: Graph, rates: Mapping[str, Rate] | None = None) -> Check:
    checks = evaluate(of, conditions, rates)
    assert len(checks) == 1
    return checks[0]


def topic(of: Graph, **wanted: Any) -> Check:
    return only(Conditions(topics=(TopicCondition(**{"name": "/chatter", **wanted}),)), of)


def healthy() -> Graph:
    """The recorded graph without the node that was killed."""
    return graph(gone=DEAD)


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


def test_of_a_topic_that_nobody_registered_nobody_is_asked() -> None:
    topics = (TopicCondition("/nothing", "a/B", connected=True), TopicCondition("/none", publisher="/x", publishers=1))
    assert questions(recorded_state(), Conditions(topics=topics)).nodes == {}


def test_of_an_edge_its_ends_are_asked() -> None:
    edges = (EdgeCondition("/talker_a", "/chatter", DEAD), EdgeCondition("/nobody", "/chatter", "/relay"))
    wanted = questions(recorded_state(), Conditions(edges=edges))
    assert wanted.nodes == {"/talker_a": {"bus"}, DEAD: frozenset(), "/relay": frozenset()}


@pytest.mark.parametrize(("rate", "seconds"), [(500, 1), (4, 1), (2, 2), (0.5, 8), (0.01, 20)])
def test_how_long_a_rate_is_measured(rate: float, seconds: float) -> None:
    assert rate_window(rate) == seconds


# ---- nodes


@pytest.mark.parametrize(
    ("name", "verdict", "words"),
    [
        ("/talker_a", PASS, "up, process"),
        ("/relay", PASS, "up, process"),
        (DEAD, WAIT, "registered, but down: nothing listens at http://127.0.0.1:9/"),
        ("/nobody", WAIT, "not registered"),
    ],
)
def test_nodes(name: str, verdict: str, words: str) -> None:
    check = only(Conditions(nodes=(name,)), graph())
    assert (check.kind, check.name, check.verdict) == ("node", name, verdict)
    assert words in check.reason


def test_a_hung_node_is_down_with_its_reason() -> None:
    check = only(Conditions(nodes=("/relay",)), graph({"/relay": HUNG}))
    assert (check.verdict, "within 2 s" in check.reason, check.observed["pid"]) == (WAIT, True, None)


@pytest.mark.parametrize(
    ("name", "verdict", "words"),
    [
        ("/nobody", PASS, "gone"),
        ("/talker_a", WAIT, "still registered, and answers"),
        (DEAD, PASS, "what is registered is stale: nothing listens"),
    ],
)
def test_absent(name: str, verdict: str, words: str) -> None:
    check = only(Conditions(absent=(name,)), graph())
    assert (check.kind, check.verdict) == ("absent", verdict)
    assert words in check.reason


# ---- topics


def test_a_topic_nobody_registered() -> None:
    check = topic(healthy(), name="/nothing", publishers=0)
    assert (check.verdict, check.reason) == (WAIT, "nobody has registered it with the master")


def test_an_absent_node_that_is_late_once_is_not_gone() -> None:
    late = only(Conditions(absent=("/relay",)), graph({"/relay": HUNG}))
    assert (late.verdict, "may only be late: no answer" in late.reason) == (WAIT, True)
    assert only(Conditions(absent=("/relay",)), long_silent(graph({"/relay": HUNG}))).verdict == PASS


def test_a_topic_by_name_needs_a_living_publisher() -> None:
    assert topic(healthy()).verdict == PASS
    one = topic(graph({"/talker_a": HUNG}))
    assert (one.verdict, one.reason[:45]) == (PASS, "1 publisher; registered, but down: /talker_a ")
    both = topic(graph({"/talker_a": HUNG, "/talker_b": HUNG}))
    assert (both.verdict, both.reason[:27]) == (WAIT, "0 publishers of at least 1;")


@pytest.mark.parametrize(
    ("wanted", "verdict", "reason"),
    [
        ({"publishers": 2}, PASS, "2 publishers"),
        ({"publishers": 3}, WAIT, "2 publishers of at least 3"),
        ({"subscribers": 3}, PASS, "3 subscribers"),
        ({"subscribers": 4}, WAIT, "3 subscribers of at least 4"),
        ({"subscribers": 0}, PASS, "3 subscribers"),
        ({"publishers": 3, "subscribers": 4}, WAIT, "2 publishers of at least 3; 3 subscribers of at least 4"),
        # what passes is not told beside what does not
        ({"publishers": 2, "subscribers": 4}, WAIT, "3 subscribers of at least 4"),
        ({"name": "/work/goal", "subscribers": 1}, PASS, "1 subscriber"),
    ],
)
def test_numbers(wanted: dict[str, Any], verdict: str, reason: str) -> None:
    check = topic(healthy(), **wanted)
    assert (check.verdict, check.reason) == (verdict, reason)


def test_a_dead_nodes_registration_does_not_count() -> None:
    check = topic(graph(), subscribers=4)
    assert (check.verdict, check.reason) == (
        WAIT,
        f"3 subscribers of at least 4; registered, but down: {DEAD} (nothing listens at http://127.0.0.1:9/)",
    )
    assert DEAD in check.observed["subscribers"]


def test_the_keeper_is_no_publisher_that_somebody_asked_for() -> None:
    """It gives what one had latched that was replaced, which is not that the next one is there."""
    keeper = {"/ros_keeper": NodeAnswer("http://127.0.0.1:40009/", 9)}
    both = graph(keeper, publishers={"/chatter": ("/ros_keeper", "/talker_a")})
    assert topic(both, publishers=1).reason == "1 publisher"
    assert topic(both, publishers=2).reason == "1 publisher of at least 2"
    alone = topic(graph(keeper, publishers={"/chatter": ("/ros_keeper",)}))
    assert (alone.verdict, alone.reason) == (WAIT, "0 publishers of at least 1")
    assert topic(both, connected=True).verdict == topic(graph(), connected=True).verdict


def test_types() -> None:
    assert topic(healthy(), type="std_msgs/String").verdict == PASS
    check = topic(healthy(), type="std_msgs/Int32")
    assert check.verdict == FAIL
    assert "std_msgs/String at /talker_a" in check.reason
    assert check.reason.endswith("not std_msgs/Int32")


def test_a_type_that_only_the_master_remembers_is_no_failure() -> None:
    """The publisher that had it is gone; the one that is to come may have the right one."""
    hung = dict.fromkeys(("/talker_a", "/talker_b", "/listener_a", "/listener_b"), HUNG)
    check = topic(graph(hung, gone=DEAD), type="std_msgs/Int32", publishers=0)
    assert (check.verdict, check.reason) == (WAIT, "the type is std_msgs/String to the master, not std_msgs/Int32")
    assert topic(graph(hung, gone=DEAD), type="std_msgs/String", publishers=0).verdict == PASS


def test_a_subscriber_that_takes_any_type_contradicts_nothing() -> None:
    answers = {"/relay": recorded_answers()["/relay"]}  # says "*" of /chatter
    state = MasterState({}, {"/chatter": ("/relay",)}, {}, {"/chatter": "std_msgs/Int32"})
    assert topic(build(state, answers), type="std_msgs/Int32", subscribers=1).verdict == PASS


# ---- connected


def rows_without(node: str, *peers: str) -> dict[str, NodeAnswer]:
    """The recorded answer of a publisher that is not connected to these subscribers."""
    answer = recorded_answers()[node]
    return {node: replace(answer, bus=[row for row in answer.bus if row[1] not in peers])}


def test_connected_when_every_subscriber_is_a_destination_of_every_publisher() -> None:
    check = topic(healthy(), connected=True)
    assert (check.verdict, check.reason) == (PASS, "3 subscribers connected to 2 publishers")
    assert check.observed["missing"] == []


def test_a_roscpp_publisher_and_a_rospy_subscriber_are_connected() -> None:
    assert topic(healthy(), name="/chatter_relay", connected=True).verdict == PASS


def test_one_subscriber_missing_on_one_publisher() -> None:
    """The subscribers' own rows still say "connected": they are worth nothing."""
    check = topic(graph(rows_without("/talker_b", "/listener_b"), gone=DEAD), connected=True)
    assert (check.verdict, check.reason) == (WAIT, "2 of 3 subscribers connected to /talker_b: missing /listener_b")
    assert check.observed["missing"] == ["/listener_b"]


def test_a_roscpp_subscriber_missing() -> None:
    check = topic(graph(rows_without("/talker_a", "/relay"), gone=DEAD), connected=True)
    assert (check.verdict, check.observed["missing"]) == (WAIT, ["/relay"])


def test_a_row_that_says_not_connected_is_no_connection() -> None:
    answer = recorded_answers()["/relay"]
    bus = [[*row[:5], 0, *row[6:]] if row[1] == "/listener_relay" else row for row in answer.bus]
    check = topic(graph({"/relay": replace(answer, bus=bus)}), name="/chatter_relay", connected=True)
    assert (check.verdict, check.observed["missing"]) == (WAIT, ["/listener_relay"])


def long_silent(of: Graph) -> Graph:
    """The graph as it is told once nobody of these has answered in any look for long."""
    return Silence(lambda: PATIENCE).noted(of, 0.0)


def test_whoever_hangs_is_not_counted_but_one_of_each_has_to_live() -> None:
    check = topic(long_silent(graph({"/talker_b": HUNG}, gone=DEAD)), connected=True)
    words = "3 subscribers connected to 1 publisher; down, so not counted: /talker_b"
    assert (check.verdict, check.reason) == (PASS, words)
    nobody = topic(long_silent(graph({"/talker_a": HUNG, "/talker_b": HUNG}, gone=DEAD)), connected=True)
    assert (nobody.verdict, "every publisher is registered, but down: /talker_a (no" in nobody.reason) == (WAIT, True)
    listeners = dict.fromkeys(("/listener_a", "/listener_b", "/relay"), HUNG)
    unheard = topic(long_silent(graph(listeners, gone=DEAD)), connected=True)
    assert (unheard.verdict, "every subscriber is registered, but down" in unheard.reason) == (WAIT, True)


def test_whoever_is_late_once_is_counted() -> None:
    late = topic(graph({"/talker_b": HUNG}, gone=DEAD), connected=True)
    assert (late.verdict, "the connections of /talker_b are not known (no answer" in late.reason) == (WAIT, True)
    lost = {**rows_without("/talker_a", "/listener_a"), "/listener_a": HUNG}
    assert topic(graph(lost, gone=DEAD), connected=True).verdict == WAIT
    assert topic(graph(lost, gone=DEAD), connected=True, publisher="/talker_a").verdict == WAIT


@pytest.mark.parametrize("tool", ["/rqt_plot", "/rostopic_4711_1700000000000", "/rviz_1700000000000000000"])
def test_a_tool_that_somebody_opened_and_that_cannot_connect_does_not_count(tool: str) -> None:
    """It lives on a laptop that has no way to the pods, or takes another type."""
    laptop = NodeAnswer("http://192.0.2.9:4711/", 9, bus=[])
    state, answers = without(recorded_state(), DEAD), {**recorded_answers(), tool: laptop}
    for part in ("publishers", "subscribers"):
        seen = {**getattr(state, part), "/chatter": (*getattr(state, part)["/chatter"], tool)}
        beside = build(replace(state, **{part: seen}), answers)
        assert topic(beside, connected=True).verdict == PASS
        assert topic(beside, connected=True, publisher="/talker_a").verdict == PASS
    alone = replace(state, subscribers={**state.subscribers, "/chatter": (tool,)})  # an app may have such a name, too
    words = f"missing {tool}"
    assert words in topic(build(alone, answers), connected=True).reason
    assert words in topic(build(alone, answers), connected=True, publisher="/talker_a").reason


def test_a_publisher_that_does_not_know_getbusinfo_is_not_taken_as_connected() -> None:
    bare = replace(recorded_answers()["/talker_b"], bus=None)
    check = topic(graph({"/talker_b": bare}, gone=DEAD), connected=True)
    assert (check.verdict, "it did not tell them" in check.reason) == (WAIT, True)


def test_a_dead_subscriber_is_named_and_not_counted() -> None:
    check = topic(graph(), connected=True)
    assert (check.verdict, check.reason) == (
        PASS,
        f"3 subscribers connected to 2 publishers; down, so not counted: {DEAD}",
    )


@pytest.mark.parametrize(
    ("state", "words"),
    [
        (MasterState({"/chatter": ("/talker_a",)}, {}), "no subscriber is registered"),
        (MasterState({}, {"/chatter": ("/listener_a",)}), "no publisher is registered"),
    ],
)
def test_connected_needs_both_ends(state: MasterState, words: str) -> None:
    check = topic(build(state, recorded_answers()), connected=True)
    assert (check.verdict, words in check.reason) == (WAIT, True)


# ---- rates


@pytest.mark.parametrize(
    ("rate", "verdict", "words"),
    [
        (None, WAIT, "not measured: at least 100 Hz is looked at once all else passes"),
        (Rate(error="no publisher"), WAIT, "not measured: no publisher"),
        (Rate(0.0, 0, 1.0), WAIT, "0.0 Hz (0 messages in 1.0 s) of at least 100 Hz"),
        (Rate(98.9, 99, 1.0), WAIT, "98.9 Hz"),
        (Rate(99.1, 99, 1.0), PASS, "99.1 Hz (99 messages in 1.0 s), at least 100 Hz"),
        (Rate(500.0, 500, 1.0), PASS, "500.0 Hz"),
    ],
)
def test_rates(rate: Rate | None, verdict: str, words: str) -> None:
    wanted = Conditions(topics=(TopicCondition("/chatter", min_rate=100.0),))
    check = evaluate(healthy(), wanted, {"/chatter": rate} if rate else None)[1]
    assert (check.kind, check.verdict) == ("rate", verdict)
    assert words in check.reason


# ---- services


@pytest.mark.parametrize(
    ("name", "probe", "verdict", "words"),
    [
        ("/nothing", None, WAIT, "not registered"),
        ("/trigger", None, WAIT, "registered by /helper, not asked"),
        ("/trigger", ServiceProbe("rosrpc://h:1", "/helper", "std_srvs/Trigger"), PASS, "served by /helper"),
        ("/trigger", ServiceProbe("rosrpc://h:1", error="refused: [/helper] is not"), WAIT, "not served: refused"),
        ("/trigger", ServiceProbe("rosrpc://h:1", "/other"), WAIT, "/other answers at rosrpc://h:1: a stale"),
        ("/trigger", ServiceProbe("rosrpc://h:1"), PASS, "served by /helper"),  # a peer without a callerid
    ],
)
def test_services(name: str, probe: ServiceProbe | None, verdict: str, words: str) -> None:
    check = only(Conditions(services=(name,)), graph(probes={name: probe} if probe else None))
    assert (check.kind, check.verdict) == ("service", verdict)
    assert words in check.reason


# ---- actions


def action(status: Mapping[str, StatusReading], state: str = "up", **changes: Any) -> Check:
    return only(Conditions(actions=(ActionCondition("/work", state),)), graph(statuses={"/work": status}, **changes))


def test_an_action_nobody_registered() -> None:
    check = only(Conditions(actions=(ActionCondition("/nothing"),)), graph(statuses={"/nothing": {}}))
    assert (check.verdict, check.reason) == (WAIT, "no action server is registered with the master")


def test_an_action_is_up_when_its_status_arrives() -> None:
    check = action({"/worker": IDLE})
    assert (check.verdict, check.reason) == (PASS, "served by /worker")
    assert check.observed["goals"] == {"/worker": ["SUCCEEDED", "ABORTED"]}


def test_an_action_server_that_hangs_is_not_up() -> None:
    check = action({"/worker": StatusReading(error="no answer from http://h:1/ within 2 s")})
    assert (check.verdict, "no status can be read: /worker (no answer" in check.reason) == (WAIT, True)


def test_an_action_without_its_cancel_topic_is_not_whole() -> None:
    subscribers = {**recorded_state().subscribers, "/work/cancel": ()}
    check = action({}, subscribers=subscribers)
    assert (check.verdict, "no node takes its cancels" in check.reason) == (WAIT, True)


def test_two_servers_of_one_action_are_wrong() -> None:
    """Both would execute every goal."""
    state = recorded_state()
    two = ("/relay", "/worker")
    check = action(
        {"/worker": IDLE, "/relay": IDLE},
        publishers={**state.publishers, "/work/status": two},
        subscribers={**state.subscribers, "/work/goal": two, "/work/cancel": two},
    )
    assert (check.verdict, check.reason) == (WAIT, "2 servers take the same goals: /relay, /worker")


@pytest.mark.parametrize(
    ("ours", "refused", "verdict"),
    [("/relay", False, WAIT), ("/relay", True, PASS), ("/worker", False, PASS), ("", False, PASS)],
)
def test_who_tells_nothing_is_idle_only_if_it_is_somebody_elses(ours: str, refused: bool, verdict: str) -> None:
    """A second server that rests says nothing of the one that is to be replaced, and hangs."""
    state, two = recorded_state(), ("/relay", "/worker")
    of = graph(
        statuses={"/work": {"/worker": IDLE, "/relay": StatusReading(error="no answer", refused=refused)}},
        publishers={**state.publishers, "/work/status": two},
        subscribers={**state.subscribers, "/work/goal": two, "/work/cancel": two},
    )
    check = only(Conditions(actions=(ActionCondition("/work", "idle", ours),)), of)
    assert check.verdict == verdict
    assert ("not known whether /relay is idle: no answer" in check.reason) == (verdict == WAIT)


def test_a_dead_second_server_does_not_count() -> None:
    state = recorded_state()
    two = (DEAD, "/worker")
    check = action(
        {"/worker": IDLE, DEAD: StatusReading(error="nothing listens", refused=True)},
        "idle",
        publishers={**state.publishers, "/work/status": two},
        subscribers={**state.subscribers, "/work/goal": two, "/work/cancel": two},
    )
    assert check.verdict == PASS


@pytest.mark.parametrize(
    ("readings", "verdict", "reason"),
    [
        (((), ()), PASS, "idle on /worker, seen twice"),
        (((2, 3, 4, 5, 8, 9), (3,)), PASS, "idle on /worker, seen twice"),
        (((),), WAIT, "idle on /worker, seen once only: a second status is due"),
        (((0,),), WAIT, "busy on /worker: 1 PENDING"),
        (((1,),), WAIT, "busy on /worker: 1 ACTIVE"),
        (((6,),), WAIT, "busy on /worker: 1 PREEMPTING"),
        (((7,),), WAIT, "busy on /worker: 1 RECALLING"),
        (((), (3, 1, 1, 0)), WAIT, "busy on /worker: 2 ACTIVE, 1 PENDING"),
        (((1,), ()), WAIT, "busy on /worker: 1 ACTIVE"),
    ],
)
def test_idle_is_seen_twice(readings: tuple[tuple[int, ...], ...], verdict: str, reason: str) -> None:
    check = action({"/worker": StatusReading(readings)}, "idle")
    assert (check.verdict, check.reason) == (verdict, reason)


def test_a_busy_server_is_up() -> None:
    assert action({"/worker": StatusReading(((1,),))}).verdict == PASS


# ---- one publisher


def test_a_publisher_must_publish_and_answer() -> None:
    assert topic(graph(), publisher="/talker_a").verdict == PASS
    other = topic(graph(), publisher="/relay", connected=True)
    assert (other.verdict, other.reason) == (WAIT, "/relay does not publish it")
    down = topic(graph({"/talker_a": HUNG}), publisher="/talker_a", connected=True)
    assert (down.verdict, down.reason) == (
        WAIT,
        "its publisher /talker_a is registered, but down: no answer from http://h:1/ within 2 s",
    )
    assert topic(graph({"/talker_b": HUNG}), publisher="/talker_a").verdict == PASS


def test_connected_to_one_publisher_whatever_the_others_do() -> None:
    of = graph(rows_without("/talker_b", "/listener_a"), gone=DEAD)
    assert topic(of, connected=True).verdict == WAIT
    assert topic(of, connected=True, publisher="/talker_a").reason == (
        "published by /talker_a; 3 subscribers connected to /talker_a"
    )
    missing = topic(of, connected=True, publisher="/talker_b")
    assert (missing.verdict, missing.observed["missing"]) == (WAIT, ["/listener_a"])
    assert missing.reason == "2 of 3 subscribers connected to /talker_b: missing /listener_a"


def test_a_dead_subscriber_does_not_keep_one_publisher_from_being_connected() -> None:
    check = topic(graph(), connected=True, publisher="/talker_a")
    assert (check.verdict, f"down, so not counted: {DEAD}" in check.reason) == (PASS, True)
    hung = long_silent(graph({**rows_without("/talker_a", "/listener_a"), "/listener_a": HUNG}))
    assert topic(hung, connected=True, publisher="/talker_a").verdict == PASS


def test_one_publisher_that_does_not_tell_its_connections_is_not_taken_as_connected() -> None:
    silent = replace(recorded_answers()["/talker_a"], bus=None)
    check = topic(graph({"/talker_a": silent}), connected=True, publisher="/talker_a")
    assert (check.verdict, "are not known" in check.reason) == (WAIT, True)


def test_one_publisher_without_any_subscriber_is_connected_to_all_there_are() -> None:
    alone = graph(subscribers={})
    assert topic(alone, connected=True, publisher="/talker_a").verdict == PASS
    assert topic(alone, connected=True).verdict == WAIT
    assert topic(alone, connected=True, publisher="/talker_a", subscribers=1).verdict == WAIT


def test_only_the_publishers_own_type_counts() -> None:
    wrong = replace(recorded_answers()["/talker_b"], publications=[["/chatter", "std_msgs/Int32"]])
    of = graph({"/talker_b": wrong})
    assert topic(of, type="std_msgs/String").verdict == FAIL
    assert topic(of, type="std_msgs/String", publisher="/talker_a").verdict == PASS
    assert topic(of, type="std_msgs/String", publisher="/talker_b").verdict == FAIL


def test_only_the_publishers_own_rate_counts() -> None:
    of = healthy()
    both = Rate(
        90.0,
        90,
        1.0,
        by={NodeKey("/talker_a"): Rate(50.0, 50, 1.0), NodeKey("/talker_b"): Rate(error="/talker_b: gone")},
    )

    def rated(publisher: str | None) -> Check:
        wanted = Conditions(topics=(TopicCondition("/chatter", min_rate=60.0, publisher=publisher),))
        return evaluate(of, wanted, {"/chatter": both})[1]

    assert rated(None).verdict == PASS
    assert (rated("/talker_a").verdict, rated("/talker_a").reason) == (
        WAIT,
        "50.0 Hz by /talker_a (50 messages in 1.0 s) of at least 60 Hz",
    )
    assert "not measured: /talker_b: gone" in rated("/talker_b").reason
    assert "does not publish it" in rated("/relay").reason


def test_whose_messages_are_counted_and_how_long() -> None:
    def plan(*topics: TopicCondition) -> Any:
        return _gate.rate_plan(Conditions(topics=topics))

    fast = TopicCondition("/t", min_rate=100.0, publisher="/a")
    slow = TopicCondition("/t", min_rate=2.0, publisher="/b")
    assert plan(fast, slow, TopicCondition("/u", publisher="/a")) == ({"/t": 2.0}, {"/t": ["/a", "/b"]})
    assert plan(slow, fast)[0] == {"/t": 2.0}
    assert plan(fast, TopicCondition("/t", min_rate=5.0)) == ({"/t": 1.0}, {})
    ros = FakeRos(healthy(), Rate(1.0, by={NodeKey("/talker_a"): Rate(100.0, 100, 1.0)}))
    wanted = Conditions(topics=(TopicCondition("/chatter", min_rate=90.0, publisher="/talker_a"),))
    assert (look(ros, wanted).verdict, ros.heard) == (PASS, {"/chatter": ["/talker_a"]})


# ---- edges


def connection(of: Graph, publisher: str, subscriber: str, peer: str = "", topic: str = "/chatter") -> Check:
    return only(Conditions(edges=(EdgeCondition(publisher, topic, subscriber, peer),)), of)


def test_an_edge_that_is_there() -> None:
    check = connection(graph(), "/talker_a", "/relay")
    assert (check.kind, check.name) == ("edge", "/talker_a -> /chatter -> /relay")
    assert (check.verdict, check.reason, check.observed) == (PASS, "connected", {"connected": True})


LOST = rows_without("/talker_a", "/listener_a")


@pytest.mark.parametrize("peer", ["", "publisher", "subscriber"])
def test_an_edge_that_is_missing_between_two_that_live(peer: str) -> None:
    check = connection(graph(LOST), "/talker_a", "/listener_a", peer)
    assert (check.verdict, check.reason) == (WAIT, "/listener_a is not connected to /talker_a")
    of_both = connection(graph(), "/talker_a", "/helper", peer), connection(graph(), "/helper", "/relay", peer)
    # a page was closed, a recorder stopped: who takes part by himself leaves by himself
    left = ["passes unconnected, as its peer left: " if peer == end else "" for end in ("subscriber", "publisher")]
    assert [check.verdict for check in of_both] == [PASS if words else WAIT for words in left]
    assert of_both[0].reason == f"{left[0]}/helper lives, but does not subscribe to it"
    assert of_both[1].reason == f"{left[1]}/helper lives, but does not publish it"


def forgotten() -> Graph:
    """The graph in which nobody knows the dead node any more."""
    of = graph(gone=DEAD)
    return replace(of, nodes={key: node for key, node in of.nodes.items() if key.name != DEAD})


@pytest.mark.parametrize(
    ("of", "words"),
    [
        (graph(), "registered, but down: nothing listens at"),
        (forgotten(), "is not registered with the master"),
        (long_silent(graph({DEAD: HUNG})), "registered, but down: no answer from"),
    ],
)
def test_a_peer_that_left_by_itself_is_noted_and_any_other_is_missing(of: Graph, words: str) -> None:
    left = connection(of, "/talker_a", DEAD, "subscriber")
    assert (left.verdict, left.reason.startswith("passes unconnected, as its peer left")) == (PASS, True)
    assert words in left.reason
    for peer in ("", "publisher"):
        check = connection(of, "/talker_a", DEAD, peer)
        assert (check.verdict, words in check.reason) == (WAIT, True)
    assert connection(of, DEAD, "/relay", "publisher").verdict == PASS
    assert connection(of, DEAD, "/relay", "subscriber").verdict == WAIT


def test_a_peer_that_is_late_once_has_not_left() -> None:
    check = connection(graph({DEAD: HUNG}), "/talker_a", DEAD, "subscriber")
    assert (check.verdict, "registered, but down: no answer from" in check.reason) == (WAIT, True)


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


def test_an_edges_publisher_that_does_not_tell_its_connections() -> None:
    silent = replace(recorded_answers()["/talker_a"], bus=None)
    check = connection(graph({"/talker_a": silent}), "/talker_a", "/relay", "subscriber")
    assert (check.verdict, "are not known" in check.reason) == (WAIT, True)


def test_an_edge_of_a_topic_nobody_registered() -> None:
    assert connection(graph(), "/talker_a", "/relay", topic="/nothing").verdict == WAIT


# ---- the look


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
    ros = FakeRos(healthy())
    wanted = Conditions(nodes=("/relay",), topics=(TopicCondition("/chatter", connected=True),))
    seen = look(ros, wanted)
    assert seen.checks[0] == Check("master", ros.uri, PASS, "answers")
    assert ros.asked == [(recorded_state(), questions(recorded_state(), wanted))]
    assert (seen.verdict, [check.kind for check in seen.checks], seen.unmet) == (PASS, ["master", "node", "topic"], [])
    assert ros.types is False


def test_no_condition_is_a_master_that_answers() -> None:
    assert look(FakeRos(healthy()), Conditions()).verdict == PASS
    assert look(FakeRos(healthy(), error="down"), Conditions()).verdict == WAIT


def test_the_types_are_asked_for_only_when_needed() -> None:
    ros = FakeRos(healthy())
    look(ros, Conditions(topics=(TopicCondition("/chatter", type="std_msgs/String"),)))
    assert ros.types is True


@pytest.mark.parametrize(
    ("latching", "verdict", "reasons"),
    [
        ({"/talker_a", "/talker_b"}, PASS, ["latched by /talker_b", "latched by /talker_a"]),
        ({"/talker_a"}, FAIL, ["/talker_b publishes it without latching", "latched by /talker_a"]),
    ],
)
def test_who_has_to_latch_is_asked_once_all_else_passes(latching: set[str], verdict: str, reasons: list[str]) -> None:
    ros = FakeRos(healthy())
    ros.latching = latching
    topics = (TopicCondition("/chatter", publisher="/talker_b", latched=True), TopicCondition("/chatter", latched=True))
    seen = look(ros, Conditions(topics=topics))
    checks = [check for check in seen.checks if check.kind == "latched"]
    assert (seen.verdict, [check.reason for check in checks]) == (verdict, reasons)
    assert ros.greeted == [("/chatter", ("/talker_b",)), ("/chatter", ("/talker_a", "/talker_b"))]
    assert ros.sampled == {}
    missing = look(ros, Conditions(topics=topics, nodes=("/nobody",)))
    assert [check.verdict for check in missing.checks if check.kind == "latched"] == [WAIT, WAIT]
    assert len(ros.greeted) == 2
    away = without_master("http://m:1/", "down", Conditions(topics=topics))
    assert [check.kind for check in away] == ["master", "topic", "topic", "latched", "latched"]


def test_rates_are_measured_once_all_else_passes() -> None:
    ros = FakeRos(healthy(), Rate(100.0, 100, 1.0))
    wanted = Conditions(topics=(TopicCondition("/chatter", min_rate=90.0), TopicCondition("/work/status", min_rate=2)))
    seen = look(ros, wanted)
    assert seen.verdict == PASS
    assert ros.sampled == {"/chatter": 1.0, "/work/status": 2.0}


def test_what_is_lost_while_rates_are_measured_is_seen() -> None:
    class Losing(FakeRos):
        def rates(self, *args: Any, **kwargs: Any) -> dict[str, Rate]:
            self.error = "nothing listens"
            return super().rates(*args, **kwargs)

    wanted = Conditions(topics=(TopicCondition("/chatter", min_rate=90.0),))
    seen = look(Losing(healthy(), Rate(100.0, 100, 1.0)), wanted)
    assert seen.verdict == WAIT
    assert "nothing listens" in str(seen.unmet[0])


def test_rates_are_not_measured_before() -> None:
    ros = FakeRos(graph())
    seen = look(ros, Conditions(nodes=(DEAD,), topics=(TopicCondition("/chatter", min_rate=90.0),)))
    assert (seen.verdict, ros.sampled) == (WAIT, {})
    assert [check.kind for check in seen.unmet] == ["node", "rate"]


def test_a_failure_outweighs_what_may_still_come() -> None:
    wanted = Conditions(nodes=("/nobody",), topics=(TopicCondition("/chatter", type="std_msgs/Int32"),))
    assert look(FakeRos(healthy()), wanted).verdict == FAIL


def test_without_a_master_every_condition_is_unmet_and_named() -> None:
    wanted = Conditions(
        ("/n",),
        (TopicCondition("/t", min_rate=1.0),),
        ("/s",),
        (ActionCondition("/a"),),
        ("/x",),
        (EdgeCondition("/p", "/t", "/s"),),
        (ValueCondition("/t", quiet=1.0),),
    )
    seen = look(FakeRos(healthy(), error="the ROS master does not answer: nothing listens"), wanted)
    assert seen.verdict == WAIT
    assert [(check.kind, check.name) for check in seen.unmet] == [
        ("master", "http://master:11311/"),
        ("node", "/n"),
        ("topic", "/t"),
        ("rate", "/t"),
        ("service", "/s"),
        ("action", "/a"),
        ("edge", "/p -> /t -> /s"),
        ("absent", "/x"),
        ("value", "/t quiet for 1 s"),
    ]
    assert "nothing listens" in str(seen.unmet[0])
    assert {(check.verdict, check.reason) for check in seen.unmet[1:]} == {(WAIT, "not known without the master")}


class Ears:
    """Has heard this, look by look."""

    def __init__(self, *verdicts: str) -> None:
        self.verdicts = [*verdicts]

    def checks(self, _graph: Graph) -> list[Check]:
        return [Check("value", "/t", self.verdicts.pop(0), "heard")]


def test_what_messages_say_is_part_of_the_verdict() -> None:
    wanted = Conditions(nodes=("/talker_a",), values=(ValueCondition("/t", quiet=1.0),))
    for verdict in (PASS, WAIT, FAIL):
        assert look(FakeRos(healthy()), wanted, ears=Ears(verdict)).verdict == verdict
    assert look(FakeRos(healthy()), wanted).verdict == WAIT  # nobody has listened
    rated = Conditions(topics=(TopicCondition("/chatter", min_rate=90.0),), values=wanted.values)
    ros = FakeRos(healthy())
    assert (look(ros, rated, ears=Ears(WAIT)).verdict, ros.sampled) == (WAIT, {})
    assert look(ros, rated, ears=Ears(PASS, WAIT)).verdict == WAIT  # nor may it end while rates are measured


def test_a_check_as_data() -> None:
    check = Check("node", "/a", WAIT, "not registered", {"pid": None})
    assert check.as_dict() == {
        "kind": "node",
        "name": "/a",
        "verdict": WAIT,
        "reason": "not registered",
        "observed": {"pid": None},
    }
