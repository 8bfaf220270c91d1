# SPDX-License-Identifier: GPL-3.0-or-later
"""How what runs in pods is started, by the Python that runs the tests."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.code_files import app_files

LOOKS = """
import http.server, hashlib, json, os, shutil, sys
from . import run_of

def main(words):
    hashlib.blake2b(b"").digest()
    loaded = [name for name in ("ssl", "_ssl", "_hashlib", "_bz2", "_lzma") if sys.modules.get(name)]
    told = {"words": words, "optimize": sys.flags.optimize, "loaded": loaded, "compiled": run_of.loader().compiled}
    print(json.dumps({**told, "pid": os.getpid()}))
    return 3
"""
RUN_OF = """
import sys

def loader():
    return sys.modules["__main__"].Loader
"""


def started(directory: Path, word: str, text: str = LOOKS) -> dict[str, Any]:
    for name, content in app_files().items():
        (directory / name).write_text(content)
    for module in ("_robot.main", "_pod.started"):
        (directory / f"{module}.py").write_text(text)
        (directory / f"{module.partition('.')[0]}.run_of.py").write_text(RUN_OF)
    command = [sys.executable, "-I", "-S", str(directory / "run.py"), word, "--record", "x"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)  # noqa: S603 - our own
    said = process.communicate(timeout=60)[0]
    assert process.returncode == 3, said
    assert json.loads(said)["pid"] == process.pid  # the pod's process 1 is still itself
    return dict(json.loads(said))


def test_what_lives_long_compiles_nothing_and_loads_only_what_it_needs(tmp_path: Path) -> None:
    """What compiling leaves in a process's memory stays there."""
    told = started(tmp_path, "keeper")
    assert (told["words"], told["loaded"], told["optimize"]) == (["--record", "x"], ["ssl", "_ssl"], 2)
    assert not told["compiled"]


AGAIN = """
import os, pathlib

def main(words):
    mark = pathlib.Path(os.environ["MARK"])
    if not mark.exists():
        mark.write_text("x")
        os.utime(__file__, (1, 1))  # other code, which has to be compiled
        return -1
    return looked(words)
"""


def test_what_asks_to_begin_anew_does_so_with_nothing_left_of_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MARK", str(tmp_path / "mark"))
    told = started(tmp_path, "keeper", LOOKS.replace("def main", "def looked") + AGAIN)
    assert (told["words"], told["optimize"], told["compiled"]) == (["--record", "x"], 2, False)


def test_a_probe_is_one_process(tmp_path: Path) -> None:
    assert started(tmp_path, "started")["optimize"] == 0
