# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Running an app's readiness command, with an end."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._pod.command import run_command


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (["true"], ""),
        (["sh", "-c", "echo fine"], ""),
        (["false"], "readiness.command exited with 1"),
        (["sh", "-c", "echo warming up; echo no fix yet >&2; exit 3"], "readiness.command exited with 3: no fix yet"),
        (["sh", "-c", "kill -9 $$"], "readiness.command was ended by signal 9"),
        (["/nowhere/ready"], "readiness.command cannot be run: /nowhere/ready: No such file or directory"),
        (["sh", "-c", "yes 2>/dev/null | head -c 300000; exit 1"], "readiness.command exited with 1: y"),
    ],
)
def test_a_commands_word(command: list[str], reason: str) -> None:
    assert run_command(command, 5.0) == reason


def test_commands_leave_no_file_open() -> None:
    files = Path("/proc/self/fd")
    before = len(list(files.iterdir()))
    for command in (["true"], ["/nowhere"], ["sh", "-c", "exit 1"]) * 10:
        run_command(command, 5.0)
    assert len(list(files.iterdir())) < before + 5


def test_a_command_that_does_not_end_is_ended_with_its_children(tmp_path: Path) -> None:
    mark = tmp_path / "mark"
    began = time.monotonic()
    script = f"(sleep 1; echo late > {mark}) & sleep 60"
    assert run_command(["sh", "-c", script], 0.2) == "readiness.command did not end within 0.2 s"
    assert time.monotonic() - began < 0.9
    time.sleep(1.1)
    assert not mark.exists()


def test_a_command_has_the_pods_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MARK", "here")
    assert run_command(["sh", "-c", '[ "$MARK" = here ]'], 5.0) == ""


def test_a_child_that_keeps_the_output_open_keeps_nobody_waiting() -> None:
    began = time.monotonic()
    assert run_command(["sh", "-c", "sleep 3 & exit 0"], 5.0) == ""
    assert time.monotonic() - began < 1
