# SPDX-License-Identifier: GPL-3.0-or-later
"""Between two waves: who waits, and for which versions; the waiting itself is in _update/test_engine_soak."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from ansible_collections.rosops.fleet.plugins.action import _robot_update, _update_soak
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.ledger import Ledger
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import RobotOutcome
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import run
from ansible_collections.rosops.fleet.tests.unit.robots import fleet_of, robot

NOWHERE = {"kubeconfig": "/nowhere/edge.yaml"}
HOSTS = ["r3", "r1", "r2"]
WAVES = {"ansible_play_hosts_all": ["r4", *HOSTS], "ansible_play_hosts": HOSTS}  # r4 has left the run
STEP = {
    "id": "x", "name": "camera", "apps": ["camera"], "handoff": "overlap", "started": 1.0, "phases": {}, "reason": "",
    "outcome": "updated", "from": {}, "to": {"camera": {"image": "x/camera:2", "revision": "rev2"}},
}  # fmt: skip
UPDATED = {"outcome": "updated", "reason": "", "steps": [STEP]}


@pytest.mark.parametrize(
    ("told", "batch"),
    [
        ({"outcome": UPDATED}, ["r3"]),  # the last wave
        ({"outcome": {**UPDATED, "outcome": "rolled-back"}}, ["r1"]),
        ({"at_work": True}, ["r1"]),  # only looked at
    ],
)
def test_what_need_not_be_waited_for_is_handed_on_as_it_is(told: dict[str, Any], batch: list[str]) -> None:
    known = {**WAVES, "inventory_hostname": batch[0], "ansible_play_batch": batch, "update_result": told}
    result = run(_update_soak, NOWHERE, known)
    assert {key: value for key, value in result.items() if key in ("changed", *told)} == {"changed": False, **told}


BACK = RobotOutcome("rolled-back", "the keeper went back")
AWAY = KubeError("the API cannot be reached")


@pytest.mark.parametrize(
    ("seen", "word", "reason"),
    [
        ({"return_value": BACK}, "rolled-back", "the keeper went back"),
        ({"side_effect": AWAY}, "failed", f"nobody knows whether what is new stays good: {AWAY}"),
    ],
)
def test_what_the_soak_shows_counts_as_what_the_update_came_to(
    seen: dict[str, Any], word: str, reason: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """As an outcome: a task that failed for the one robot of the first wave would end the run."""
    monkeypatch.setattr(_update_soak.ActionModule, "cluster", lambda *_given: contextlib.nullcontext())
    monkeypatch.setattr(_update_soak.ActionModule, "run_of", lambda *_given: None)
    soak = Mock(**seen)
    monkeypatch.setattr(_update_soak, "soak", soak)
    monkeypatch.setattr(_update_soak, "keep_early", lambda *_given, **_more: None)
    known = {**WAVES, **fleet_of(robot(name="r1")), "inventory_hostname": "r1", "ansible_play_batch": ["r1"]}
    result = run(_update_soak, NOWHERE, {**known, "update_result": {"outcome": UPDATED}})
    assert soak.call_args.args[2] == {"camera": "rev2"}
    assert (result.get("failed"), result["outcome"]) == (None, {**UPDATED, "outcome": word, "reason": reason})
    later = Ledger(tmp_path, "r2", _robot_update.ActionModule.KIND)
    assert later.last("r1")["outcome"] == word
    assert later.refusal("0", 3).startswith("not begun: r1 failed")
