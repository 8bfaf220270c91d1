# SPDX-License-Identifier: GPL-3.0-or-later
"""What runs made of hosts, by the reports on the control node."""

from __future__ import annotations

import json
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.look import Look, status_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import Status, Step
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.text import status_text

STEP = {
    "id": "0123456789ab",
    "name": "temperature",
    "apps": ["temperature"],
    "handoff": "overlap",
    "from": {"temperature": {"image": "lab/apps:1.0", "revision": "1793ed6c"}},
    "to": {"temperature": {"image": "lab/apps:1.1", "revision": "3f0e725c"}},
    "phases": {"gate": 1.0, "apply": 7.5},
    "busy_wait": 0,
    "outcome": "updated",
    "reason": "",
}


def host(name: str, outcome: str = "updated", *steps: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"host": name, "outcome": outcome, "reason": "", "changed": ["a"], "steps": list(steps), **more}


def report(playbook: str, started: str, *hosts: dict[str, Any], check_mode: bool = False) -> str:
    return json.dumps({"playbook": playbook, "check_mode": check_mode, "started": started, "hosts": list(hosts)})


def status(**reports: str) -> Status:
    return status_of(Look(Status()), {}, reports)


def test_each_hosts_newest_run_counts() -> None:
    found = status(
        a=report("update.yml", "2026-01-02T00:00:00Z", host("robot1", "rolled-back", reason="half\nthe rate\nmore")),
        b=report("site.yml", "2026-01-01T00:00:00Z", host("robot1"), host("robot2", "failed", failed_task="Apply")),
    )
    assert [(row.host, row.outcome, row.playbook, row.note) for row in found.outcomes] == [
        ("robot1", "rolled-back", "update.yml", "half the rate"),
        ("robot2", "failed", "site.yml", "(task: Apply)"),
    ]
    assert found.problems == ()


@pytest.mark.parametrize(
    ("playbook", "check_mode"), [("status.yml", False), ("validate.yml", False), ("site.yml", True)]
)
def test_a_run_that_only_looked_hides_nothing(playbook: str, check_mode: bool) -> None:
    found = status(
        a=report("update.yml", "2026-01-01T00:00:00Z", host("robot1", "updated", STEP)),
        b=report(playbook, "2026-01-02T00:00:00Z", host("robot1", "unchanged"), check_mode=check_mode),
    )
    assert [(row.outcome, row.playbook) for row in found.outcomes] == [("updated", "update.yml")]


def test_the_steps_of_the_last_update_stay_when_later_runs_had_none() -> None:
    found = status(
        a=report("update.yml", "2026-01-01T00:00:00Z", host("robot1", "updated", STEP)),
        b=report("update.yml", "2026-01-02T00:00:00Z", host("robot1", "unchanged")),
    )
    before, after = ("lab/apps:1.0 (1793ed6c)",), ("lab/apps:1.1 (3f0e725c)",)
    phases = {"gate": 1.0, "apply": 7.5}
    assert [row.outcome for row in found.outcomes] == ["unchanged"]
    assert found.steps == (
        Step("robot1", "temperature", "0123456789ab", "overlap", "updated", before, after, 8.5, 0.0, phases),
    )
    [told] = found.as_dict()["steps"]
    assert (told["from"], told["to"], "before" in told) == ([*before], [*after], False)


@pytest.mark.parametrize(
    "text", ["", "no JSON", "[]", "{}", '{"hosts": [1], "check_mode": false, "playbook": "a"}', "1"]
)
def test_a_spoilt_report_is_said_and_hides_no_other(text: str) -> None:
    good = report("update.yml", "2026-01-01T00:00:00Z", host("robot1", "updated", STEP))
    found = status(**{"fleet-report.json": text, "good": good})
    assert [row.where for row in found.problems] == ["fleet-report.json"]
    assert [row.host for row in found.outcomes] == ["robot1"]


@pytest.mark.parametrize("steps", [[1], [{"phases": {"a": "b"}}], ["a"], 7])
def test_steps_of_another_shape_are_a_spoilt_report(steps: Any) -> None:
    odd = {**host("robot1"), "steps": steps}
    found = status(a=report("update.yml", "2026-01-01T00:00:00Z", odd))
    assert [row.where for row in found.problems] == ["a"]


def test_on_the_page_of_text() -> None:
    good = report("update.yml", "2026-01-01T00:00:00Z", host("robot1", "updated", STEP))
    page = status_text(status(a=good, b=""))
    assert page.startswith("PROBLEMS\n  where  what\n  b      not a report of fleet_report")
    assert "LAST OUTCOMES\n  host    outcome  run         started                  changed\n  robot1  updated" in page
    assert "robot1  temperature  overlap  updated  lab/apps:1.0 (1793ed6c)  lab/apps:1.1 (3f0e725c)  8.5" in page
