# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Run an app's readiness command, with an end."""

from __future__ import annotations

import os
import signal
import time

OUTPUT = 4096  # of which the last line is told
PAUSES = (0.001, 0.002, 0.005, 0.01, 0.02)


def run_command(command: list[str], seconds: float) -> str:
    """Why it did not end with status 0, or nothing if it did.

    Not by subprocess: importing that would cost more than most of these commands.
    """
    reader, writer = os.pipe()
    try:
        actions = [(os.POSIX_SPAWN_DUP2, writer, 1), (os.POSIX_SPAWN_DUP2, writer, 2)]
        # there is no AnsibleModule in a pod, whose run_command would be called
        # pylint: disable-next=ansible-bad-function
        child = os.posix_spawnp(command[0], command, os.environ, file_actions=actions, setpgroup=0)
    except OSError as error:
        os.close(reader)
        return f"readiness.command cannot be run: {command[0]}: {error.strerror}"
    finally:
        os.close(writer)
    try:
        os.set_blocking(reader, False)
        status, output = _wait(child, reader, time.monotonic() + seconds)
    finally:
        os.close(reader)
    if status is None:
        return f"readiness.command did not end within {seconds:g} s"
    if status == 0:
        return ""
    lines = output.decode("utf-8", "replace").strip().splitlines()
    how = (
        f"exited with {os.WEXITSTATUS(status)}"
        if os.WIFEXITED(status)
        else f"was ended by signal {os.WTERMSIG(status)}"
    )
    return f"readiness.command {how}" + (f": {lines[-1][:200]}" if lines else "")


def _wait(child: int, reader: int, end: float) -> tuple[int | None, bytes]:
    """Its status, None if it had to be killed, and the end of what it wrote."""
    output, turn = b"", 0
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        output = (output + _read(reader))[-OUTPUT:]
        if done:
            return status, output
        if time.monotonic() > end:
            os.killpg(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return None, output
        time.sleep(PAUSES[min(turn, len(PAUSES) - 1)])
        turn += 1


def _read(reader: int) -> bytes:
    try:
        return os.read(reader, 1 << 16)
    except BlockingIOError:
        return b""
