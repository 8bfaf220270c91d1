# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A run that is silent says what it does, and no more than that."""

from __future__ import annotations

from ansible_collections.rosops.fleet.plugins.plugin_utils._report.silence import LOOK, SPEAK, Silence


class Run:
    """Its clock stands unless told otherwise."""

    def __init__(self) -> None:
        self.now, self.said = 100.0, list[str]()
        self.silence = Silence(self.said.append, lambda: self.now)

    def passes(self, seconds: int) -> list[str]:
        """Looks as they come; what was said meanwhile."""
        before = len(self.said)
        for _look in range(int(seconds / LOOK)):
            self.now += LOOK
            self.silence.look()
        return self.said[before:]


def test_a_long_task_speaks_before_twenty_seconds_and_again() -> None:
    run = Run()
    run.silence.begins("k3s : Download", "rosops.fleet.k3s_download")
    assert run.passes(14) == []
    assert run.passes(6) == ["k3s : Download: goes on for 16 s now"]
    assert run.passes(20) == ["k3s : Download: goes on for 32 s now"]


def test_a_result_is_a_word_too() -> None:
    run = Run()
    run.silence.begins("Look", "x")
    run.passes(14)
    run.silence.heard()
    assert run.passes(14) == []
    run.silence.begins("Next", "x")
    assert run.passes(14) == []


def test_nothing_is_said_before_a_task_nor_of_one_that_speaks() -> None:
    run = Run()
    assert run.passes(60) == []
    run.silence.begins("Update", SPEAK[0])
    assert run.passes(60) == []
