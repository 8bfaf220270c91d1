# SPDX-License-Identifier: GPL-3.0-or-later
"""What is registered and what is asked; and the seam for another kind of ROS: who knows the answers alone."""

from __future__ import annotations

from pathlib import PurePosixPath

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import MasterState, around
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import names_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.pod_code import MODULE_UTILS
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import recorded_state
from imports import imported

ANSWERS = {"arrivals", "graph", "graph_json", "names", "conditions", "checks", "contract", "gate", "backend"}


@pytest.mark.parametrize("name", [*sorted(f"_ros.{name}" for name in ANSWERS), "_pod.judge"])
def test_what_knows_the_answers_alone_imports_no_protocol(name: str) -> None:
    path = PurePosixPath(f"plugins/module_utils/{name.replace('.', '/')}.py")
    text = (MODULE_UTILS.parents[1] / path).read_text("utf-8")
    ours = [one.split(".")[2:4] for one in imported(path, text) if one.startswith("plugins.module_utils.")]
    assert {module for room, module in ours if room != "_common"} <= ANSWERS
    assert {room for room, _module in ours} <= {"_common", "_ros"}


def test_a_server_is_one_node_with_all_of_it() -> None:
    [action] = recorded_state().graph.actions.values()
    assert (action.name, action.type) == ("/work", "actionlib/TestAction")
    assert (names_of(action.servers), names_of(action.clients)) == (["/worker"], ["/asker"])
    state = MasterState(
        {"/x/status": ("/a",), "/y/status": ("/a", "/b")},
        {"/x/goal": ("/b",), "/x/cancel": ("/b",), "/y/goal": ("/b",), "/y/cancel": ("/b", "/a")},
    )
    assert list(state.graph.actions) == ["/y"]
    assert (state.servers("/y"), state.servers("/x")) == (("/b",), ())


def test_a_part_of_the_graph_asks_those_around_its_nodes() -> None:
    state = MasterState(
        {"/in": ("/far", "/b"), "/out": ("/a",), "/else": ("/c",), "/work/status": ("/w",)},
        {"/out": ("/b", "/d"), "/in": ("/a",), "/else": ("/e",), "/work/goal": ("/w",), "/work/cancel": ("/w",)},
        {"/a/s": ("/a",), "/b/s": ("/b",)},
    )
    wanted = around(state, ["/a", "/a", "/not_registered"])
    bus = frozenset({"bus"})
    assert wanted.nodes == {"/a": bus, "/far": bus, "/b": bus, "/d": frozenset()}
    assert (wanted.services, wanted.actions) == (("/a/s",), ("/work",))
