# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Polls keep away from scrapes."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.poller import too_near


@pytest.mark.parametrize(
    ("at", "near"), [(100.1, True), (101.4, True), (101.6, False), (105, False), (108.4, False), (108.6, True)]
)
def test_polls_keep_away_from_scrapes(at: float, near: bool) -> None:
    assert too_near(100, 110, at, 10) is near


def test_one_shift_is_enough() -> None:
    """Scrapes every ten seconds, as the polls, at whatever time: after one shift they are not near again."""
    for tenth in range(100):
        scrape, last, due, shifts = 100 + tenth / 10, 100.0, 110.0, 0
        for _round in range(5):
            if too_near(last, due, scrape, 10):
                shifts += 1
                due += 3
            while due <= scrape + 10:
                last, due = due, due + 10
            scrape += 10
        assert shifts <= 1, tenth
