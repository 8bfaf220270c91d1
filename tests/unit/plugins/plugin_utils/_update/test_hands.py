# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""How the engine waits for a robot."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import PATIENCE
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.scenarios import begin, settings
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.simulation import SimulatedHost


def test_a_look_lasts_until_a_silent_peer_is_known_and_the_graph_was_stable_after_that(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sim, wanted = begin("overlap", "good")
    asked, ready = [], SimulatedHost.ready

    def noted(host: SimulatedHost, master: str, conditions: Any, timeout: float, stable: float = 0.0) -> Any:
        asked.append((timeout, stable))
        return ready(host, master, conditions, timeout, stable)

    monkeypatch.setattr(SimulatedHost, "ready", noted)
    assert sim.run(wanted, settings(verify_seconds=30.0)).outcome == "updated"
    (first, last) = asked  # between them only pods are watched
    assert first[1] == 1.0
    assert first[0] > 1.0 + PATIENCE
    assert last[1] == 0.0
