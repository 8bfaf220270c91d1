# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A recording of the recorded graph: what is in it, what is not, and what a damaged file says."""

from __future__ import annotations

import json
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import (
    Handshake,
    Node,
    Rate,
    Service,
    ServiceProbe,
    everything,
)
from ansible_collections.rosops.fleet.plugins.module_utils._ros.recording import (
    App,
    Findings,
    Recording,
    Sent,
    Topic,
    flat,
    recorded,
)
from ansible_collections.rosops.fleet.plugins.module_utils._ros.replies import build
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import DEAD, recorded_answers, recorded_state

MD5 = "992ce8a1687cec8c8bd883ec73ca41d1"
HIDDEN = "hunter2"
TREE = {
    "rosdistro": "noetic",
    "run_id": "1",
    "roslaunch": {"uris": {"host": "http://x/"}},
    "camera_1a2b3c4d": {"token": HIDDEN, "rate": 30},
    "speeds": [0.5, 1.0],
}


def findings(**more: Any) -> Findings:
    state = recorded_state()
    graph = build(state, recorded_answers())
    handshakes = {
        ("/chatter", "/talker_a"): Handshake("/talker_a", MD5, latching=False, definition="string data\n"),
        ("/chatter", "/talker_b"): Handshake("/talker_b", MD5, latching=True, definition="string data\n"),
    }
    rates = {"/chatter": Rate(12.0, 48, 4.0, by={"/talker_a": Rate(10.0, 40, 4.0), "/talker_b": Rate(error="silent")})}
    return Findings(graph, handshakes, rates, dict(flat(TREE)), **more)


def test_a_topic() -> None:
    chatter = recorded("robot1", findings(), {}, ()).topics["/chatter"]
    assert (chatter.type, chatter.md5sum, chatter.definition) == ("std_msgs/String", MD5, "string data\n")
    assert chatter.publishers == {"/talker_a": Sent(10.0, latched=False), "/talker_b": Sent(None, latched=True)}
    assert ("/talker_a", "/listener_relay") not in chatter.edges
    assert {one for one, _two in chatter.edges} <= {"/talker_a", "/talker_b"}
    assert chatter.edges == tuple(sorted(chatter.edges)) != ()


def test_what_is_no_part_of_the_robot_is_left_out() -> None:
    found = recorded("robot1", findings(), {}, ())
    text = json.dumps(found.as_dict())
    assert '"/rosout"' not in text
    assert DEAD not in text
    assert "get_loggers" not in text
    assert "/relay" in found.others
    assert found.others == tuple(sorted(found.others))


def test_parameters_have_no_values_but_those_that_are_asked_for() -> None:
    found = recorded("robot1", findings(plain={"/camera_1a2b3c4d": "/camera"}), {}, ["/speeds", "/camera_1a2b3c4d/r"])
    assert found.parameters == {"/camera/rate": "int", "/camera/token": "str", "/speeds": "list"}
    assert found.values == {"/speeds": [0.5, 1.0]}
    assert HIDDEN not in json.dumps(found.as_dict())
    assert recorded("robot1", findings(), {}, ["/"]).values["/camera_1a2b3c4d/token"] == HIDDEN


def test_apps_by_names_without_revisions() -> None:
    found = findings(
        owners={"/talker_a": "talk", "/relay": "relay"}, plain={"/talker_a": "/talker", "/relay": "/relay"}
    )
    made = recorded("robot1", found, {"relay": "remote"}, ())
    assert made.apps == {"relay": App("remote", ("/relay",)), "talk": App("local", ("/talker",))}
    assert not {"/talker_a", "/talker", "/relay"} & set(made.others)
    assert "/talker" in made.topics["/chatter"].publishers
    assert "/talker" in {one for one, _two in made.topics["/chatter"].edges}


def test_a_service_that_answers_is_its_provider_s() -> None:
    given = findings()
    nodes = {"/adder": Node("/adder", pid=1, asked=True), "/dead": Node("/dead", asked=True)}
    services = {
        "/sum": Service("/sum", ("/adder",), ServiceProbe("rosrpc://x", "/adder", "demo/Sum", md5sum="aa")),
        "/gone": Service("/gone", ("/adder",), ServiceProbe(error="refused")),
        "/ghost": Service("/ghost", ("/dead",), ServiceProbe("rosrpc://x", "", "demo/Sum", md5sum="aa")),
        "/unasked": Service("/unasked", ("/adder",)),
    }
    graph = type(given.graph)(nodes, {}, services, {})
    made = recorded("robot1", Findings(graph), {}, ())
    assert {name: one.provider for name, one in made.services.items()} == {"/sum": "/adder"}
    assert everything(recorded_state()).services  # which are asked


def test_an_action() -> None:
    made = recorded("robot1", findings(), {}, ()).actions["/work"]
    assert made.servers == ("/worker",)


def test_the_file_says_all_of_it() -> None:
    found = recorded("robot1", findings(owners={"/relay": "relay"}), {}, ["/speeds"])
    text = json.dumps(found.as_dict(), sort_keys=True)
    assert Recording.from_dict(json.loads(text), "it") == found
    assert json.dumps(
        recorded("robot1", findings(owners={"/relay": "relay"}), {}, ["/speeds"]).as_dict()
    ) == json.dumps(found.as_dict())


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"kind": "something"}, "r.json is no recording of a robot's graph: rosops.fleet.record makes one"),
        ({"version": 7}, "r.json is of version 7, not 1: record the robot again"),
        ({"topics": {"/a": {}}}, "r.json is damaged (KeyError: 'publishers'): record the robot again"),
        ({"apps": []}, "r.json is damaged (AttributeError: "),
        ({"services": {"/a": {"what": 1}}}, "r.json is damaged (TypeError: "),
    ],
)
def test_another_file(change: dict[str, Any], said: str) -> None:
    with pytest.raises(SpecError) as raised:
        Recording.from_dict({**Recording("robot1", topics={"/a": Topic()}).as_dict(), **change}, "r.json")
    assert str(raised.value).startswith(said)
    with pytest.raises(SpecError, match="no recording"):
        Recording.from_dict([], "r.json")
