# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene ends all that it started."""

from __future__ import annotations

from pathlib import Path

from scene import MARK, PYTHON, Scene, until
from started import marked

# Deaf to SIGTERM, with a child in a session of its own, as roslaunch's nodes are.
DEAF = """
import os, signal, sys, time
signal.signal(signal.SIGTERM, signal.SIG_IGN)
if os.fork() == 0:
    os.setsid()
print("up", flush=True)
time.sleep(600)
"""


def test_it_ends_what_nobody_holds_any_more(tmp_path: Path) -> None:
    scene = Scene(tmp_path)
    first = scene._start("listener", PYTHON, "-c", DEAF)
    scene._start("listener", PYTHON, "-c", DEAF)  # in the first one's place
    until("four processes", lambda: len(marked(MARK, scene.mark)) == 4 and scene.said("listener").count("up") == 4)
    scene.end()
    assert marked(MARK, scene.mark) == {}
    first.wait()
