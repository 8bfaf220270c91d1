# SPDX-License-Identifier: GPL-3.0-or-later
"""A run that is silent says what it does and where that stands, and no more than that."""

from __future__ import annotations

from functools import partial

from ansible_collections.rosops.fleet.plugins.plugin_utils._report.silence import HOSTS, LOOK, Silence
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.ledger import Word


class Run:
    """Its clock stands unless told otherwise."""

    def __init__(self) -> None:
        self.now, self.said, self.words = 100.0, list[str](), list[Word]()
        self.silence = Silence(self.said.append, lambda: self.now, self.since)

    def since(self, moment: float) -> list[Word]:
        return [word for word in self.words if word.at >= moment]

    def word(self, host: str, text: str = "") -> None:
        self.words.append(Word(self.now, host, text))

    def passes(self, seconds: int) -> list[str]:
        """Looks as they come; what was said meanwhile."""
        before = len(self.said)
        for _look in range(int(seconds / LOOK)):
            self.now += LOOK
            self.silence.look()
        return self.said[before:]


def test_a_long_task_speaks_before_fifteen_seconds_and_again() -> None:
    run = Run()
    run.silence.begins("k3s : Download")
    assert run.passes(12) == []
    assert run.passes(8) == ["k3s : Download: goes on for 14 s now"]
    assert run.passes(20) == ["k3s : Download: goes on for 28 s now"]


def test_a_result_and_a_line_of_the_task_are_words_too() -> None:
    run = Run()
    run.silence.begins("Look")
    assert run.passes(12) == []
    for word in (
        partial(run.silence.heard, "robot1"),
        partial(run.word, "robot2"),
        partial(run.silence.begins, "Next"),
    ):
        word()
        assert run.passes(12) == []
    assert run.passes(2) == ["Next: goes on for 14 s now"]


def test_an_update_says_where_it_stands_though_it_says_nothing_else() -> None:
    """Each of its phases is short, so that none of them has a reason to speak."""
    run = Run()
    run.word("robot2", "of the task before")
    run.now += 1
    run.silence.begins("Update")
    run.word("robot1", "camera: record")
    run.word("robot2", "lidar: verify")
    run.word("robot3", "gps: apply")
    run.silence.heard("robot3")
    run.passes(10)
    run.word("robot1", "camera: rollout")
    assert run.passes(4) == [
        "Update: goes on for 14 s now: robot1: camera: rollout, for 4 s; robot2: lidar: verify, for 14 s"
    ]


def test_the_line_has_an_end_and_there_is_none_before_a_play() -> None:
    run = Run()
    assert run.passes(60) == []
    run.silence.begins("Update")
    for number in range(HOSTS + 45):
        run.word(f"robot{number}", "record")
    (line,) = run.passes(14)
    assert line.endswith("; and 45 others")
