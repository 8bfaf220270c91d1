# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import FAIL, PASS, WAIT, Seen, overall, poll


@pytest.mark.parametrize(
    ("verdicts", "how", "expected"),
    [
        ([PASS], {"timeout": 60, "interval": 0.5}, {"verdict": PASS, "last": "look 1", "looks": 1, "naps": []}),
        # looks start one interval apart, whatever a look takes; one that takes longer is followed at once
        ([WAIT, WAIT, WAIT, PASS], {"timeout": 60, "interval": 0.5, "look": 0.2},
         {"starts": [0, 0.5, 1.0, 1.5], "naps": [0.3, 0.3, 0.3], "elapsed": 1.7}),
        ([WAIT, WAIT, PASS], {"timeout": 60, "interval": 0.5, "look": 2.0}, {"starts": [0, 2, 4], "naps": []}),
        ([WAIT, FAIL, PASS], {"timeout": 60, "interval": 1}, {"verdict": FAIL, "last": "look 2", "looks": 2}),
        # the last look is at the end
        ([WAIT], {"timeout": 1.2, "interval": 0.5},
         {"starts": [0, 0.5, 1.0, 1.2], "verdict": WAIT, "last": "look 4", "timed_out": True, "elapsed": 1.2}),
        ([WAIT, WAIT, WAIT, PASS], {"timeout": 1.2, "interval": 0.5}, {"verdict": PASS, "timed_out": False}),
        ([WAIT], {"timeout": 0, "interval": 0.5}, {"looks": 1, "verdict": WAIT, "naps": []}),
        ([PASS, PASS, WAIT, PASS, PASS, PASS], {"timeout": 60, "interval": 1, "consecutive": 3},
         {"verdict": PASS, "looks": 6, "passes": 3}),
        ([PASS], {"timeout": 1, "interval": 1, "consecutive": 3}, {"verdict": WAIT, "passes": 2, "timed_out": True}),
        # from the start of the first look that passed to the end of the last one, which is just at the end
        ([WAIT, PASS], {"timeout": 60, "interval": 0.5, "stable": 1.2},
         {"starts": [0, 0.5, 1.0, 1.5, 1.7], "verdict": PASS, "passes": 4, "held": 1.2, "elapsed": 1.7}),
        ([PASS], {"timeout": 60, "interval": 0.5, "stable": 2, "look": 1.0}, {"looks": 2, "elapsed": 2, "held": 2}),
        ([PASS, PASS, WAIT, PASS], {"timeout": 60, "interval": 1, "stable": 2},
         {"starts": [0, 1, 2, 3, 4, 5], "verdict": PASS, "held": 2}),
        ([WAIT, WAIT, PASS], {"timeout": 3, "interval": 1, "stable": 5},
         {"verdict": WAIT, "timed_out": True, "passes": 2, "held": 1}),
        ([PASS, WAIT], {"timeout": 1, "interval": 1, "stable": 5}, {"held": 0}),
        ([PASS, FAIL], {"timeout": 60, "interval": 1, "stable": 10}, {"verdict": FAIL, "looks": 2, "held": 0}),
        ([PASS], {"timeout": 60, "interval": 1, "consecutive": 4, "stable": 1}, {"looks": 4}),
        ([PASS], {"timeout": 60, "interval": 1, "consecutive": 2, "stable": 3}, {"looks": 4}),
    ],
)  # fmt: skip
def test_how_a_poll_goes_on_a_clock_that_only_sleeping_and_looking_move(
    verdicts: list[str], how: dict[str, Any], expected: dict[str, Any]
) -> None:
    look, now, starts, naps = how.pop("look", 0.0), [0.0], list[float](), list[float]()

    def probe() -> Seen:
        starts.append(now[0])
        now[0] += look
        return Seen(verdicts[min(len(starts), len(verdicts)) - 1], f"look {len(starts)}")

    def sleep(seconds: float) -> None:
        assert seconds > 0
        naps.append(seconds)
        now[0] += seconds

    ended = poll(probe, **how, now=lambda: now[0], sleep=sleep)
    seen = {"starts": starts, "naps": naps}
    for key, value in expected.items():
        found = seen.get(key, getattr(ended, key, None))
        assert found == (value if isinstance(value, str) else pytest.approx(value)), key


@pytest.mark.parametrize(
    ("verdicts", "expected"), [([], PASS), ([PASS, PASS], PASS), ([PASS, WAIT], WAIT), ([WAIT, FAIL, PASS], FAIL)]
)
def test_overall(verdicts: list[str], expected: str) -> None:
    assert overall(verdicts) == expected
