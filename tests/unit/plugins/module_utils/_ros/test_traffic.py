# SPDX-License-Identifier: GPL-3.0-or-later
"""What was lost of traffic in which nodes were replaced."""

from __future__ import annotations

from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError, RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros import traffic
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Connection, Graph, Node, NodeKey, Topic
from ansible_collections.rosops.fleet.plugins.module_utils._ros.traffic import Traffic, Watcher, has_number

SCAN, OLD, NEW, MAP, MAP2 = "/scan", "/lidar_00000001", "/lidar_00000002", "/mapping_0000000a", "/mapping_0000000b"
HEADER = "uint32 seq\ntime stamp\nstring frame_id\n"


def graph(*connections: tuple[str, str], silent: str = "", refused: bool = False) -> Graph:
    """/scan with who is connected to whom; `silent` is a publisher that does not answer."""
    edges = tuple((NodeKey(publisher), NodeKey(subscriber)) for publisher, subscriber in connections)
    bus = (Connection(SCAN, "x", "o", "TCPROS", True),)
    nodes = {key: Node(key.name, pid=1, asked=True, connections=bus) for key, _subscriber in edges}
    if silent:
        nodes[NodeKey(silent)] = Node(silent, asked=True, refused=refused)
    return Graph(nodes, {SCAN: Topic(SCAN, "t/T", tuple(sorted(nodes)), tuple({one for _key, one in edges}), edges)})


def watched(*looks: Graph) -> Traffic:
    traffic = Traffic()
    for look in looks:
        traffic.look(look)
    return traffic


def take(traffic: Traffic, *numbers: int | None) -> None:
    """One publisher's messages, a tenth of a second apart."""
    topic, before = traffic.topics[SCAN], None
    topic.publishers += 1
    for number in numbers:
        topic.take((topic.last or 0.0) + 0.1, number, before)
        before = number


def test_apps_that_hand_over_lose_nothing() -> None:
    traffic = watched(
        graph((OLD, MAP)), graph((OLD, MAP), (NEW, MAP)), graph((NEW, MAP)), graph((NEW, MAP), (NEW, MAP2)),
        graph((NEW, MAP2)),
    )  # fmt: skip
    take(traffic, 5, 6, 7)
    take(traffic, 0, 1, 2)
    assert traffic.problems([]) == []
    assert traffic.as_dict()[SCAN] == {
        "messages": 6,
        "publishers": 2,
        "numbered": True,
        "missing": 0,
        "longest_gap": 0.1,
        "unconnected_looks": {"/mapping": 0},
    }


@pytest.mark.parametrize(
    ("numbers", "missing"), [((1, 2, 4), 1), ((1, 12), 10), ((1, 102, 103), 100), ((2**32 - 1, 1), 1)]
)
def test_a_hole_in_one_publisher_s_numbers_is_lost(numbers: tuple[int, ...], missing: int) -> None:
    traffic = watched(graph((OLD, MAP)))
    take(traffic, *numbers)
    assert traffic.problems([]) == [f"/scan: {missing} of {len(numbers) + missing} messages are missing"]
    assert traffic.problems([SCAN]) == []


@pytest.mark.parametrize("numbers", [(0, 0, 0), (7, 3, 4), (2**32 - 1, 0), (None, None)])
def test_numbers_that_say_nothing_are_no_loss(numbers: tuple[int | None, ...]) -> None:
    traffic = watched(graph((OLD, MAP)))
    take(traffic, *numbers)
    assert traffic.problems([]) == []
    told = traffic.as_dict()[SCAN]
    assert (told["messages"], told["missing"]) == (len(numbers), None if None in numbers else 0)


def test_an_app_without_a_publisher_is_said() -> None:
    traffic = watched(graph((OLD, MAP)), graph((OLD, "/other")), graph(), graph((NEW, MAP2), (NEW, "/other")))
    take(traffic, 1)
    assert traffic.problems([]) == [
        "/scan: /mapping was not connected in 2 of 4 looks",
        "/scan: /other was not connected in 1 of 4 looks",
    ]
    assert traffic.problems([SCAN]) == []


@pytest.mark.parametrize(("refused", "missed"), [(False, 0), (True, 1)])
def test_a_publisher_that_is_late_to_answer_may_be_connected_one_that_is_gone_is_not(
    refused: bool, missed: int
) -> None:
    traffic = watched(graph((OLD, MAP)), graph(silent=OLD, refused=refused))
    assert traffic.topics[SCAN].unconnected == {"/mapping": missed}


def test_whoever_saw_nothing_has_not_proven_anything() -> None:
    assert Traffic().problems([]) == ["no message was seen on any topic"]
    assert watched(graph((OLD, MAP))).problems([]) == ["no message was seen on any topic"]


def test_logs_and_topics_without_a_listener_are_none_of_it() -> None:
    old, map_, keeper, looking = map(NodeKey, (OLD, MAP, "/ros_keeper", "/rosops_fleet_17"))
    topics = [
        Topic("/rosout", subscribers=(map_,), connections=((old, map_),)),
        Topic("/tf", publishers=(old,)),
        Topic("/looked_at", connections=((old, looking),)),  # by somebody who is not registered
        Topic("/kept", subscribers=(keeper,), connections=((old, keeper),)),
    ]
    assert watched(Graph({}, {topic.name: topic for topic in topics})).topics == {}


@pytest.mark.parametrize(
    ("text", "numbered"),
    [
        (f"Header header\nfloat64 x\n{'=' * 80}\nMSG: std_msgs/Header\n{HEADER}", True),
        (f"float64 x\nHeader header\n{'=' * 80}\nMSG: std_msgs/Header\n{HEADER}", False),
        (f"Header[] headers\n{'=' * 80}\nMSG: std_msgs/Header\n{HEADER}", False),
        ("float64 x\n", False),
        ("", False),
    ],
)
def test_a_number_is_that_of_a_header_at_the_beginning(text: str, numbered: bool) -> None:
    said = {"type": "demo/Scan", "message_definition": text}
    assert has_number(said) is numbered
    assert not has_number({**said, "latching": "1"})  # rospy counts what it gives to each that comes later, too


def test_it_is_listened_until_the_end_and_looked_once_more(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    end, looks = tmp_path / "end", list[int]()

    def look(_watcher: object) -> None:
        looks.append(1)
        if len(looks) == 2:
            end.touch()
        if len(looks) != 2:  # a master that is replaced, and one that stays away
            raise RosError("no answer")

    monkeypatch.setattr(Watcher, "look", look)
    monkeypatch.setattr(traffic, "PAUSE", 0)
    asked = {"master_uri": "http://m:1", "end_file": str(end), "may_pause": []}
    found = traffic.watch({**asked, "seconds": 60})
    assert found["problems"] == ["no message was seen on any topic", "the last look failed: no answer"]
    assert (len(looks), found["topics"]) == (3, {})
    end.unlink()
    with pytest.raises(FleetError, match="end is not there after 0 s"):
        traffic.watch({**asked, "seconds": 0})
