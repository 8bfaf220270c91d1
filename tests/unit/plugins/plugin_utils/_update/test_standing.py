# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where tasks stand, from one process to another."""

from __future__ import annotations

from pathlib import Path

from ansible_collections.rosops.fleet.plugins.plugin_utils._update.standing import NAME, Standing, Word


def test_words_are_read_since_a_moment_and_whole(tmp_path: Path) -> None:
    times = iter([1.0, 2.0, 3.0])
    standing = Standing(tmp_path, lambda: next(times))
    assert standing.words(0.0) == []
    standing.note("robot1", "record")
    standing.note("robot2")
    standing.note("robot1", "gate")
    with (tmp_path / NAME).open("a") as file:
        file.write('[4.0, "rob')
    assert standing.words(2.0) == [Word(2.0, "robot2"), Word(3.0, "robot1", "gate")]
