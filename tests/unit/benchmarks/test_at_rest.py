# SPDX-License-Identifier: GPL-3.0-or-later
"""How the cost of a robot at rest is counted."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import Any

import pytest

sys.path.append(str(Path(__file__).resolve().parents[2] / "ros"))

import at_rest
from at_rest import LIMIT, LIMIT_MB, Row


def found(cpu: float, memory: float, earlier: float = at_rest.EARLIER_SHARE) -> dict[str, Any]:
    rows = [Row("master", 100.0, ours=False), Row("keeper", cpu, memory, 1.0), Row("probes", 0.0)]
    return {"rows": rows, "earlier": earlier}


@pytest.mark.parametrize(
    ("cpu", "memory", "earlier", "passed"),
    [
        (LIMIT, LIMIT_MB, 56.0, True),
        (LIMIT + 0.1, 20.0, 56.0, False),
        (1.0, LIMIT_MB + 0.1, 56.0, False),
        (LIMIT / 4, 20.0, 14.0, True),  # a core four times as fast has to do it in a quarter
        (LIMIT / 3, 20.0, 14.0, False),
        (LIMIT, 20.0, 100.0, True),  # a slower one need not do better
    ],
)
def test_the_limit_is_of_the_slow_core_and_what_is_not_ours_is_no_part_of_it(
    cpu: float, memory: float, earlier: float, passed: bool
) -> None:
    total = at_rest.verdict(found(cpu, memory, earlier))
    assert total["passed"] is passed
    assert total["cpu"] == round(cpu, 2)
    assert "ours together" in at_rest.report(found(cpu, memory, earlier))


def test_a_process_that_is_started_counts_and_a_start_alone_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(at_rest, "BURST", 2)
    busy = {"exec": {"command": [sys.executable, "-S", "-c", "sum(range(300000))"]}, "periodSeconds": 2}
    assert at_rest.probing({"readinessProbe": busy}, os.getpid(), 0) > 0.5
    assert at_rest.probing({"startupProbe": busy}, os.getpid(), 0) == 0.0


def test_the_robots_pods_start_nothing_at_rest() -> None:
    robot = at_rest.specification()
    assert len(robot.apps) == at_rest.APPS
    objects = [*at_rest.master_objects(robot), *at_rest.app_objects(robot)]
    for one in objects:
        if one["kind"] == "Deployment":
            assert not any(
                "exec" in probe for probe in at_rest.probes(at_rest.container(objects, one["metadata"]["name"]))
            )


def test_processor_time_of_a_process() -> None:
    before, end = at_rest.cpu_seconds(os.getpid()), time.process_time() + 0.05
    while time.process_time() < end:
        pass
    assert 0.04 < at_rest.cpu_seconds(os.getpid()) - before < 5
