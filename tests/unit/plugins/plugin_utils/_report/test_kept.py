# SPDX-License-Identifier: GPL-3.0-or-later
"""What a cluster keeps of the last runs, and what a look makes of that."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import Ref
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.held import cluster_rows
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.host_run import HostRun
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.kept import (
    REASON_KEPT,
    REF,
    keep,
    last_runs,
    last_steps,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import LastRun, Step
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.text import status_text
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


def test_what_was_kept_is_shown_on_another_control_node() -> None:
    edge = replace(RUN, host="edge1", outcome=replace(RUN.outcome, outcome="failed"), failed_task="Start k3s")
    kept = kept_of(RUN, edge)
    assert json.loads(kept["data"]["robot1"]) == {
        "host": "robot1", "playbook": "update.yml", "started": WHEN, "outcome": "rolled-back", "changed": 2,
        "reason": "an edge is missing", "failed_task": None,
    }  # fmt: skip
    elsewhere = kept_of(replace(RUN, started="2026-11-21T06:00:00Z"))  # the cluster that the robot was in before
    for maps in ([kept, elsewhere], [elsewhere, kept]):
        assert last_runs([*maps, {**elsewhere, "metadata": {"name": REF.name, "namespace": "mine"}}]) == [
            LastRun("edge1", "failed", "update.yml", WHEN, 2, "an edge is missing (task: Start k3s)"),
            LastRun("robot1", "rolled-back", "update.yml", WHEN, 2, "an edge is missing"),
        ]


def test_a_long_reason_is_cut_and_what_somebody_spoilt_is_left_out() -> None:
    kept = kept_of(replace(RUN, outcome=RobotOutcome("failed", "half\nthe rate\n" + "x" * 9999)))
    odd = '{"host": "robot5", "playbook": "", "started": "", "changed": "a"}'
    kept["data"] |= {"robot2": "{", "robot3": "[]", "robot4": "{}", "robot5": odd}
    assert [run.note for run in last_runs([kept])] == ["half the rate"]
    assert len(json.loads(kept["data"]["robot1"])["reason"]) == REASON_KEPT
    assert last_runs([]) == last_runs([{**kept, "data": None}]) == []


def test_the_latest_steps_are_those_of_the_robots_own_record() -> None:
    running = StepResult("def", "map", ("map",), "drain", {}, {}, 1795327300.0, {"wait": 5.0})
    record = events_map([STEP, running], "robot1", ())
    old = events_map([replace(STEP, id="old", started=1795000000.0)], "robot1", ())  # of the cluster before
    metadata = {"name": "robot-updates", "namespace": "mine"}
    foreign: dict[str, Any] = {"metadata": metadata, "data": {"updates.json": "{}"}}
    before, after = ("a:1 (11111111)",), ("a:2 (22222222)",) * 2
    updated = Step("robot1", "talker, listener", "overlap", "updated", before, after, 3.5, 1.0)
    begun = "begun 2026-11-22T06:01:40Z"
    now = Step("robot1", "map", "drain", "running", (), (), 5.0, 5.0, begun)
    for maps in ([old, record, foreign], [record, old]):
        assert last_steps(maps) == [updated, now]
    found = cluster_rows([{"ConfigMap": [record]}, {"ConfigMap": [kept_of(RUN)]}], {}, 0.0)
    assert (found.steps, [row.host for row in found.outcomes]) == ((updated, now), ["robot1"])
    text = status_text(found)
    assert "LAST OUTCOMES\n  host    outcome      run         started                  changed  note\n" in text
    assert "robot1  talker, liste..  overlap  updated  a:1 (11111111)  a:2 (22222222..  3.5 " in text
    spoilt = {**record, "data": {"updates.json": '{"updates": [{"app": "a", "started": 1, "phases": 7}]}'}}
    assert last_steps([spoilt]) == []
