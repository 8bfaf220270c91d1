# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.conditions import (
    ActionCondition,
    Conditions,
    EdgeCondition,
    TopicCondition,
    ValueCondition,
    conditions_from,
)


def test_conditions_from_the_modules_options() -> None:
    found = conditions_from(
        {
            "namespace": "/robot1",
            "nodes": ["talker", "/rosout"],
            "topics": [
                {"name": "chatter", "type": "std_msgs/String", "publishers": 1, "connected": True, "min_rate": 450.0},
                {"name": "/cmd", "type": None, "publishers": None, "subscribers": 0, "connected": None, "min_rate": 0},
                {"name": "/u", "publisher": "p", "latched": True},
            ],
            "services": [{"name": "add"}],
            "actions": [{"name": "move", "state": "idle"}, {"name": "/look"}],
            "absent": ["/old_1234"],
            "edges": [{"publisher": "talker", "topic": "chatter", "subscriber": "/ear", "peer": "subscriber"}],
            "values": [
                {"topic": "battery", "field": "percentage", "above": 0.4, "below": None, "tolerance": 0.0},
                {"topic": "/odom", "still": 5.0, "tolerance": 0.01},
                {"topic": "/dock", "field": "states[0].word", "equals": False},
            ],
        }
    )
    assert found == Conditions(
        nodes=("/robot1/talker", "/rosout"),
        topics=(
            TopicCondition("/robot1/chatter", "std_msgs/String", 1, None, True, 450.0),
            TopicCondition("/cmd", None, None, 0, False, 0),
            TopicCondition("/u", publisher="/robot1/p", latched=True),
        ),
        services=("/robot1/add",),
        actions=(ActionCondition("/robot1/move", "idle"), ActionCondition("/look", "up")),
        absent=("/old_1234",),
        edges=(EdgeCondition("/robot1/talker", "/robot1/chatter", "/ear", "subscriber"),),
        values=(
            ValueCondition("/robot1/battery", "percentage", above=0.4),
            ValueCondition("/odom", still=5.0, tolerance=0.01),
            ValueCondition("/dock", "states[0].word", equals=False),
        ),
    )
    assert [str(value) for value in found.values] == [
        "/robot1/battery percentage above 0.4",
        "/odom still for 5 s",
        "/dock states[0].word equal to False",
    ]


@pytest.mark.parametrize(
    ("params", "path"),
    [
        ({"nodes": ["a b"]}, "nodes[0]"),
        ({"nodes": ["/ok", ""]}, "nodes[1]"),
        ({"nodes": ["/a//b"]}, "nodes[0]"),
        ({"nodes": ["/a\n"]}, "nodes[0]"),
        ({"nodes": ["tälker"]}, "nodes[0]"),
        ({"absent": ["~private"]}, "absent[0]"),
        ({"topics": [{"name": "/t", "type": "String"}]}, "topics[0].type"),
        ({"topics": [{"name": "/t", "publishers": -1}]}, "topics[0].publishers"),
        ({"topics": [{"name": "/t", "min_rate": -0.5}]}, "topics[0].min_rate"),
        ({"topics": [{"name": "/t", "min_rate": float("inf")}]}, "topics[0].min_rate"),
        ({"services": [{"name": "a.b"}]}, "services[0].name"),
        ({"namespace": "a b"}, "namespace"),
        ({"nodes": ["a"], "absent": ["/a"]}, "absent"),
        ({"timeout": -1.0}, "timeout"),
        ({"interval": 0.0}, "interval"),
        ({"consecutive": 0}, "consecutive"),
        ({"node_timeout": 0.0}, "node_timeout"),
        ({"stable": -1.0}, "stable"),
        ({"stable": 10.0, "timeout": 5.0}, "stable"),
        ({"topics": [{"name": "/t", "publisher": "a b"}]}, "topics[0].publisher"),
        ({"edges": [{"publisher": "/a", "topic": "/t"}]}, "edges[0].subscriber"),
        ({"edges": [{"publisher": "/a", "topic": "t!", "subscriber": "/b"}]}, "edges[0].topic"),
        ({"values": [{"topic": "t?", "quiet": 1.0}]}, "values[0].topic"),
        ({"values": [{"quiet": 1.0}]}, "values[0]"),
        ({"values": [{"url": "/idle"}]}, "values[0].url"),
        ({"values": [{"url": "http://a/", "above": 1.0}]}, "values[0].url"),
        ({"values": [{"topic": "/t", "field": "x"}]}, "values[0]"),
        ({"values": [{"topic": "/t", "field": "x", "above": 1.0, "equals": 2}]}, "values[0]"),
        ({"values": [{"topic": "/t", "quiet": 1.0, "still": 1.0}]}, "values[0]"),
        ({"values": [{"topic": "/t", "above": 1.0}]}, "values[0].field"),
        ({"values": [{"topic": "/t", "field": "x..y", "quiet": 1.0}]}, "values[0].field"),
        ({"values": [{"topic": "/t", "field": "x", "below": float("nan")}]}, "values[0].below"),
        ({"values": [{"topic": "/t", "still": 0.0}]}, "values[0].still"),
        ({"values": [{"topic": "/t", "quiet": 5.0}], "timeout": 4.0}, "values[0].quiet"),
        ({"values": [{"topic": "/t", "quiet": 5.0, "tolerance": -0.1}]}, "values[0].tolerance"),
    ],
)
def test_a_bad_option_is_named_with_its_path(params: dict[str, Any], path: str) -> None:
    with pytest.raises(SpecError) as caught:
        conditions_from(params)
    assert [error.split(":")[0] for error in caught.value.details["errors"]] == [path]


def test_all_bad_options_come_in_one_error() -> None:
    with pytest.raises(SpecError) as caught:
        conditions_from({"nodes": ["?"], "absent": ["!"], "timeout": -1.0, "services": [{"name": ""}]})
    assert len(caught.value.details["errors"]) == 4
    assert all(error in str(caught.value) for error in caught.value.details["errors"])
