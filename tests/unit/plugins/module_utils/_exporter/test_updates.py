# SPDX-License-Identifier: GPL-3.0-or-later
"""The record of updates: metrics, and each outcome said once."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.families import text as families_text
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.updates import RECENT, Updates, families, parse

NOW = 1_800_000_000.0
ENTRY: dict[str, Any] = {
    "id": "0123456789ab", "app": "camera", "handoff": "drain", "outcome": "updated", "reason": "", "from": "aa",
    "to": "bb", "started": NOW - 30, "finished": NOW - 5, "phases": {"gate": 2, "roll": 20.5}, "busy_wait": 7,
}  # fmt: skip


def text(*entries: Any) -> str:
    return json.dumps({"updates": list(entries)})


def shown(*entries: Any) -> dict[str, list[Any]]:
    return {family.name: list(family.samples) for family in families(parse(text(*entries)))}


def test_metrics() -> None:
    found = shown(ENTRY)
    labels = {"app": "camera", "id": "0123456789ab", "revision": "bb", "previous": "aa", "handoff": "drain"}
    assert found["robot_update_info"] == [({**labels, "outcome": "updated"}, 1.0)]
    assert found["robot_update_started_timestamp_seconds"] == [({"app": "camera"}, NOW - 30)]
    assert found["robot_update_finished_timestamp_seconds"] == [({"app": "camera"}, NOW - 5)]
    assert found["robot_update_phase_seconds"] == [
        ({"app": "camera", "phase": "gate"}, 2.0),
        ({"app": "camera", "phase": "roll"}, 20.5),
    ]
    assert found["robot_update_busy_wait_seconds"] == [({"app": "camera"}, 7.0)]


@pytest.mark.parametrize(
    "wrong",
    ["", "[]", "{", '{"updates": 7}', text(7), text({}), text({"app": "a", "id": "b"}), text({**ENTRY, "app": ["a"]}),
     *(text({**ENTRY, **odd}) for odd in ({"phases": {"a": "x"}}, {"phases": 7}, {"started": "soon"}))],
)  # fmt: skip
def test_nonsense_is_left_out(wrong: str) -> None:
    assert parse(wrong) == []


def test_nonsense_beside_sense() -> None:
    running = {**ENTRY, "finished": None, "phases": None}  # one that runs has no end
    assert parse(text(7, {**running, "app": "odd", "busy_wait": []}, running)) == parse(text(running)) != []
    assert shown(running)["robot_update_finished_timestamp_seconds"] == []
    assert shown(running)["robot_update_phase_seconds"] == []


def test_whatever_an_app_is_called_it_is_text() -> None:
    entries = parse(text({**ENTRY, "app": 5}, {**ENTRY, "app": "\ud800"}, ENTRY))
    assert [entry.app for entry in entries] == ["5", "camera", "\ud800"]
    assert b'robot_update_busy_wait_seconds{app="?"} 7.0' in families_text(families(entries))


def said(updates: Updates, now: float = NOW) -> list[tuple[str, str]]:
    return [(found["id"], found["outcome"]) for found in map(json.loads, updates.read(now))]


def test_each_outcome_is_said_once(tmp_path: Path) -> None:
    path = tmp_path / "updates.json"
    updates = Updates(str(path))
    assert said(updates) == []  # no update yet, no file
    path.write_text(text({**ENTRY, "outcome": "running", "finished": None}))
    assert said(updates) == [("0123456789ab", "running")]
    assert said(updates) == []
    path.write_text(text(ENTRY))
    line = updates.read(NOW)[0]
    assert json.loads(line) == {"event": "update", **ENTRY}
    assert said(updates) == []
    path.write_text("not yet whole")
    assert said(updates) == []


@pytest.mark.parametrize(("now", "again"), [(NOW, ["0123456789ab"]), (0.0, [])])  # a board without a battery
def test_a_restart_repeats_only_what_just_happened(tmp_path: Path, now: float, again: list[str]) -> None:
    path = tmp_path / "updates.json"
    old = {**ENTRY, "app": "old", "id": "ffffffffffff", "finished": NOW - RECENT - 1}
    path.write_text(text(ENTRY, old))
    updates = Updates(str(path))
    assert said(updates, now) == [(one, "updated") for one in again]
    assert [entry.app for entry in updates.entries] == ["camera", "old"]
