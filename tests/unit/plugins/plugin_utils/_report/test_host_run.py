# SPDX-License-Identifier: GPL-3.0-or-later
"""What runs made of hosts, of all that is kept of them."""

from __future__ import annotations

from ansible_collections.rosops.fleet.plugins.plugin_utils._report.host_run import HostRun
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.look import Look, status_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import Status, Step
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.text import status_text
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import RobotOutcome, StepResult

STEP = StepResult(
    id="0123456789ab",
    name="temperature",
    apps=("temperature",),
    handoff="overlap",
    before={"temperature": {"image": "lab/apps:1.0", "revision": "1793ed6c"}},
    after={"temperature": {"image": "lab/apps:1.1", "revision": "3f0e725c"}},
    started=1.0,
    phases={"gate": 1.0, "apply": 7.5},
    outcome="updated",
)
FIRST, SECOND = "2026-01-01T00:00:00Z", "2026-01-02T00:00:00Z"


def status(*runs: HostRun) -> Status:
    return status_of(Look(Status(), runs=runs), {})


def test_each_hosts_newest_run_counts() -> None:
    """A host that went to another cluster is kept in both."""
    found = status(
        HostRun("robot1", "update.yml", SECOND, RobotOutcome("rolled-back", "half\nthe rate\nmore")),
        HostRun("robot1", "site.yml", FIRST, RobotOutcome("updated")),
        HostRun("robot2", "site.yml", FIRST, RobotOutcome("failed"), failed_task="Apply"),
    )
    assert [(row.host, row.outcome, row.playbook, row.note) for row in found.outcomes] == [
        ("robot1", "rolled-back", "update.yml", "half the rate"),
        ("robot2", "failed", "site.yml", "(task: Apply)"),
    ]
    assert found.problems == ()


def test_the_steps_of_the_last_update_stay_when_later_runs_had_none() -> None:
    found = status(
        HostRun("robot1", "update.yml", FIRST, RobotOutcome("updated", steps=(STEP,)), 1),
        HostRun("robot1", "update.yml", SECOND, RobotOutcome("unchanged")),
    )
    before, after = ("lab/apps:1.0 (1793ed6c)",), ("lab/apps:1.1 (3f0e725c)",)
    phases = {"gate": 1.0, "apply": 7.5}
    assert [row.outcome for row in found.outcomes] == ["unchanged"]
    assert found.steps == (
        Step("robot1", "temperature", "0123456789ab", "overlap", "updated", before, after, 8.5, 0.0, phases),
    )
    [told] = found.as_dict()["steps"]
    assert (told["from"], told["to"], "before" in told) == ([*before], [*after], False)
    page = status_text(found)
    assert "LAST OUTCOMES\n  host    outcome    run         started                  changed\n  robot1  unch" in page
    assert "robot1  temperature  overlap  updated  lab/apps:1.0 (1793ed6c)  lab/apps:1.1 (3f0e725c)  8.5" in page
