# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a cluster keeps of the last runs, and what a look makes of it."""

from __future__ import annotations

from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._report.kept import (
    REASON_KEPT,
    kept_object,
    kept_part,
    kept_runs,
    kept_steps,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import status_rows
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.events import events_map
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import StepResult

RUN = {"playbook": "update.yml", "started": "2026-11-22T06:00:00Z"}
ROW = {
    "host": "robot1",
    "outcome": "rolled-back",
    "reason": "an edge is missing",
    "changed": 2,
    "failed_task": None,
    **RUN,
}
STEP = StepResult(
    id="abc",
    name="talker, listener",
    apps=("talker", "listener"),
    handoff="overlap",
    before={"talker": {"image": "a:1", "revision": "11111111"}},
    after={app: {"image": "a:2", "revision": "22222222"} for app in ("talker", "listener")},
    started=1795327200.0,
    phases={"wait": 1.0, "apply": 2.5},
    outcome="updated",
)


def test_what_was_kept_is_shown_on_another_control_node() -> None:
    kept = kept_object(kept_part([ROW, {**ROW, "host": "edge1", "outcome": "failed", "failed_task": "Start k3s"}]))
    shown = status_rows({"runs": kept_runs(kept)}, {}, {})
    assert shown["outcomes"] == [
        {"host": "edge1", "outcome": "failed", "changed": 2, "note": "an edge is missing (task: Start k3s)", **RUN},
        {"host": "robot1", "outcome": "rolled-back", "changed": 2, "note": "an edge is missing", **RUN},
    ]
    assert shown["problems"] == []


def test_of_two_the_newer_counts_wherever_it_is_kept() -> None:
    report = (
        '{"playbook": "site.yml", "check_mode": false, "started": "%s", "hosts": '
        '[{"host": "robot1", "outcome": "updated", "changed": ["Apply"]}]}'
    )
    for started, playbook in (("2026-11-22T05:00:00Z", "update.yml"), ("2026-11-22T07:00:00Z", "site.yml")):
        rows = status_rows({"runs": kept_runs(kept_object(kept_part([ROW])))}, {}, {"a.json": report % started})
        assert [row["playbook"] for row in rows["outcomes"]] == [playbook]


def test_runs_on_other_hosts_are_not_written_over() -> None:
    assert set(kept_part([ROW])["data"]) == {"robot1"}


def test_a_long_reason_is_cut_and_what_somebody_spoilt_is_left_out() -> None:
    kept = kept_object(kept_part([{**ROW, "reason": "x" * 9999}]))
    kept["data"] |= {"robot2": "{", "robot3": "[]", "robot4": "{}"}
    (run,) = kept_runs(kept)
    assert len(run["hosts"][0]["reason"]) == REASON_KEPT
    assert kept_runs(None) == kept_runs({"data": None}) == []


def test_the_latest_steps_are_those_of_the_robots_own_record() -> None:
    running = StepResult("def", "map", ("map",), "drain", {}, {}, 1795327300.0, {"wait": 5.0})
    record = events_map([STEP], "robot1", (), running)
    foreign: dict[str, Any] = {
        "metadata": {"name": "robot-updates", "namespace": "mine"},
        "data": {"updates.json": "{}"},
    }
    shown = status_rows({"updates": kept_steps([record, foreign])}, {}, {})
    assert [(row["robot"], row["name"], row["outcome"]) for row in shown["steps"]] == [
        ("robot1", "talker, listener", "updated"),
        ("robot1", "map", "running"),
    ]
    step, now = shown["steps"]
    assert (step["id"], step["from"], step["to"]) == ("abc", ["a:1 (11111111)"], ["a:2 (22222222)"] * 2)
    assert (step["seconds"], step["busy_wait"], step["handoff"]) == (3.5, 1.0, "overlap")
    assert now["note"] == "begun 2026-11-22T06:01:40Z"
    assert shown["outcomes"] == []
