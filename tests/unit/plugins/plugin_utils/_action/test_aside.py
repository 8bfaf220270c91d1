# SPDX-License-Identifier: GPL-3.0-or-later
"""Work in a process of its own, and the tasks that take turns with it."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.aside import Turns, begin, come_back
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.leftovers import started
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import until


def work(turns: Turns) -> Mapping[str, Any]:
    """What was told of its turns."""
    told = []
    for word in ("make", "undo"):
        try:
            turns.give(word)
            told.append(f"{word} went well")
        except FleetError as error:
            told.append(f"{word}: {error}")
    return {"told": told, "process": os.getpid()}


def test_two_turns_and_the_end() -> None:
    first = begin(work)
    assert first["turn"] == "make"
    line = first["line"]
    assert come_back(line, "no space left") == {"turn": "undo", "line": line}
    ended = come_back(line)
    assert ended["told"] == ["make: no space left", "undo went well"]
    assert ended["process"] != os.getpid()
    assert wait([os.pidfd_open(ended["process"])], 10)
    assert not Path(line).parent.exists()


def test_work_without_a_turn_has_its_word_at_once() -> None:
    assert begin(lambda _turns: {"outcome": "waiting"})["outcome"] == "waiting"


def test_what_breaks_or_ends_the_work_is_heard(tmp_path: Path) -> None:
    assert "ValueError: a mistake of ours" in begin(Mock(side_effect=ValueError("a mistake of ours")))["error"]
    with pytest.raises(FleetError, match="has ended without a word"):
        begin(lambda _turns: os._exit(9))
    with pytest.raises(FleetError, match="the process beside this run has ended: "):
        come_back(str(tmp_path / "line"))


RUN = """
import os, sys
from pathlib import Path
sys.path[:0] = {paths!r}
from ansible_collections.rosops.fleet.plugins.plugin_utils._action import aside

def killed(line):
    Path("line").write_text(line)
    os._exit(0)

def work(turns):
    Path("process").write_text(str(os.getpid()))
    try:
        turns.give("make")
    except BaseException as error:
        Path("ended").write_text(str(error))
        raise
    return {{}}

if os.fork() == 0:  # a task's worker, as Ansible has it
    if {killed}:  # before it calls
        aside.come_back = killed
    aside.begin(work)
    os._exit(0)
os.wait()
Path("task").write_text("has ended")
sys.stdin.read()  # the run goes on, until it is killed
"""


def test_it_outlives_its_task_and_ends_with_the_run(tmp_path: Path) -> None:
    program, ended = tmp_path / "run.py", tmp_path / "ended"
    program.write_text(RUN.format(paths=sys.path, killed=False))
    with subprocess.Popen([sys.executable, str(program)], cwd=tmp_path, stdin=subprocess.PIPE) as run:  # noqa: S603
        until((tmp_path / "task").exists)
        assert started(int((tmp_path / "process").read_text()))
        assert not ended.exists()
        run.kill()
        # nobody has waited for the run yet, as where a container's first process does not
        until(lambda: ended.exists() and ended.read_text())
    assert ended.read_text() == "the run was cancelled"


def test_a_worker_that_is_killed_before_it_calls_leaves_nothing_behind_its_run(tmp_path: Path) -> None:
    program = tmp_path / "run.py"
    program.write_text(RUN.format(paths=sys.path, killed=True))
    with subprocess.Popen([sys.executable, str(program)], cwd=tmp_path, stdin=subprocess.PIPE) as run:  # noqa: S603
        until((tmp_path / "task").exists)
        directory = Path((tmp_path / "line").read_text()).parent
        assert directory.exists()
        run.kill()
        until(lambda: not directory.exists())
