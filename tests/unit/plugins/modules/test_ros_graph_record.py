# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import pytest
import yaml
from ansible.module_utils.testing import patch_module_args
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import (
    Graph,
    Handshake,
    MasterState,
    Questions,
    Rate,
)
from ansible_collections.rosops.fleet.plugins.module_utils._ros.replies import build
from ansible_collections.rosops.fleet.plugins.modules import ros_graph_record
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import DEAD, recorded_answers, recorded_state

LOCAL = "127.0.0.1"  # where the recorded nodes are


class FakeMaster:
    caller = "/test"
    error = ""

    def __init__(self, uri: str, timeout: float) -> None:
        del uri, timeout

    def state(self, types: bool = False) -> MasterState:
        assert types
        if self.error:
            raise RosError(self.error)
        return recorded_state()

    def ask(self, state: MasterState, wanted: Questions) -> Graph:
        return build(state, {name: recorded_answers()[name] for name in wanted.nodes})

    def greeted(self, graph: Graph, sources: Sequence[tuple[str, str]]) -> dict[tuple[str, str], Handshake]:
        assert all(graph.nodes[publisher].reachable for _topic, publisher in sources)
        return {key: Handshake(key[1], "aa", definition="string data") for key in sources}

    def calls(self, requests: Sequence[Sequence[Any]]) -> list[Any]:
        assert list(requests) == [("getParam", "/test", "/")]
        return [{"talker_a": {"password": "very-secret"}, "rehearsal": {"x": "{}"}}]


def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], **params: Any) -> dict[str, Any]:
    def sent(_ros: Any, _graph: Graph, publishers: Mapping[str, Any], seconds: float) -> dict[str, Rate]:
        return {name: Rate(by={one: Rate(seconds) for one in them}) for name, them in publishers.items()}

    monkeypatch.setattr(ros_graph_record, "Ros1Client", FakeMaster)
    monkeypatch.setattr(ros_graph_record, "sent", sent)
    with patch_module_args(params), pytest.raises(SystemExit):
        ros_graph_record.main()
    result: dict[str, Any] = json.loads(capsys.readouterr().out)
    return result


def app(name: str, *addresses: str, robot: str = "robot1") -> dict[str, Any]:
    return {"name": name, "robot": robot, "placement": "remote", "addresses": list(addresses)}


def test_the_recording(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    result = run(monkeypatch, capsys, robot="robot1", rate_seconds=3, _ansible_check_mode=True)
    found = result["recording"]
    assert (result["changed"], found["robot"], found["apps"]) == (False, "robot1", {})
    assert {"/talker_a", "/worker"} <= set(found["others"])
    assert found["topics"]["/chatter"]["publishers"]["/talker_a"] == {"rate": 3.0, "latched": False}
    assert found["topics"]["/chatter"]["definition"] == "string data"
    assert found["parameters"]["/talker_a/password"] == "str"
    assert "very-secret" not in json.dumps(result)
    assert DEAD not in json.dumps(result)
    assert set(found) == set(yaml.safe_load(ros_graph_record.RETURN)["recording"]["sample"])


def test_values_that_are_asked_for(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    found = run(monkeypatch, capsys, values=["/rehearsal"])["recording"]
    assert found["values"] == {"/rehearsal/x": "{}"}


def test_apps_by_their_addresses(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    apps = [app("talk", LOCAL), app("elsewhere", "10.1.1.1"), app("talk2", LOCAL, robot="robot2")]
    found = run(monkeypatch, capsys, robot="robot1", apps=apps)["recording"]
    assert set(found["apps"]) == {"talk"}
    assert found["apps"]["talk"]["placement"] == "remote"
    assert found["others"] == []
    shared = run(monkeypatch, capsys, robot="robot1", apps=[*apps, app("also", LOCAL)])["recording"]
    assert shared["apps"] == {}


@pytest.mark.parametrize("seconds", [0, -1, 3601])
def test_a_time_that_makes_no_sense(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], seconds: float
) -> None:
    result = run(monkeypatch, capsys, rate_seconds=seconds)
    assert result["failed"]
    assert "rate_seconds" in result["msg"]


def test_no_master(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(FakeMaster, "error", "the ROS master does not answer")
    result = run(monkeypatch, capsys)
    assert (result["failed"], result["msg"]) == (True, "the ROS master does not answer")


def test_documentation_and_options_are_the_same() -> None:
    options = yaml.safe_load(ros_graph_record.DOCUMENTATION)["options"]
    assert {
        name: {key: value for key, value in option.items() if key != "description"} for name, option in options.items()
    } == ros_graph_record.RECORD_ARGS
