# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Every way to hand over, with every kind of version, and every fault at every call of a run.

The simulated world holds its invariants at every moment, and each outcome's word against what is there. After the fault
the next run has to bring the robot to where a run without one would have brought it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Callable, Sequence

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.engine import Settings
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.simulated_robot import LATE, image
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.simulation import FAULTS, Simulation
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.update_objects import app
from ansible_collections.rosops.fleet.tests.unit.robots import robot

OLD = image("good", 0)
APP_VERSIONS = (
    "good", "crashes-once", "never-starts", "never-connects", "half-the-rate", "offers-less", "crashes-at-once",
    "crashes-when-ready", "hangs",
)  # fmt: skip
MASTER_VERSIONS = ("good", "never-starts", "crashes-at-once", "crashes-when-ready")


@dataclass(frozen=True)
class Scenario:
    """A robot by the image of what is changed; `overlap` are the apps that must be served all the time."""

    robot: Callable[[str], Robot]
    overlap: Sequence[str] = ()
    versions: Sequence[str] = APP_VERSIONS


def one(name: str, **more: Any) -> Callable[[str], Robot]:
    return lambda wanted: robot(app(name, wanted, **more))


def master(wanted: str) -> Robot:
    return robot(app("sensor", OLD), master={"image": wanted})


def group(wanted: str) -> Robot:
    update = {"group": "temperature"}
    return robot(app("stats", wanted, depends_on=["sensor"], update=update), app("sensor", wanted, update=update))


def two(wanted: str) -> Robot:
    return robot(app("stats", wanted, depends_on=["sensor"]), app("sensor", wanted))


def fleet(wanted: str) -> Robot:
    return robot(app("chart", wanted, pattern="service", scope="fleet"), master={"mode": "shared", "image": OLD})


SCENARIOS = {
    "overlap": Scenario(one("sensor"), ["sensor"]),
    "drain": Scenario(one("planner", pattern="action", readiness={"actions": ["plan"]})),
    "replace": Scenario(one("driver", pattern=None)),
    "master": Scenario(master, versions=MASTER_VERSIONS),
    "group": Scenario(group, ["sensor", "stats"]),
    "two-steps": Scenario(two, ["sensor", "stats"]),
    "fleet": Scenario(fleet, ["chart"]),
}
MATRIX = [(name, version) for name, scenario in SCENARIOS.items() for version in scenario.versions]


def settings(**more: Any) -> Settings:
    return Settings(**{"ready_timeout": 30.0, "verify_seconds": 5.0, "busy_timeout": 60.0, **more})


def begin(name: str, version: str) -> tuple[Simulation, Robot, Robot]:
    """A robot on its old version, and the one that is wanted."""
    scenario, sim = SCENARIOS[name], Simulation()
    before = scenario.robot(OLD)
    sim.install(before)
    if version not in LATE:  # these pass for good ones until the old one has gone: no gate sees into the future
        sim.watched = set(scenario.overlap)
    return sim, before, scenario.robot(image(version))


def converge(sim: Simulation, wanted: Robot, version: str) -> None:
    """What the next runs come to when nothing is in the way any more."""
    expected = {"good": ["updated", "unchanged"], "crashes-once": ["updated", "unchanged", "rolled-back"]}
    first = sim.run(wanted, settings())
    assert first is not None
    assert first.outcome in expected.get(version, ["rolled-back"]), first
    second = sim.run(wanted, settings())
    assert second is not None
    good = first.outcome != "rolled-back"
    assert second.outcome in (
        ["unchanged"] if good else ["rolled-back", "updated"] if version == "crashes-once" else ["rolled-back"]
    )


@pytest.mark.parametrize(("name", "version"), MATRIX)
def test_every_fault_at_every_call(name: str, version: str) -> None:
    sim, _before, wanted = begin(name, version)
    clean = sim.run(wanted, settings())
    assert clean is not None
    assert clean.outcome == ("updated" if version == "good" else "rolled-back"), clean
    calls, runs = [*sim.calls], 1
    converge(sim, wanted, version)
    bad = []
    for fault in FAULTS:
        for at in range(1, len(calls) + 1):
            sim, _before, wanted = begin(name, version)
            try:
                sim.run(wanted, settings(), fault, at)
                sim.restore()
                converge(sim, wanted, version)
            except AssertionError as error:
                bad.append(f"{fault} at {at} ({calls[at - 1]}): {error}".splitlines()[0])
            runs += 3
    print(f"{name}, {version}: {len(calls)} calls, {runs} runs")
    assert not bad, "\n".join(bad)
