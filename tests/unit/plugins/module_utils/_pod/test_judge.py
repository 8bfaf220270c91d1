# SPDX-License-Identifier: GPL-3.0-or-later
"""The startup probe's judgement: what keeps a pod from being ready, and what must not."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import FAIL, PASS, WAIT, overall
from ansible_collections.rosops.fleet.plugins.module_utils._pod import judge as probe
from ansible_collections.rosops.fleet.plugins.module_utils._ros import graph as ros
from ansible_collections.rosops.fleet.plugins.module_utils._ros.contract import Contract
from ansible_collections.rosops.fleet.plugins.module_utils._ros.gate import Silence
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import PATIENCE, Handshake, NodeKey, ServiceProbe
from ansible_collections.rosops.fleet.plugins.module_utils._ros.replies import NodeAnswer
from ansible_collections.rosops.fleet.tests.unit.plugins.pod_graph import (
    OWN,
    PUBLISHER,
    SUBSCRIBER,
    World,
    bus,
    contract,
)

OUT, IN = f"edge {OWN} -> /out -> {SUBSCRIBER}", f"edge {PUBLISHER} -> /in -> {OWN}"


def judged(world: World, owed: Contract | None = None, seconds: float = 0.0) -> tuple[str, str]:
    """Verdict, and the reasons of what is not as it should be; `seconds` for which all of it has been so."""
    state = world.state(types=True)
    graph = world.ask(state, probe.first_questions(state, [OWN]))
    missing = probe.gaps(graph, [OWN])
    ends = {end for gap in missing for end in (gap.publisher, gap.subscriber)}
    unasked = {name for name in ends if not graph.node(name).asked}
    peers = world.ask(state, probe.Questions({name: frozenset() for name in unasked}))
    silence = Silence(lambda: seconds)
    asked = silence.noted(graph.answered(map(peers.node, unasked)), 0.0)
    checks = probe.judge(asked, [OWN], owed, [gap for gap in missing if not probe.is_forgiven(gap, owed, seconds)])
    return overall([check.verdict for check in checks]), "; ".join(str(c) for c in checks if c.verdict != PASS)


def changed(world: World, change: str) -> World:
    """With one thing that is other than it should be, or could be."""
    late, refused = {"error": "no answer within 2 s"}, {"error": "nothing listens", "refused": True}
    if change.endswith("subscriber"):  # late or dead: it is not connected either
        world.replies(OWN, bus=bus())
    told: dict[str, Any] = {
        "unheard": (OWN, {"bus": bus()}),
        "said by the subscriber alone": (OWN, {"bus": [[1, "http://x/", "i", "TCPROS", "/in", 1]]}),
        "the publisher lacks us": (PUBLISHER, {"bus": bus(("/in", "/other"))}),
        "late publisher": (PUBLISHER, late),
        "late subscriber": (SUBSCRIBER, late),
        "dead publisher": (PUBLISHER, refused),
        "dead subscriber": (SUBSCRIBER, refused),
        "down": (OWN, refused),
        "tells no connections": (OWN, {"bus": None}),
    }
    if change in told:
        world.replies(told[change][0], **told[change][1])
    elif change == "service not served":
        world.probes["/add"] = ServiceProbe("rosrpc://127.0.0.1:1", error="the connection was closed")
    elif change == "service of another":
        world.services["/add"] = [OWN, "/other"]
        world.probes["/add"] = ServiceProbe("rosrpc://127.0.0.1:1", "/other")
    elif change == "tools":
        world.subscribers["/out"] += ["/rostopic_4711_1700000000000", "/rqt_gui", "/ros_keeper"]
        world.publishers["/in"] += ["/rostopic_4712_1700000000000", "/ros_keeper"]
        world.publishers["/out"] += ["/ros_keeper"]
        for name in (*world.subscribers["/out"][1:], *world.publishers["/in"][1:]):
            world.answers[name] = NodeAnswer("http://192.0.2.1:1/", error="no answer")
    elif change == "rosout is the app":
        world.subscribers["/rosout"] = [OWN]
    else:
        assert change == "nobody there"
        world.subscribers["/out"] = world.publishers["/in"] = []
        world.replies(OWN, bus=bus())
    return world


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("unheard", f"{OUT}: {SUBSCRIBER} is not connected to {OWN}"),
        ("said by the subscriber alone", f"{OUT}: {SUBSCRIBER} is not connected to {OWN}"),
        ("the publisher lacks us", f"{IN}: {OWN} is not connected to {PUBLISHER}"),
        ("late publisher", f"{IN}: {PUBLISHER} is registered, but down: no answer"),
        ("late subscriber", f"{OUT}: {SUBSCRIBER} is registered, but down: no answer within 2 s"),
        ("down", f"node {OWN}: registered, but down"),
        ("service not served", "service /add: registered by"),
        ("service of another", f"service /add: /other answers at rosrpc://127.0.0.1:1, not {OWN}"),
        ("tells no connections", "it does not tell its connections"),
    ],
)
def test_what_is_waited_for(change: str, words: str) -> None:
    world = changed(World(), change)
    verdict, reasons = judged(world)
    assert verdict == WAIT
    assert words in reasons


@pytest.mark.parametrize("change", ["dead subscriber", "dead publisher", "tools", "rosout is the app", "nobody there"])
def test_what_blocks_nobody(change: str) -> None:
    world = changed(World(), change)
    assert judged(world) == (PASS, "")


@pytest.mark.parametrize("change", ["unheard", "the publisher lacks us"])
def test_a_living_peer_must_have_the_new_version_if_it_had_the_old_one(change: str) -> None:
    world = changed(World(), change)
    assert judged(world, contract(), 10 * PATIENCE)[0] == WAIT
    assert judged(world, None, 10 * PATIENCE)[0] == WAIT  # nobody knows what was before
    came_by = contract(edges=[])  # a laptop that cannot reach our node, whose types are others since, ...
    assert judged(world, came_by, PATIENCE - 0.1)[0] == WAIT
    assert judged(world, came_by, PATIENCE) == (PASS, "")


@pytest.mark.parametrize("topic", ["/out", "/in"])
def test_what_is_updated_together_is_connected_before_the_old_versions_go(topic: str) -> None:
    """The other new version may start later, and its old one may not understand this one."""
    new = "/other_0a1b2c3d"
    edge = [OWN, "/out", new] if topic == "/out" else [new, "/in", OWN]
    world, owed = World(), contract(edges=[edge], members=[OWN, new])
    words = f"edge {' -> '.join(edge)}: {new} is not registered with the master"
    assert judged(world, owed, PATIENCE) == (WAIT, words)
    if topic == "/out":
        world.subscribers["/out"].append(new)
        world.replies(OWN, bus=bus(("/out", SUBSCRIBER), ("/out", new)))
    else:
        world.publishers["/in"].append(new)
        world.answers[new] = NodeAnswer("http://127.0.0.1:40005/", 74, bus=bus(("/in", OWN)))
    assert judged(world, owed, PATIENCE) == (PASS, "")
    assert judged(World(), contract(edges=[edge], members=[OWN]), PATIENCE) == (PASS, "")  # it left by itself


def test_a_subscription_is_owed_only_while_somebody_publishes_the_topic() -> None:
    """`rosbag record -a`, a page behind rosbridge: they subscribe to what there is."""
    world, owed = World(), contract(subscriptions={"/clicked_point": {"type": ""}})
    assert judged(world, owed) == (PASS, "")
    world.publishers["/clicked_point"] = [PUBLISHER]
    assert "does not subscribe to /clicked_point" in judged(world, owed)[1]


def test_neither_a_tool_that_hangs_nor_rosout_holds_up_a_look() -> None:
    """rviz publishes, too."""
    world = changed(World(), "tools")
    asked = probe.first_questions(world.state(), [OWN]).nodes
    assert asked == {OWN: frozenset({"bus", "types"}), PUBLISHER: frozenset({"bus"})}


@pytest.mark.parametrize(
    ("owed", "verdict", "words"),
    [
        ({"topics": {"/gone": {"publishers": {OWN: {}}}}}, WAIT, "topic /gone: nobody has registered it"),
        ({"subscriptions": {"/rosout": {"type": ""}}}, WAIT, "does not subscribe to /rosout"),
        ({"services": {"/gone": {"type": "", "md5sum": None}}}, WAIT, "does not offer the service /gone"),
        ({"actions": ["/move"]}, WAIT, "does not serve the action /move"),
        ({"topics": {"/out": {"type": "std_msgs/Bool", "publishers": {OWN: {}}}}}, FAIL,
         f"topic /out: the type is std_msgs/String at {OWN}, not std_msgs/Bool"),
        ({"subscriptions": {"/in": {"type": "std_msgs/Bool"}}}, FAIL,
         f"topic /in: the type is std_msgs/Int32 at {OWN}, not std_msgs/Bool"),
        ({"topics": {"/out": {"type": "", "publishers": {OWN: {}}}}}, PASS, ""),
    ],
)  # fmt: skip
def test_what_the_version_before_gave_is_owed(owed: dict[str, Any], verdict: str, words: str) -> None:
    found = judged(World(), contract(**owed))
    assert found[0] == verdict
    assert words in found[1]


def test_an_action_is_served_with_all_of_its_topics() -> None:
    world, owed = World(), contract(actions=["/move"])
    world.publishers["/move/status"] = world.subscribers["/move/goal"] = [OWN]
    assert judged(world, owed)[0] == WAIT
    world.subscribers["/move/cancel"] = [OWN]
    assert judged(world, owed) == (PASS, "")


@pytest.mark.parametrize(
    ("sums", "service", "words"),
    [
        ({"/out": "bb"}, "aa", ""),
        ({"/out": "bb"}, "", ""),
        ({"/out": "*"}, "*", ""),
        # its handshake was late: what it did not say is no proof
        ({}, "aa", "topic /out: it does not tell the definition of its type"),
        ({"/out": "cc"}, "aa", "topic /out: this version's definition of std_msgs/String has the md5sum cc"),
        (
            {"/out": "bb"},
            "dd",
            "service /add: this version's definition of rospy_tutorials/AddTwoInts has the md5sum dd",
        ),
    ],
)
def test_definitions_must_be_the_same(sums: dict[str, str], service: str, words: str) -> None:
    world = World()
    world.probes["/add"] = ServiceProbe("rosrpc://127.0.0.1:1", OWN, md5sum=service)
    state = world.state()
    said = {name: Handshake(NodeKey(OWN), md5sum) for name, md5sum in sums.items()}
    checks = probe.check_sums(world.ask(state, probe.first_questions(state, [OWN])), contract(), said)
    assert [check.verdict for check in checks] == ([FAIL if sums else WAIT] if words else [])
    assert words in "".join(str(check) for check in checks)
    assert probe.check_sums(world.ask(state, probe.first_questions(state, [OWN])), None, said) == []


@pytest.mark.parametrize(
    ("was", "said", "good"),
    [
        (True, Handshake(NodeKey(OWN), "bb", latching=True), True),
        (True, Handshake(NodeKey(OWN), "bb", latching=False), False),
        (False, Handshake(NodeKey(OWN), "bb", latching=False), True),
        (False, Handshake(NodeKey(OWN), "bb", latching=True), True),
        (True, None, True),  # not published at all, or late: that is said elsewhere
    ],
)
def test_what_was_latched_has_to_be_so_again(was: bool, said: Handshake | None, good: bool) -> None:
    entry = {"type": "std_msgs/String", "publishers": {OWN: {"rate": None, **({"latched": True} if was else {})}}}
    state = World().state()
    graph = World().ask(state, probe.first_questions(state, [OWN]))
    checks = probe.check_sums(graph, contract(topics={"/out": entry}), {"/out": said} if said else {})
    assert [check.name for check in checks] == (["/out"] if was and said else [])
    assert overall([check.verdict for check in checks]) == (PASS if good else FAIL)


def test_what_is_promised_is_owed_and_what_was() -> None:
    world = World()
    state = world.state()
    own = world.ask(state, probe.first_questions(state, [OWN])).node(OWN)

    def least(owed: Contract | None, **promised: float) -> list[tuple[str, str | None, float | None]]:
        rates = {f"/{name}": hz for name, hz in promised.items()}
        return [(one.name, one.publisher, one.min_rate) for one in probe.rated([own], owed, rates)]

    assert least(None) == []
    assert least(None, out=50, others=10) == [("/out", None, 50)]  # what others publish is not this pod's
    assert least(contract(), out=50) == [("/out", OWN, 90.0), ("/out", None, 50)]
    none = {"/out": {"publishers": {OWN: {"rate": None}}}, "/gone": {"publishers": {OWN: {"rate": 5.0}}}}
    assert least(contract(topics=none)) == []
    for given, hz in ((20.0, [("/out", OWN, 20.0)]), (0, [])):  # it is meant to be slower
        slower = contract(topics={"/out": {"publishers": {OWN: {"rate": 100.0, "least": given}}}})
        assert least(slower) == hz
    assert least(contract(tolerance=1)) == []  # any rate will do


def test_what_is_promised_of_a_topic_is_owed_by_all_of_an_apps_nodes_together() -> None:
    """What was recorded of each it owes by itself."""
    one, two = (ros.Node(name, publications=("/diagnostics",)) for name in ("/a_0a1b2c3d", "/b_0a1b2c3d"))
    owed = {"/diagnostics": {"publishers": {one.name: {"rate": 10.0}, two.name: {"rate": None}}}}
    found = probe.rated([one, two], contract(topics=owed), {"/diagnostics": 2.0})
    both = [(it.publisher, it.min_rate) for it in found]
    assert both == [(one.name, 9.0), (None, 2.0)]
