# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A recorded graph as parts for stand-ins: who plays what, what is left out, and what a damaged file says."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._rehearsal.recording import (
    KIND,
    OTHERS,
    Called,
    Node,
    Published,
    parts,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._rehearsal.recordings import RECORDING

PARTS = parts(RECORDING, "it")
DEFINITION = RECORDING["graph"]["topics"]["/temperature"]["definition"]


def test_nodes_are_their_apps_by_address_and_others_are_of_none() -> None:
    """Of apps with their host's address nobody knows which one it is."""
    assert {app: (part.placement, [node.name for node in part.nodes]) for app, part in PARTS.items()} == {
        "temperature": ("local", ["/temperature"]),
        "temperature-stats": ("remote", ["/arm/helper", "/temperature_stats"]),
        OTHERS: ("local", ["/loner"]),
    }


def test_what_a_node_plays_has_no_revision() -> None:
    assert PARTS["temperature"].nodes == (
        Node(
            "/temperature",
            (Published("/temperature", "demo/Temperature", DEFINITION, latched=False, rate=250.0),),
            (),
            (Called("/temperature/reset", "demo/Home", "home"),),
        ),
    )


def test_what_is_latched_who_serves_and_how_often_an_action_tells() -> None:
    """Loggers and what does not answer are left out; a status that nobody listened to is sent all the same."""
    helper, stats = PARTS["temperature-stats"].nodes
    assert [(one.name, one.latched, one.rate) for one in helper.publishes] == [
        ("/map", True, 0.0),
        ("/work/status", True, 5.0),
    ]
    assert [one.name for one in helper.services] == ["/home"]
    assert stats.subscribes == (Called("/temperature", "demo/Temperature", "temperature"),)


def test_nobody_sends_goals_of_zeros_or_what_nobody_has_defined() -> None:
    [loner] = PARTS[OTHERS].nodes
    assert {one.name: one.rate for one in loner.publishes} == {"/temperature": 250.0, "/work/goal": 0.0}
    assert loner.subscribes == (Called("/unknown", "", ""),)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ([], "r.json is no recording of a robot's graph: rosops.fleet.record makes one"),
        ({"kind": "something"}, "r.json is no recording of a robot's graph"),
        ({**RECORDING, "version": 7}, "r.json is of version 7, not 1: record the robot again"),
        ({**RECORDING, "graph": {}}, r"r.json is damaged \(KeyError: 'nodes'\): record the robot again"),
        ({**RECORDING, "apps": ["x"]}, r"r.json is damaged \(TypeError: "),
        (
            {"kind": KIND, "version": 1, "apps": [], "graph": {**RECORDING["graph"], "nodes": []}},
            r"r.json is damaged \(AttributeError: ",
        ),
    ],
)
def test_another_file(data: Any, said: str) -> None:
    with pytest.raises(SpecError, match=said):
        parts(data, "r.json")
