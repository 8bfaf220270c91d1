# SPDX-License-Identifier: GPL-3.0-or-later
"""What a cluster keeps of the last runs, and what a look makes of it."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import Ref
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.host_run import HostRun
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.kept import REASON_KEPT, keep, kept_runs, kept_steps
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.look import Look, status_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import LastRun, Status
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import RobotOutcome, StepResult, events_map

WHEN = "2026-11-22T06:00:00Z"
RUN = HostRun("robot1", "update.yml", WHEN, RobotOutcome("rolled-back", "an edge is missing"), 2)
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


class Cluster:
    """Holds the one object."""

    def __init__(self) -> None:
        self.found: dict[str, Any] | None = None

    def get(self, _ref: Ref) -> Any:
        return self.found

    def create(self, item: dict[str, Any]) -> None:
        self.found = item


def kept_of(*runs: HostRun) -> dict[str, Any]:
    cluster: Any = Cluster()
    keep(cluster, runs)
    found: dict[str, Any] = cluster.found
    return found


def shown(*runs: HostRun) -> Status:
    return status_of(Look(Status(), runs=runs), {})


def test_what_was_kept_is_shown_on_another_control_node() -> None:
    edge = replace(RUN, host="edge1", outcome=replace(RUN.outcome, outcome="failed"), failed_task="Start k3s")
    kept = kept_of(RUN, edge)
    assert json.loads(kept["data"]["robot1"]) == {
        "host": "robot1", "playbook": "update.yml", "started": WHEN, "outcome": "rolled-back", "changed": 2,
        "reason": "an edge is missing", "failed_task": None,
    }  # fmt: skip
    found = shown(*kept_runs(kept))
    assert found.outcomes == (
        LastRun("edge1", "failed", "update.yml", WHEN, 2, "an edge is missing (task: Start k3s)"),
        LastRun("robot1", "rolled-back", "update.yml", WHEN, 2, "an edge is missing"),
    )
    assert found.problems == ()


def test_a_long_reason_is_cut_and_what_somebody_spoilt_is_left_out() -> None:
    kept = kept_of(replace(RUN, outcome=RobotOutcome("failed", "x" * 9999)))
    odd = '{"host": "robot5", "playbook": "", "started": "", "changed": "a"}'
    kept["data"] |= {"robot2": "{", "robot3": "[]", "robot4": "{}", "robot5": odd}
    (run,) = kept_runs(kept)
    assert len(run.outcome.reason) == REASON_KEPT
    assert kept_runs(None) == kept_runs({"data": None}) == []


def test_the_latest_steps_are_those_of_the_robots_own_record() -> None:
    running = StepResult("def", "map", ("map",), "drain", {}, {}, 1795327300.0, {"wait": 5.0})
    record = events_map([STEP], "robot1", (), running)
    foreign: dict[str, Any] = {
        "metadata": {"name": "robot-updates", "namespace": "mine"},
        "data": {"updates.json": "{}"},
    }
    found = shown(*kept_steps([record, foreign]))
    assert [(row.robot, row.name, row.outcome) for row in found.steps] == [
        ("robot1", "talker, listener", "updated"),
        ("robot1", "map", "running"),
    ]
    step, now = found.steps
    assert (step.id, step.before, step.after) == ("abc", ("a:1 (11111111)",), ("a:2 (22222222)",) * 2)
    assert (step.seconds, step.busy_wait, step.handoff) == (3.5, 1.0, "overlap")
    assert now.note == "begun 2026-11-22T06:01:40Z"
    assert found.outcomes == ()
    spoilt = {**record, "data": {"updates.json": '{"updates": [{"app": "a", "started": 1, "phases": 7}]}'}}
    assert kept_steps([spoilt]) == []
