# SPDX-License-Identifier: GPL-3.0-or-later
"""What became of steps and robots, and the ConfigMap from which metrics, annotations and log lines are made."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.updates import Updates, families
from ansible_collections.rosops.fleet.plugins.module_utils._step.update_record import CUT_OFF
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import (
    RobotOutcome,
    StepResult,
    events_map,
    robot_outcome,
    step_id,
)

STARTED = 1795252087.347614
PHASES = {"gate": 1.0, "apply": 7.5, "rollout": 5.5, "verify": 4.0}  # 18 s


def step(*apps: str, outcome: str = "updated", started: float = STARTED, **more: Any) -> StepResult:
    found = StepResult(
        id=step_id("robot1", apps, started),
        name=apps[0],
        apps=apps,
        handoff="overlap",
        before={app: {"image": "a:1", "revision": "1"} for app in apps},
        after={app: {"image": "a:2", "revision": "2"} for app in apps},
        started=started,
        phases=PHASES,
        outcome=outcome,
    )
    return replace(found, **more)


@pytest.mark.parametrize(
    ("words", "steps", "expected", "reason"),
    [
        ([], 0, "unchanged", ""),
        (["updated", "updated"], 2, "updated", "a a:1 -> a:2 in 18.0 s; why; b a:1 -> a:2 in 18.0 s; why"),
        (["updated", "deferred-busy"], 2, "deferred-busy", "b: why"),
        (["updated", "rolled-back"], 4, "rolled-back", "b: why; 2 further steps not begun"),
        (["failed"], 2, "failed", "a: why; 1 further step not begun"),
        (["updated", "deferred-offline"], 2, "deferred-offline", "b: why"),
    ],
)
def test_the_worst_step_is_the_robots_outcome(words: list[str], steps: int, expected: str, reason: str) -> None:
    results = [step(name, outcome=word, reason="why") for name, word in zip("ab", words, strict=False)]
    found = robot_outcome(results, steps)
    assert (found.outcome, found.reason, [*found.steps]) == (expected, reason, results)
    assert RobotOutcome.from_dict(found.as_dict()).as_dict() == found.as_dict()  # as the report reads it


def test_what_was_updated_is_told_with_its_time() -> None:
    again = step("a", after={"a": {"image": "a:1", "revision": "2"}}, reason="its mark is still on")
    assert again.told() == "a a:1 (2) in 18.0 s; its mark is still on"
    assert step("a", before={}).told() == "a new -> a:2 in 18.0 s"


# --- the record of a robot's updates ----------------------------------------------------------------------------------


def told(configmap: dict[str, Any]) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads(configmap["data"]["updates.json"])["updates"]
    return found


def test_a_step_that_ended() -> None:
    found = events_map([step("temperature", phases={**PHASES, "wait": 0.5}, reason="x" * 5000)], "robot1")
    labels = {"app.kubernetes.io/managed-by": "rosops.fleet", "rosops.fleet/robot": "robot1"}
    assert found == {
        "apiVersion": "v1",
        "kind": "ConfigMap",
        "metadata": {"name": "robot-updates", "namespace": "robot-robot1", "labels": labels},
        "data": found["data"],
    }
    assert told(found) == [
        {
            "id": step_id("robot1", ["temperature"], STARTED),
            "app": "temperature",
            "step": "temperature",
            "handoff": "overlap",
            "outcome": "updated",
            "reason": "x" * 1000,
            "from": "1",
            "to": "2",
            "from_image": "a:1",
            "to_image": "a:2",
            "started": 1795252087.348,
            "finished": 1795252105.848,
            "phases": {**PHASES, "wait": 0.5},
            "busy_wait": 0.5,
        }
    ]
    (new,) = told(events_map([step("a", before={}, after={"a": {}})], "robot1"))
    assert [new[key] for key in ("from", "to", "from_image", "to_image")] == ["", "", "", ""]


def test_one_id_from_begin_to_end_and_another_for_the_next_time() -> None:
    begun = told(events_map([step("temperature", outcome="", phases={"gate": 1.0})], "robot1"))[0]["id"]
    ended = told(events_map([step("temperature")], "robot1"))[0]["id"]
    later = told(events_map([step("temperature", started=STARTED + 100)], "robot1"))[0]["id"]
    assert begun == ended != later
    assert events_map([], "robot1", [events_map([step("a")], "robot1")]) == events_map([step("a")], "robot1")
    assert re.fullmatch("[0-9a-f]{12}", begun)
    assert step_id("robot2", ["temperature"], STARTED) != begun != step_id("robot1", ["stats"], STARTED)


def test_the_latest_step_of_each_app_is_kept_whatever_the_clock_says() -> None:
    before = events_map([step("a"), step("b", outcome="rolled-back", reason="half the rate")], "robot1")
    for seconds in (500, -500):
        after = events_map([step("a", started=STARTED + seconds)], "robot1", [before])
        assert [(event["app"], event["outcome"], event["started"]) for event in told(after)] == [
            ("a", "updated", round(STARTED + seconds, 3)),
            ("b", "rolled-back", 1795252087.348),
        ]


def test_what_a_killed_run_left_open_has_failed() -> None:
    before = events_map([step("a", outcome="", phases={"gate": 1.0, "apply": 17.0004})], "robot1")
    (event,) = told(events_map([], "robot1", [before]))
    assert (event["outcome"], event["reason"], event["finished"]) == ("failed", CUT_OFF, 1795252105.348)


def test_a_value_a_line_in_a_fixed_order_so_that_a_diff_is_small() -> None:
    text = events_map([step("a")], "robot1")["data"]["updates.json"]
    lines = text.splitlines()
    assert lines[:4] == ["{", ' "updates": [', "  {", '   "app": "a",']
    assert text.endswith("\n")
    keys = re.findall(r'^ {3}"(\w+)":', text, re.MULTILINE)
    assert keys == sorted(told({"data": {"updates.json": text}})[0])


@pytest.mark.parametrize(
    "spoilt", [None, "", "no JSON", "[]", "{}", '{"updates": [1]}', '{"updates": [{"app": "a", "started": "then"}]}']
)
def test_a_spoilt_configmap_is_begun_anew(spoilt: str | None) -> None:
    item = {
        "metadata": {"name": "robot-updates", "namespace": "robot-robot1"},
        "data": None if spoilt is None else {"updates.json": spoilt},
    }
    assert [event["app"] for event in told(events_map([step("b")], "robot1", [item]))] == ["b"]


def test_another_robots_configmap_is_not_taken_for_its_own() -> None:
    other = events_map([step("a")], "robot2")
    assert told(events_map([], "robot1", [other])) == []


def test_the_exporter_reads_what_is_written_here(tmp_path: Path) -> None:
    file = tmp_path / "updates.json"
    running = step("c", outcome="", started=STARTED + 20, before={})
    made = events_map([step("b", "a", name="pair"), running], "robot1")
    file.write_text(made["data"]["updates.json"], encoding="utf-8")
    updates = Updates(str(file))
    lines = [json.loads(line) for line in updates.read(STARTED + 30)]
    assert [(line["app"], line["id"], line["outcome"]) for line in lines] == [
        ("a", step_id("robot1", ["b", "a"], STARTED), "updated"),
        ("b", step_id("robot1", ["b", "a"], STARTED), "updated"),
        ("c", step_id("robot1", ["c"], STARTED + 20), "running"),
    ]
    info, started, finished, *_rest = families(updates.entries)
    assert [(labels["previous"], labels["revision"]) for labels, _one in info.samples] == [
        ("1", "2"),
        ("1", "2"),
        ("", "2"),
    ]
    assert next(value for _labels, value in started.samples) == 1795252087.348
    assert [labels["app"] for labels, _time in finished.samples] == ["a", "b"]
