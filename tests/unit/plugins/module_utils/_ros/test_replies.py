# SPDX-License-Identifier: GPL-3.0-or-later
"""What peers answer, recorded, wrong or made to do harm -> the graph."""

from __future__ import annotations

import datetime
import re
import xmlrpc.client
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RefusalError, RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros import replies
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import MasterState
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Connection, names_of
from ansible_collections.rosops.fleet.plugins.module_utils._ros.replies import (
    NodeAnswer,
    build,
    connections,
    loads,
    master_state,
    topic_types,
    unwrap,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import (
    DEAD,
    recorded,
    recorded_answers,
    recorded_state,
)

PLUGINS = Path(replies.__file__).parents[2]
NODES, MASTER = recorded("nodes"), recorded("master")
VALUES = ["<a & b>", "ä", "", -(2**31), 2**31 - 1, 1.5, True, None, [1, ["x", []]], {"a": {"b": [1]}, "c": {}}]
DOCTYPES = [
    '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>',
    '<!DOCTYPE x SYSTEM "file:///etc/passwd">',
    "<!DOCTYPE x>",
    '<!DOCTYPE x [<!ENTITY % p SYSTEM "http://10.0.0.1/x"> %p;]>',
]


def test_it_reads_what_the_library_reads() -> None:
    for values in (
        tuple(VALUES),
        (xmlrpc.client.Binary(b"\0x"), xmlrpc.client.DateTime(datetime.datetime(2026, 1, 2))),
    ):
        call = xmlrpc.client.dumps(values, "twice", allow_none=True).encode()
        assert loads(call) == xmlrpc.client.loads(call) == (values, "twice")
    reply = xmlrpc.client.dumps((VALUES,), methodresponse=True, allow_none=True).encode()
    assert loads(reply) == xmlrpc.client.loads(reply)
    with pytest.raises(xmlrpc.client.Fault, match="no"):
        loads(xmlrpc.client.dumps(xmlrpc.client.Fault(1, "no")).encode())
    long = b"<params><param><value><i8>-9223372036854775808</i8></value></param></params>"
    assert loads(long) == ((-(2**63),), None)


@pytest.mark.parametrize("doctype", DOCTYPES)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_a_document_type_is_refused(doctype: str, encoding: str) -> None:
    text = f'<?xml version="1.0" encoding="{encoding}"?>{doctype}<params><param><value>x</value></param></params>'
    with pytest.raises(RosError, match="document type or entities"):
        loads(text.encode(encoding))


@pytest.mark.parametrize("tag", ["i1", "i2", "i4", "i8", "int", "biginteger", "x:int"])
def test_a_number_ends(tag: str) -> None:
    with pytest.raises(RosError, match="more than 20 digits"):
        loads(f"<params xmlns:x='x'><param><value><{tag}>{'7' * 21}</{tag}></value></param></params>".encode())


@pytest.mark.parametrize("nest", ["<array><data><value>", "<struct><member><name>a</name><value>"])
def test_a_value_ends(nest: str) -> None:
    """A list in lists is nothing that a repr, a comparison or a copy gets to the end of."""
    with pytest.raises(RosError, match="more than 300 tags within each other"):
        loads(f"<params><param><value>{nest * 50_000}".encode())


@pytest.mark.parametrize(
    "body", [b"", b"<params>", b"<params><param><value><int>x</int></value></param></params>", b"\xff"]
)
def test_what_is_no_xml_rpc_is_an_error_of_ours(body: bytes) -> None:
    with pytest.raises(RosError, match="it is nonsense"):
        loads(body)


def test_nobody_else_parses_xml_of_peers() -> None:
    """`launch_file` reads what a user wrote, on the control node, and refuses entities in words of its own."""
    parsing = re.compile(r"xmlrpc\.client\.(loads|getparser|ServerProxy)|\bexpat\b|ElementTree|minidom|xml\.sax")
    found = {
        str(file.relative_to(PLUGINS)) for file in PLUGINS.rglob("*.py") if parsing.search(file.read_text("utf-8"))
    }
    own_container = "plugin_utils/_objects/master.py"  # the probe of the master asks the master beside it
    assert found == {"module_utils/_ros/replies.py", "plugin_utils/_validate/launch_file.py", own_container}


@pytest.mark.parametrize(
    ("reply", "value"),
    [
        ([1, "", 7], 7),
        (NODES["/relay"]["getPid"], NODES["/relay"]["getPid"][2]),
        (MASTER["lookupNode unknown"], RefusalError("unknown node")),
        (MASTER["lookupService unknown"], RefusalError("no provider")),
        (NODES["/talker_a"]["requestTopic unknown"], RefusalError("Not a publisher")),
        ([0, "", 7], RefusalError("code 0")),
        *((nonsense, RosError("not [code")) for nonsense in ([True, "", 7], [1, "short"], ["x", "", 1], "text", None)),
        (NODES["/relay"]["getBusStats"], RosError("not [code")),  # roscpp's bare list
    ],
)
def test_the_value_of_a_reply(reply: Any, value: Any) -> None:
    if not isinstance(value, RosError):
        assert unwrap(reply) == value
        return
    with pytest.raises(RosError, match=re.escape(str(value))) as error:
        unwrap(reply)
    assert type(error.value) is type(value)


@pytest.mark.parametrize(
    ("raw", "expected"),
    [
        (None, []),
        ("text", []),
        ([None, 5, "abcdef", [], [1, "/a", "o"]], []),
        ([[1, 7, "o", "TCPROS", "/t", 1]], []),
        ([[1, "/a", "o", "TCPROS", "/t"]], [Connection("/t", "/a", "o", "TCPROS", True)]),
        ([[1, "/a", "o", "TCPROS", "/t", 0, 5, "more"]], [Connection("/t", "/a", "o", "TCPROS", False)]),
        # whatever carries it: roscpp connects by UDPROS where a subscriber asks for it (`TransportHints().udp()`)
        ([[1, "/viewer", "o", "UDPROS", "/image", 1]], [Connection("/image", "/viewer", "o", "UDPROS", True)]),
    ],
)
def test_rows_of_bus_info(raw: Any, expected: list[Connection]) -> None:
    assert list(connections(raw)) == expected


def test_the_masters_state() -> None:
    state = recorded_state()
    assert state.publishers["/chatter"] == ("/talker_a", "/talker_b")
    assert state.subscribers["/chatter"] == ("/listener_a", "/listener_b", DEAD, "/relay")
    assert state.services["/trigger"] == ("/helper",)
    assert state.types["/chatter"] == "std_msgs/String"
    assert {*NODES, DEAD} == set(state.nodes())
    for raw in (None, [], [[], []], "state", 7):
        with pytest.raises(RosError):
            master_state(raw)
    publishers = [["/t", ["/a", 5, None]], ["/u", "x"], [7, ["/a"]], "junk"]
    state = master_state([publishers, [], "junk"], [["/t", "a/B"], [1, 2]])
    assert state == MasterState({"/t": ("/a",)}, {}, {}, {"/t": "a/B"})
    assert topic_types("junk") == {}


# ---- what they are to the graph


def test_the_recorded_graph() -> None:
    graph = build(recorded_state(), recorded_answers())
    relay = graph.node("/relay")
    assert (relay.reachable, relay.publications) == (True, ("/chatter_relay", "/rosout"))
    types = {"/rosout": "rosgraph_msgs/Log", "/chatter_relay": "std_msgs/String", "/chatter": "*"}
    assert relay.own_types == types
    assert (graph.node(DEAD).reachable, graph.node(DEAD).connections) == (False, None)
    assert [names_of(ends) for ends in graph.topics["/chatter_relay"].connections] == [["/relay", "/listener_relay"]]
    assert graph.topics["/chatter"].connects("/talker_b", "/relay")
    assert graph.topics["/work/goal"].connects("/asker", "/worker")


def test_a_node_nobody_asked_is_neither_up_nor_wrong_and_one_the_master_no_longer_lists_is_there() -> None:
    node = build(recorded_state(), {}).node("/talker_a")
    assert (node.asked, node.reachable, node.error, node.uri) == (False, False, "", "")
    assert node.services == ("/talker_a/get_loggers", "/talker_a/set_logger_level")
    assert build(MasterState(), {"/gone": NodeAnswer("http://h:1/", 7)}).node("/gone").reachable
