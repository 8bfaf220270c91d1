# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a run tells of its steps, those of the runs before it and of the keeper, and when it ends by itself."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.running import TODO
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import StepResult
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.plan import Request
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update import simulation
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.scenarios import (
    OLD,
    SCENARIOS,
    begin,
    outcome_of,
    running,
    settings,
)


def test_a_run_that_lost_its_lease_ends() -> None:
    """The control node sleeps for longer than a Lease lasts, and the keeper goes back meanwhile."""
    sim, wanted = begin("overlap", "never-connects")
    sim.run(wanted, settings())
    at = sim.calls.index("rollout") + 1
    sim, wanted = begin("overlap", "never-connects")
    old = running(sim, "sensor")
    found = sim.run(wanted, settings(), "asleep", at)
    assert found is not None
    assert (found.outcome, "ros-keeper had this robot" in found.reason) == ("failed", True)
    assert running(sim, "sensor") == old
    assert outcome_of(sim, wanted).outcome == "rolled-back"


def test_what_the_keeper_did_is_told_once_and_recorded() -> None:
    sim, wanted = begin("overlap", "never-connects")
    sim.run(wanted, settings())
    at = sim.calls.index("rollout") + 1
    sim, wanted = begin("overlap", "never-connects")
    sim.run(wanted, settings(), "killed", at)
    assert '"outcome": "running"' in sim.events()
    sim.advance(600.0)
    assert '"outcome": "rolled-back"' in sim.events()  # whoever looks meanwhile knows it, too
    found = outcome_of(sim, SCENARIOS["overlap"].robot(OLD))
    assert found.outcome == "unchanged"
    assert found.reason.startswith("sensor: the keeper went back from ")
    assert found.reason in sim.said
    assert '"outcome": "rolled-back"' in sim.events()
    assert "after the run that began it had gone" in sim.events()
    assert outcome_of(sim, SCENARIOS["overlap"].robot(OLD)).reason == ""


@pytest.mark.parametrize("check", [False, True])
def test_an_app_that_runs_another_image_than_its_name_means_by_now_is_told(
    check: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is unchanged, as its Deployment is; what its pod keeps only a look at images shows."""
    sim, wanted = begin("overlap", "good")
    ref, plain = "docker.io/lab/sensor:1", simulation.pod_object

    def pod_object(pod: Any) -> dict[str, Any]:
        container = {"name": "ros-app", "imageID": "sha256:01d", "state": {"running": {}}}
        spec = {"nodeName": "robot1", "containers": [{"name": "ros-app", "image": ref}]}
        made = plain(pod)
        mine = made["metadata"]["labels"]["rosops.fleet/app"] == "sensor"
        return {**made, "spec": spec, "status": {**made["status"], "containerStatuses": [container]}} if mine else made

    monkeypatch.setattr(simulation, "pod_object", pod_object)
    known = {("robot1", ref): {"sha256:4e3"}}
    found = outcome_of(sim, SCENARIOS["overlap"].robot(OLD), check=check, known=lambda *asked: known.get(asked, ()))
    told = f"sensor runs another image than {ref} is by now on robot1: its pod keeps the old one; {TODO}"
    assert (found.outcome, found.reason) == ("unchanged", told)
    assert told in sim.said
    # whose pods are replaced by a step anyway is not
    assert outcome_of(sim, wanted, check=True, known=lambda *asked: known.get(asked, ())).reason.count("another") == 0


def test_steps_that_had_ended_before_it_waited_are_told_with_the_rest() -> None:
    sim, wanted = begin("two-steps", "good")
    first = outcome_of(sim, wanted, request=Request(only=["sensor"]))
    both = outcome_of(sim, wanted, earlier=[StepResult.from_dict(step.as_dict()) for step in first.steps])
    assert (both.outcome, [step.name for step in both.steps]) == ("updated", ["sensor", "stats"])
