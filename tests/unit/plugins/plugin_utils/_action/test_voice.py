# SPDX-License-Identifier: GPL-3.0-or-later
"""What a worker says reaches the main process alone, also under a callback that writes marks around each line."""

from __future__ import annotations

import io
import multiprocessing
import sys
from multiprocessing.queues import SimpleQueue

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._action import voice

FORK = multiprocessing.get_context("fork")


def works(lines: SimpleQueue[str]) -> None:
    """A worker of ansible-core 2.19: whatever is in its stdout in the end is warned of."""

    def marked(line: str) -> None:
        print("mark")
        lines.put(line)

    sys.stdout = io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(voice.display, "display", marked)
        voice.say("robot1", "waits")
    lines.put(f"left: {sys.stdout.getvalue()!r}")


def test_nothing_is_left_in_a_workers_own_stdout() -> None:
    lines: SimpleQueue[str] = FORK.SimpleQueue()
    worker = FORK.Process(target=works, args=(lines,))
    worker.start()
    assert [lines.get(), lines.get()] == ["[robot1] waits", "left: ''"]
    worker.join()


def test_a_name_can_write_neither_to_the_terminal_nor_another_hosts_line(capsys: pytest.CaptureFixture[str]) -> None:
    """The main process prints as ever."""
    voice.say("robot1", "busy: /a\x1b[2J\x9b1m\n[robot2] failed")
    assert capsys.readouterr().out == "[robot1] busy: /a\\x1b[2J\\x9b1m\n  [robot2] failed\n"
