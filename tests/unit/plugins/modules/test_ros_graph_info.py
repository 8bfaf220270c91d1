# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

import json
from typing import Any, Mapping

import pytest
import yaml
from ansible.module_utils.testing import patch_module_args
from ansible_collections.rosops.fleet.plugins.module_utils._errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._graph import Graph, MasterState, Questions, Rate, build
from ansible_collections.rosops.fleet.plugins.modules import ros_graph_info
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import DEAD, recorded_answers, recorded_state


class FakeMaster:
    error = ""

    def __init__(self, uri: str, timeout: float) -> None:
        del uri, timeout

    def state(self, types: bool = False) -> MasterState:
        assert types
        if self.error:
            raise RosError(self.error)
        return recorded_state()

    def ask(self, state: MasterState, wanted: Questions) -> Graph:
        assert set(wanted.nodes) == set(state.nodes())
        return build(state, recorded_answers())

    def rates(self, graph: Graph, seconds: Mapping[str, float]) -> dict[str, Rate]:
        assert set(seconds) == set(graph.topics)
        return {name: Rate(5.0, 10, taken) for name, taken in seconds.items()}


def run(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], error: str = "", **params: Any
) -> dict[str, Any]:
    monkeypatch.setattr(ros_graph_info, "RosMaster", FakeMaster)
    monkeypatch.setattr(FakeMaster, "error", error)
    with patch_module_args(params), pytest.raises(SystemExit):
        ros_graph_info.main()
    result: dict[str, Any] = json.loads(capsys.readouterr().out)
    return result


def test_the_graph(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    result = run(monkeypatch, capsys, _ansible_check_mode=True)
    assert (result["changed"], result["elapsed"] >= 0) == (False, True)
    graph = result["graph"]
    assert set(graph) == {"nodes", "topics", "services", "actions"}
    assert graph["nodes"][DEAD]["reachable"] is False
    assert graph["topics"]["/chatter"]["rate"] is None
    assert graph["actions"]["/work"]["servers"] == ["/worker"]


def test_rates(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    result = run(monkeypatch, capsys, rates=True)
    assert {topic["rate"] for topic in result["graph"]["topics"].values()} == {5.0}


def test_no_master(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    result = run(monkeypatch, capsys, error="the ROS master does not answer")
    assert (result["failed"], result["msg"]) == (True, "the ROS master does not answer")


@pytest.mark.parametrize("seconds", [0, -1, 1e9, float("nan")])
def test_a_time_that_cannot_be(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], seconds: float
) -> None:
    result = run(monkeypatch, capsys, rates=True, rate_seconds=seconds)
    assert (result["failed"], "rate_seconds" in result["msg"]) == (True, True)


def test_what_is_returned_is_documented(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    graph = run(monkeypatch, capsys)["graph"]
    contains = yaml.safe_load(ros_graph_info.RETURN)["graph"]["contains"]
    assert set(graph) == set(contains)
    for part, entry in contains.items():
        sample = next(iter(entry["sample"].values()))
        assert set(sample) == set(next(iter(graph[part].values()))), part
