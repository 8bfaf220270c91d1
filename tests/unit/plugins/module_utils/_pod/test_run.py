# SPDX-License-Identifier: GPL-3.0-or-later
"""How what runs in pods is started, by the Python that runs the tests."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._pod.run import ARCHIVE
from pod_code import write_code

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
    write_code(directory, {"_robot.main": text, "_pod.started": text, "_robot.run_of": RUN_OF, "_pod.run_of": RUN_OF})
    return again(directory, word)


def again(directory: Path, word: str) -> dict[str, Any]:
    """A start of what is there."""
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
        os.utime(pathlib.Path(__file__).with_name("code.json.gz"), (1, 1))  # other code, which has to be compiled
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


def test_a_start_that_finds_all_compiled_does_not_read_the_archive(tmp_path: Path) -> None:
    """The startup probe is one each second."""
    assert started(tmp_path, "started")["compiled"]
    archive = tmp_path / ARCHIVE
    status = archive.stat()
    archive.write_bytes(bytes(status.st_size))
    os.utime(archive, ns=(status.st_mtime_ns, status.st_mtime_ns))
    assert not again(tmp_path, "started")["compiled"]
    os.utime(archive, ns=(status.st_mtime_ns, status.st_mtime_ns + 1))
    with pytest.raises(AssertionError):  # other code, as it seems
        again(tmp_path, "started")
