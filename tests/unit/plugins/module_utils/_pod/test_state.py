# SPDX-License-Identifier: GPL-3.0-or-later
"""What calls in a pod know of the app and of each other: settings, contract, state."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._pod import state as kept
from ansible_collections.rosops.fleet.plugins.module_utils._pod.state import State


@pytest.fixture(autouse=True)
def scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(kept, "SCRATCH", str(tmp_path / "scratch"))
    return tmp_path


ENVIRON = {"ROSOPS_NODE_NAME": "a_0a1b2c3d", "ROSOPS_REVISION": "0a1b2c3d"}


def test_settings_take_the_nodes_name_from_the_pod() -> None:
    content = {
        "node": "/r1/a", "expect_node": True, "handoff": "overlap", "actions": ["~move", "/arm"],
        "min_rates": {"~status": 1, "/out": 5}, "command": None, "keeper": None, "stop_deadline": 5,
    }  # fmt: skip
    found = kept.load_settings({**ENVIRON, "ROSOPS_SETTINGS": json.dumps(content)})
    assert found.node == "/r1/a_0a1b2c3d"
    assert found.actions == ["/r1/a_0a1b2c3d/move", "/arm"]
    assert found.min_rates == {"/r1/a_0a1b2c3d/status": 1, "/out": 5}


@pytest.mark.parametrize("text", ["", "{", "[]"])
def test_settings_that_are_none_expect_nothing(text: str) -> None:
    found = kept.load_settings({**ENVIRON, "ROSOPS_SETTINGS": text})
    assert (found.node, found.expect_node) == ("/a_0a1b2c3d", False)


def test_state_is_kept_per_node_and_master_for_this_user_alone(scratch: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_MASTER_URI", "http://robot1:11311")
    kept.save_state("/r1/a", State(pid=1))
    kept.save_state("/r1/b", State(pid=2))
    assert [kept.load_state(name).pid for name in ("/r1/a", "/r1/b", "/r1/c")] == [1, 2, None]
    monkeypatch.setenv("ROS_MASTER_URI", "http://robot2:11311/")  # its pod with the same volume has another node
    assert kept.load_state("/r1/a") == State()
    assert (scratch / "scratch").stat().st_mode & 0o777 == 0o700


def test_where_nothing_can_be_written_nothing_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept, "SCRATCH", "/proc/none")
    kept.save_state("/a", State(pid=1))
    assert kept.load_state("/a") == State()
