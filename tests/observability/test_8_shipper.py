# SPDX-License-Identifier: GPL-3.0-or-later
"""The log shipper switched off and on again: one variable, and no line is lost or there twice."""

from __future__ import annotations

import time

import gaps
import pytest
from runs import wait_until
from watched import NAMESPACE, ROBOTS, STREAM, Watched

BEGAN = 1500.0  # so far back lines are looked at: those before and those after the change


def counted(fleet: Watched, robot: str) -> tuple[gaps.Numbers, float]:
    """The numbered lines, and how many seconds they are behind."""
    now = time.time()
    found = fleet.counted(robot, now - BEGAN)
    run = max(found)
    return found[run], now - (float(run) + found[run].last / 10)


@pytest.mark.faults
def test_off_and_on_again(fleet: Watched) -> None:
    """What the pods wrote meanwhile is brought once it is back."""
    for shipper in ("none", "otelcol"):
        run = fleet.run("site", "--tags", "observability", observability_log_shipper=shipper)
        assert run.status == 0, run
        assert run.changed > 0, run
        for robot in ROBOTS:
            wait_until(
                lambda: bool(fleet.pods(robot, NAMESPACE, "log-shipper")),  # noqa: B023
                lambda there: there is (shipper == "otelcol"),  # noqa: B023
                60,
                f"the log shipper of {robot}",
            )
    for robot in ROBOTS:
        wait_until(lambda: counted(fleet, robot)[1], lambda late: late < 15, 90, f"new lines of {robot}", pause=2)  # noqa: B023
        lines, _late = counted(fleet, robot)
        assert (lines.missing, lines.twice) == (0, 0), f"{robot}: {lines}"
        now = time.time()
        streams = fleet.loki.streams(f'{{robot="{robot}",app="counter"}}', now - 20, now)
        assert [set(labels) for labels in streams] == [STREAM], streams
        fleet.say(f"{robot}: {lines.last - lines.first + 1} lines, the shipper off and on again, each there once")
