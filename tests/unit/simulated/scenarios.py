# SPDX-License-Identifier: GPL-3.0-or-later
"""Robots on an old version, what a step makes of them, and how a run of the engine went, for tests of its parts."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.engine import Engine
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.hands import Settings
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import RobotOutcome
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.plan import Request
from ansible_collections.rosops.fleet.tests.unit.robots import robot
from ansible_collections.rosops.fleet.tests.unit.simulated.objects import app
from ansible_collections.rosops.fleet.tests.unit.simulated.robot import image
from ansible_collections.rosops.fleet.tests.unit.simulated.world import CLUSTER_CALLS, FAULTS, Simulation

OLD = image("good", 0)
ALL = bool(os.environ.get("ROSOPS_TEST_ALL"))  # what takes minutes, too
EVERY = 1 if ALL else 3  # of the calls at which a run may be cut off


APP_VERSIONS = (
    "good", "crashes-once", "never-starts", "never-connects", "half-the-rate", "offers-less", "crashes-at-once",
    "crashes-when-ready", "hangs",
)  # fmt: skip


MASTER_VERSIONS = ("good", "never-starts", "crashes-at-once", "crashes-when-ready")


@dataclass(frozen=True)
class Scenario:
    """A robot by the image of what is changed."""

    robot: Callable[[str], Robot]
    versions: Sequence[str] = APP_VERSIONS


def one(name: str, **more: Any) -> Callable[[str], Robot]:
    return lambda wanted: robot(app(name, wanted, placement="local", **more))


def master(wanted: str) -> Robot:
    container = {"name": "ros-master-container", "image": wanted}
    overrides = {"spec": {"template": {"spec": {"containers": [container]}}}}
    return robot(app("sensor", OLD), master={"image": OLD, "overrides": overrides})


def keeper_and_master(wanted: str) -> Robot:
    return robot(app("sensor", OLD), master={"image": wanted})


def group(wanted: str) -> Robot:
    update = {"group": "temperature"}
    return robot(app("stats", wanted, depends_on=["sensor"], update=update), app("sensor", wanted, update=update))


def two(wanted: str) -> Robot:
    return robot(app("stats", wanted, depends_on=["sensor"]), app("sensor", wanted))


def fleet(wanted: str) -> Robot:
    return robot(app("chart", wanted, pattern="service", scope="fleet"), master={"mode": "shared", "image": OLD})


def shared(wanted: str) -> Robot:
    return robot(app("sensor", wanted, placement="local"), master={"mode": "shared", "image": OLD})


SCENARIOS = {
    "overlap": Scenario(one("sensor")),
    "drain": Scenario(one("planner", pattern="action", readiness={"actions": ["plan"]})),
    "replace": Scenario(one("driver", pattern=None)),
    "master": Scenario(master, versions=MASTER_VERSIONS),
    "keeper-and-master": Scenario(keeper_and_master, versions=MASTER_VERSIONS),
    "launch": Scenario(one("base", launch={"package": "base", "file": "base.launch"})),
    "launch-held": Scenario(one("arm", launch={"package": "arm", "file": "arm.launch", "replace": ["arm_held"]})),
    "group": Scenario(group),
    "two-steps": Scenario(two),
    "fleet": Scenario(fleet),
    "overlap-shared": Scenario(shared, versions=("good", "never-connects", "half-the-rate")),
}


INFRASTRUCTURE = ("master", "keeper-and-master")  # whoever takes steps back for others


def settings(parts: Collection[str] | None = None, **more: Any) -> Settings:
    if parts is not None:
        more["request"] = replace(more.get("request", Request()), parts=parts)
    return Settings(**{"ready_timeout": 30.0, "busy_timeout": 60.0, "verify_seconds": 10.0, **more})


def begin(name: str, version: str) -> tuple[Simulation, Robot]:
    """A robot on its old version, and the one that is wanted."""
    scenario, sim = SCENARIOS[name], Simulation()
    sim.install(scenario.robot(OLD))
    return sim, scenario.robot(image(version))


def running(sim: Simulation, app: str) -> list[str]:
    """The versions of an app that are part of the graph."""
    return [
        pod.template for pod in sim.pods if pod.app == app and pod.up and sim.registered.get(pod.node) is pod.process
    ]


def outcome_of(sim: Simulation, wanted: Robot, fault: str = "", at: int = 0, **more: Any) -> RobotOutcome:
    found = sim.run(wanted, settings(**more), fault, at)
    assert found is not None
    return found


def run_of(sim: Simulation, wanted: Robot, **more: Any) -> tuple[RobotOutcome, Engine]:
    return outcome_of(sim, wanted, **more), sim.engine


def spied(patch: pytest.MonkeyPatch, of: type, name: str) -> list[dict[str, Any]]:
    """What a method is asked from now on: the arguments of each call, by their names."""
    method, calls = getattr(of, name), list[dict[str, Any]]()

    def asked(*words: Any, **more: Any) -> Any:
        given = inspect.signature(method).bind(*words, **more)
        given.apply_defaults()
        calls.append(given.arguments)
        return method(*words, **more)

    patch.setattr(of, name, asked)
    return calls


def points(sim: Simulation, faults: Sequence[str] = FAULTS) -> list[tuple[str, int]]:
    """Faults, and the calls of its last run at which they can strike.

    A wait asks the same again and again: but for `ALL`, a call is one of them once in its phase after the same call.
    """
    found = dict[object, int]()
    for at, where in enumerate(zip(sim.phases, ["", *sim.calls], sim.calls), 1):
        found.setdefault(at if ALL else where, at)
    return [(fault, at) for at in found.values() for fault in faults if strikes(fault, sim.calls[at - 1])]


def strikes(fault: str, call: str) -> bool:
    """Only an apply can be cut in half, and the API is not the robot, which goes away after its answer."""
    if fault.startswith("half"):
        return call == "apply"
    return fault != "away-after" or call not in CLUSTER_CALLS


def drawn(
    points: Sequence[tuple[str, int]], share: int, turn: int, whole: Collection[str] = ()
) -> list[tuple[str, int]]:
    """One of every `share`, turned by `turn`; all of those with the faults in `whole`."""
    return [point for number, point in enumerate(points, turn) if number % share == 0 or point[0] in whole]


MATRIX = [(name, version) for name, scenario in SCENARIOS.items() for version in scenario.versions]
