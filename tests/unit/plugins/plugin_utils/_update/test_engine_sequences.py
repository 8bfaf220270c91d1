# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sequences that nobody thought of: versions, runs, faults, goals and time in any order.

The simulated world holds its invariants at every moment, and each outcome's word against what is there. At the end
nothing is in the way any more, and the next runs have to converge.
"""

from __future__ import annotations

import os
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._update.plan import Request
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.scenarios import (
    OLD,
    SCENARIOS,
    settings,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.simulated_robot import (
    FOREVER,
    image,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.simulation import FAULTS, Simulation
from hypothesis import HealthCheck
from hypothesis import settings as bounds
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule

EXAMPLES = 2000 if os.environ.get("ROSOPS_TEST_ALL") else 60
calls = st.integers(1, 20)
faults = st.sampled_from(("", *FAULTS))


class Operators(RuleBasedStateMachine):
    """One robot, whoever works on it, and whatever happens to it."""

    @initialize(name=st.sampled_from(sorted(SCENARIOS)))
    def install(self, name: str) -> None:
        self.sim, self.scenario, self.number = Simulation(), SCENARIOS[name], 0
        self.version, self.image = "good", OLD
        self.sim.install(self.robot)

    @property
    def robot(self) -> Any:
        return self.scenario.robot(self.image)

    @rule(data=st.data())
    def want(self, data: st.DataObject) -> None:
        self.version = data.draw(st.sampled_from(self.scenario.versions), "version")
        self.number += 1
        self.image = image(self.version, self.number)

    @rule()
    def want_the_first_again(self) -> None:
        self.version, self.image = "good", OLD

    @rule(fault=faults, at=calls, then=st.tuples(calls, faults))
    def run_it(self, fault: str, at: int, then: tuple[int, str]) -> None:
        self.sim.run(self.robot, settings(), fault, at, then)

    @rule(fault=faults, at=calls)
    def run_it_back(self, fault: str, at: int) -> None:
        self.sim.run(self.robot, settings(request=Request(to="previous")), fault, at)

    @rule()
    def only_look(self) -> None:
        self.sim.run(self.robot, settings(check=True))

    @rule(seconds=st.sampled_from((1.0, 10.0, 70.0, 300.0)))
    def time_passes(self, seconds: float) -> None:
        self.sim.advance(seconds)

    @precondition(lambda self: "planner" in {app.name for app in self.robot.apps})
    @rule(seconds=st.sampled_from((1.0, 8.0, 20.0)), after=st.sampled_from((0.0, 5.0)))
    def a_goal_comes(self, seconds: float, after: float) -> None:
        self.sim.goal("/plan", seconds, after)

    @rule()
    def the_robot_leaves(self) -> None:
        self.sim.robot_until = FOREVER

    @rule()
    def the_api_goes(self) -> None:
        self.sim.api_until = FOREVER

    @rule()
    def all_is_well(self) -> None:
        self.sim.restore()

    def teardown(self) -> None:
        if not hasattr(self, "sim"):
            return
        self.sim.restore()
        self.sim.advance(60.0)  # what was sent is done
        words = [outcome.outcome for _time in range(3) if (outcome := self.sim.run(self.robot, settings()))]
        expected = {"good": ["unchanged"], "crashes-once": ["unchanged", "rolled-back"]}
        assert words[-1] in expected.get(self.version, ["rolled-back"]), words


TestOperators = Operators.TestCase
TestOperators.settings = bounds(
    max_examples=EXAMPLES,
    stateful_step_count=12,
    deadline=None,
    derandomize=True,
    database=None,
    print_blob=False,
    suppress_health_check=list(HealthCheck),
)
