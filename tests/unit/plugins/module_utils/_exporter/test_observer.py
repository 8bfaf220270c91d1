# SPDX-License-Identifier: GPL-3.0-or-later
"""The exporter's look at peers that answer, refuse, hang or talk nonsense."""

from __future__ import annotations

import threading
import time
from contextlib import nullcontext
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.exporter import OPTIONS, Exporter
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.observer import Observer
from ansible_collections.rosops.fleet.plugins.module_utils._ros import client
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers, recorded

NODES = recorded("nodes")


def node(**changes: Any) -> dict[str, Any]:
    replies = {call: NODES["/talker_a"][call] for call in ("getPid", "getBusInfo", "getBusStats")}
    return {**replies, **changes}


def overflow(*_args: Any) -> Any:
    raise OverflowError("int exceeds XML-RPC limits")


def exporter(uri: str, timeout: float) -> Exporter:
    """One of which no thread runs."""
    return Exporter(uri, {**OPTIONS, "--timeout": str(timeout), "--updates": "/nonexistent"}, print)


def of_master(peers: Peers, nodes: dict[str, str], timeout: float = 0.5, **more: Any) -> Exporter:
    """One of a master that has these nodes, each subscribed to /chatter, and answers more."""
    look_up = {name: [1, "node api", uri] if uri else [-1, "unknown node", ""] for name, uri in nodes.items()}
    state = [1, "", [[], [["/chatter", list(nodes)]], []]]
    return exporter(peers.api("master", {"getSystemState": state, "lookupNode": look_up.get, **more}), timeout)


def errors(made: Exporter) -> dict[str, int]:
    return {why: number for why, number in made.snapshot.history.errors.items() if number}


def test_good_and_bad_nodes_side_by_side(peers: Peers) -> None:
    nodes = {
        "/good": peers.api("good", node()),
        "/cpp": peers.api("cpp", node(getBusStats=NODES["/relay"]["getBusStats"])),
        "/over": peers.api("over", node(getBusStats=overflow)),
        "/odd": peers.api("odd", node(getPid=[1, "", "seven"])),
        "/hung": f"http://127.0.0.1:{peers.hung()}/",
        "/dead": "http://127.0.0.1:9/",
        "/unknown": "",
    }
    made = of_master(peers, nodes)
    began = time.monotonic()
    made.poll()
    ros = made.snapshot.ros
    assert ros["ros_node_up"] == {name: name in ("/good", "/cpp", "/over") for name in nodes}
    assert {key[1] for key in ros["ros_topic_messages_total"]} == {"/good", "/cpp"}
    assert errors(made) == {"timeout": 1, "refused": 1, "fault": 1, "malformed": 1, "overflow": 1}
    assert time.monotonic() - began < 30  # of one that hangs for ever
    assert {method for _label, method in peers.calls} <= {  # none of them changes anything
        "getSystemState", "lookupNode", "getParam", "system.multicall", "getPid", "getBusInfo", "getBusStats",
    }  # fmt: skip


def test_only_so_many_at_once(peers: Peers, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Observer, "at_once", 3)
    lock, now, most = threading.Lock(), [0], [0]

    def slow(*_args: Any) -> Any:
        with lock:
            now[0] += 1
            most[0] = max(most[0], now[0])
        time.sleep(0.03)
        with lock:
            now[0] -= 1
        return [1, "", 7]

    nodes = {f"/n{i}": peers.api(f"n{i}", node(getPid=slow)) for i in range(12)}
    made = of_master(peers, nodes, 2)
    made.poll()
    assert all(made.snapshot.ros["ros_node_up"].values())
    assert most[0] == 3


@pytest.mark.parametrize(
    ("reply", "why"),
    [([1, "", 7], "malformed"), ([-1, "no", 0], "fault"), ("nonsense", "malformed"), (None, "timeout")],
)
def test_a_master_that_is_none(peers: Peers, reply: Any, why: str) -> None:
    hangs = f"http://127.0.0.1:{peers.hung()}/"
    made = exporter(peers.api("master", {"getSystemState": reply}) if reply else hangs, 0.5)
    made.poll()
    assert (made.snapshot.ros, errors(made)) == ({"ros_master_up": {(): 0}}, {why: 1})


def test_launch_files_where_there_are_nodes(peers: Peers, monkeypatch: pytest.MonkeyPatch) -> None:
    """A few at a time, and none of a pod that is gone."""
    monkeypatch.setattr(Observer, "at_once", 2)
    answers = {"process_info": lambda _name: [-1, "no process by that name", {}]}
    servers = {
        name: peers.api(name, {**answers, "list_processes": [1, "", [[[f"{name}-1", 2]], []]]}, caller=False)
        for name in ("a", "b", "c")
    }
    told = {**servers, "hung": f"http://127.0.0.1:{peers.hung()}/", "elsewhere": "http://192.0.2.1:4711/"}
    made = of_master(peers, {"/good": peers.api("good", node()), "/unknown": ""}, getParam=[1, "", told])
    began = time.monotonic()
    made.poll()
    ros = made.snapshot.ros
    assert ros["ros_launch_process_up"] == dict.fromkeys(("/a", "/b", "/c"), True)
    assert ros["ros_launch_process_starts_total"] == dict.fromkeys(("/a", "/b", "/c"), 2)
    assert (ros["ros_node_up"]["/good"], time.monotonic() - began < 30) == (True, True)


def test_services_and_actions_of_a_node(peers: Peers, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[str] = []
    monkeypatch.setattr(client, "greet", lambda service, *_: {"/up": {}}[service])
    monkeypatch.setattr(client, "subscribe_status", lambda action, *_: nullcontext({"/idle": "/idle"}[action]))
    monkeypatch.setattr(client, "read_states", lambda action: read.append(action) or ())
    topics = [[[f"/{action}/{part}", ["/n"]] for action in ("idle", "broken") for part in parts]
              for parts in (("status",), ("goal", "cancel"))]  # fmt: skip
    services = [[name, ["/n"]] for name in ("/up", "/mute", "/unknown", "/n/get_loggers")]
    where = {"/up": "rosrpc://n:1", "/mute": "rosrpc://n:2"}
    made = of_master(
        peers,
        {"/n": peers.api("n", node())},
        getSystemState=[1, "", [*topics, services]],
        lookupService=lambda name: [1, "", where[name]] if name in where else [-1, "no provider", ""],
    )
    made.poll()
    ros = made.snapshot.ros
    assert ros["ros_service_up"] == {("/up", "/n"): True, ("/mute", "/n"): False, ("/unknown", "/n"): False}
    assert ({key[0] for key in ros["ros_action_goals"]}, read) == ({"/idle"}, ["/idle"])  # one message of it
    assert errors(made) == {"malformed": 2, "fault": 1}
