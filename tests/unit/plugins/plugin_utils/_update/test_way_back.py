# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The way back: of a version that does not prove itself, without anybody, and by request."""

from __future__ import annotations

import os

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import RobotOutcome
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.plan import Request
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.scenarios import (
    INFRASTRUCTURE,
    MATRIX,
    OLD,
    SCENARIOS,
    begin,
    outcome_of,
    running,
    settings,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.simulated_robot import Goal, image
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.simulation import (
    DAY,
    FAULTS,
    SimulatedHost,
    Simulation,
)

UNSEEN = ("good", "crashes-once", "hangs")  # what is ready stays for the next run, and a node that hangs is


ALONE = [(name, version) for name, version in MATRIX if version not in UNSEEN and name not in INFRASTRUCTURE]


# all of it takes minutes: that is for ROSOPS_TEST_ALL
SHARE = 1 if os.environ.get("ROSOPS_TEST_ALL") else 13


@pytest.mark.parametrize(("name", "version"), ALONE)
def test_a_refused_version_stays_refused_without_anybody(name: str, version: str) -> None:
    """The control node dies anywhere and stays dead for hours: the old version serves, and then one run converges."""
    sim, wanted = begin(name, version)
    sim.run(wanted, settings())
    apps = [app.name for app in wanted.apps]
    # one call of every SHARE, turned by one from version to version
    for at in range(1 + ALONE.index((name, version)) % SHARE, len(sim.calls) + 1, SHARE):
        for fault in ("killed", "half-killed"):
            sim, wanted = begin(name, version)
            old = {app: running(sim, app) for app in apps}
            sim.skew = (-DAY, 0.0, DAY)[at % 3]
            sim.run(wanted, settings(), fault, at)
            sim.advance(3 * 3600.0)
            assert {app: running(sim, app) for app in apps} == old, (fault, at)
            assert outcome_of(sim, wanted).outcome == "rolled-back", (fault, at)
            assert {app: running(sim, app) for app in apps} == old, (fault, at)


@pytest.mark.parametrize("name", [name for name in SCENARIOS if name not in INFRASTRUCTURE])
def test_the_way_back_by_request(name: str) -> None:
    back, calls, share = Request(to="previous"), range(1, 16), 8 if SHARE == 1 else 15
    for fault, at in [
        ("", 1),
        *((fault, at) for fault in FAULTS for at in calls if (at + FAULTS.index(fault)) % share == 0),
    ]:
        sim, wanted = begin(name, "good")
        assert outcome_of(sim, wanted).outcome == "updated"
        found = sim.run(wanted, settings(request=back), fault, at)
        if not fault:
            assert found is not None
            assert found.outcome == "updated"
            assert outcome_of(sim, SCENARIOS[name].robot(OLD)).outcome == "unchanged"
        sim.restore()
        assert outcome_of(sim, SCENARIOS[name].robot(OLD)).outcome in ("updated", "unchanged"), (fault, at)
        assert outcome_of(sim, SCENARIOS[name].robot(OLD)).outcome == "unchanged", (fault, at)


def test_a_bad_version_is_not_taken_back_while_it_works() -> None:
    """A goal that was held went to it. It has more to do than its stop hook would wait for."""
    sim, wanted = begin("drain", "half-the-rate")
    sim.goal("/plan", 45.0, after=8.0)  # when it is held
    found = outcome_of(sim, wanted)
    assert (found.outcome, found.steps[0].phases["wait"] > 10.0) == ("rolled-back", True)
    assert all(goal.ended for goal in sim.goals)


def test_a_bad_version_that_stays_at_work_stays_marked() -> None:
    sim, wanted = begin("drain", "half-the-rate")
    goal = sim.goal("/plan", 200.0, after=8.0)
    found = outcome_of(sim, wanted)
    assert found.outcome == "deferred-busy"
    assert "at work, so it was not taken back" in found.reason
    assert "unproven" in found.reason
    sim.advance(200.0)
    assert goal.ended
    assert outcome_of(sim, wanted).outcome == "rolled-back"


def test_whoever_forces_does_not_wait_for_a_bad_version() -> None:
    sim, wanted = begin("drain", "half-the-rate")
    sim.goal("/plan", 20.0, after=20.0)
    found = outcome_of(sim, wanted, on_busy="force")
    assert (found.outcome, found.steps[0].phases.get("wait")) == ("rolled-back", None)


@pytest.mark.parametrize("name", ["drain", "replace"])
def test_the_way_back_does_not_wait_for_registrations(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """They come with the old version again; and without it nothing serves."""

    def refuse(*_unused: object) -> None:
        raise RosError("the ROS master does not answer")

    sim, wanted = begin(name, "never-starts")
    monkeypatch.setattr(SimulatedHost, "register", refuse)
    assert outcome_of(sim, wanted).outcome == "rolled-back"
    assert any("the ROS master does not answer" in text for text in sim.said)


def bad_at_work(fault: str = "") -> tuple[Simulation, RobotOutcome, Goal]:
    """A bad version with a goal that its stop hook would not wait for; the fault comes when it is to be looked at."""
    calls: list[str] = []
    for strikes in ("", fault):
        sim, wanted = begin("drain", "half-the-rate")
        goal = sim.goal("/plan", 60.0, after=8.0)
        at = len(calls) - calls[::-1].index("graph") if calls else 0
        found = sim.run(wanted, settings(busy_timeout=120.0), strikes, at)
        calls = [*sim.calls]
    assert found is not None
    return sim, found, goal


def test_a_version_of_which_nobody_can_tell_is_not_taken_back_at_once() -> None:
    _sim, found, goal = bad_at_work("master-silent")
    assert (found.outcome, goal.ended) == ("rolled-back", True)


def test_a_version_of_which_nobody_ever_tells_is_left_to_the_next_run() -> None:
    sim, found, goal = bad_at_work("master-gone")
    assert (found.outcome, "nobody can tell whether its new version is at work" in found.reason) == ("failed", True)
    assert "unproven" in found.reason
    sim.restore()
    assert outcome_of(sim, SCENARIOS["drain"].robot(image("half-the-rate"))).outcome == "rolled-back"
    assert goal.ended
