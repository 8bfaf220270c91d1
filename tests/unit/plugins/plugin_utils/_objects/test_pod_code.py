# SPDX-License-Identifier: GPL-3.0-or-later
"""The code that goes into pods: complete, runnable from a read-only mount, and in every namespace that needs it."""

from __future__ import annotations

import ast
import io
import json
import os
import subprocess
import sys
import time
import tokenize
import urllib.request
from pathlib import Path
from tokenize import COMMENT

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._pod.run import ARCHIVE, COMMANDS
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.pod_code import (
    LAUNCHER,
    MODULE_UTILS,
    bare,
    code_maps,
    packed,
    pod_files,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils.pythons import pythons
from ansible_collections.rosops.fleet.tests.unit.robots import robot
from pod_code import modules, write_code

FILES = pod_files()


def test_it_fits_and_the_same_sources_are_the_same_bytes() -> None:
    [held] = code_maps(robot(), FILES)
    assert sum(map(len, FILES.values())) < 150_000  # that a robot takes in etcd, which has them as they are
    assert (set(held["data"]), set(held["binaryData"])) == ({"run.py", "_pod.launch.py"}, {ARCHIVE})
    assert {*COMMANDS.values(), "_pod.namesake", "_pod.params"} <= set(modules())
    assert packed(modules()) == packed(dict(reversed(modules().items()))) == FILES[ARCHIVE]


def told(text: str) -> tuple[str, list[tuple[str, int]]]:
    """A source as it is compiled without docstrings, and the lines of its parts."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            node.value.value = ""
    return ast.dump(tree), [(type(node).__name__, getattr(node, "lineno", 0)) for node in ast.walk(tree)]


@pytest.mark.parametrize("path", sorted(MODULE_UTILS.rglob("*.py")), ids=lambda path: path.stem)
def test_a_source_without_comments_is_the_same_program(path: Path) -> None:
    text = path.read_text("utf-8")
    assert told(bare(text)) == told(text)
    comments = [one.string for one in tokenize.generate_tokens(io.StringIO(bare(text)).readline) if one.type == COMMENT]
    assert comments == ["# SPDX-License-Identifier: GPL-3.0-or-later"]


# --- run from a mount -------------------------------------------------------------------------------------------------


# `exec` waits for the master before it loads some modules: the kubelet may have brought other files meanwhile.
@pytest.mark.parametrize("early", ["", "_common.errors"], ids=["nothing was compiled before", "something was"])
def test_whatever_is_loaded_late_is_of_the_version_that_was_started(tmp_path: Path, early: str) -> None:
    write_code(tmp_path)
    # which have need of _pod.launch at their start
    names = sorted({*modules()} - {early, "_pod.started", "_robot.readiness", "_robot.main"})
    text = (tmp_path / "run.py").read_text().rpartition("if __name__")[0]
    first = f"importlib.import_module(f'{{ROOT}}.{early}')" if early else ""
    script = "\n".join(
        [
            *(text, "import shutil", "sys.dont_write_bytecode = True"),
            *(f"sys.meta_path.append(Rooms({str(tmp_path)!r}))", first, f"shutil.rmtree({str(tmp_path)!r})"),
            *(f"for name in {names!r}:", "    found = importlib.import_module(f'{ROOT}.{name}')"),
            *("print(found.__name__, found.__file__)", "import rosops_fleet._ros.missing"),
        ]
    )
    found = subprocess.run([sys.executable, "-I", "-c", script], capture_output=True, text=True, check=False)  # noqa: S603
    assert found.stdout == f"rosops_fleet.{names[-1]} {tmp_path}/{names[-1]}.py\n", found.stderr
    assert f"No such file or directory: '{tmp_path}/_ros.missing.py'" in found.stderr


def mounted(place: Path) -> Path:
    """As the kubelet mounts a ConfigMap: links into a directory with a changing name."""
    real = place / "hooks" / "..2026_01_01"
    real.mkdir(parents=True)
    write_code(real)
    (place / "hooks" / "..data").symlink_to(real.name)
    for path in real.iterdir():
        (place / "hooks" / path.name).symlink_to(f"..data/{path.name}")
    return place / "hooks"


ENVIRON = {
    "PATH": os.environ["PATH"],
    "ROSOPS_SETTINGS": json.dumps({"node": "/a", "expect_node": False}),
    "ROSOPS_NODE_NAME": "a",
    "ROS_MASTER_URI": "http://127.0.0.1:9/",
}


def run(command: list[str], **environ: str) -> tuple[int, str]:
    around = {**ENVIRON, **environ}
    found = subprocess.run(command, capture_output=True, text=True, check=False, env=around, cwd="/", timeout=60)  # noqa: S603
    return found.returncode, found.stdout + found.stderr


@pytest.mark.parametrize("python", pythons())
@pytest.mark.parametrize("word", ["started", "stop"])
def test_it_runs_from_a_mount_and_writes_nothing_there(tmp_path: Path, word: str, python: str) -> None:
    place = mounted(tmp_path)
    before = sorted(place.rglob("*"))
    said = "rosops.fleet: left to SIGTERM: the ROS master does not answer" if word == "stop" else ""
    status, output = run([python, "-I", "-S", str(place / "run.py"), word])
    assert (status, output[: len(said)], bool(output)) == (0, said, bool(said))
    assert sorted(place.rglob("*")) == before


@pytest.mark.parametrize(("words", "code"), [([], 2), (["jump"], 2), (["keeper", "--jump", "1"], 1)])
def test_other_words_are_explained(tmp_path: Path, words: list[str], code: int) -> None:
    place = mounted(tmp_path)
    status, output = run([sys.executable, "-I", "-S", str(place / "run.py"), *words])
    assert (status, "usage: " in output) == (code, True)


@pytest.mark.parametrize("python", pythons())
def test_what_shows_metrics_runs_from_a_mount_without_a_master(tmp_path: Path, python: str) -> None:
    place, port = mounted(tmp_path), str(20000 + os.getpid() % 10000)
    before, words = sorted(place.rglob("*")), ["keeper", "--keep", "off", "--port", port]
    command = [python, "-I", "-S", str(place / "run.py"), *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=ENVIRON) as process:  # noqa: S603 - our own
        assert process.stdout is not None
        process.stdout.readline()  # it serves
        end, text = time.monotonic() + 60, ""
        while "ros_master_up 0.0\n" not in text and time.monotonic() < end:
            text = urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=5).read().decode()
        process.kill()
    assert 'ros_exporter_scrape_errors_total{reason="refused"} 1.0\n' in text
    assert sorted(place.rglob("*")) == before


# --- where it is ------------------------------------------------------------------------------------------------------


def test_a_map_is_in_each_namespace_in_use() -> None:
    """What it has where stands in the golden files; apps of the fleet need theirs at any master."""
    of_fleet = {"name": "a", "image": "example.org/a:1", "args": ["x"], "scope": "fleet"}
    made = robot(of_fleet, name="r1", master={"mode": "external", "uri": "http://192.0.2.1:11311"})
    assert [one["metadata"]["namespace"] for one in code_maps(made, FILES)] == ["robot-r1", "fleet"]


# --- what starts a launch file, in an image whose ROS lies below /opt/ros ---------------------------------------------

LAUNCHED = ["/bin/sh", "-c", LAUNCHER, "roslaunch", "a.launch"]


def test_a_command_without_the_entry_point_is_told_of_it() -> None:
    """An image like ros:noetic has roslaunch, and its PATH leads there only after the entry point."""
    said = "rosops.fleet: this image has no roslaunch, or /ros_entrypoint.sh is not in its command\n"
    assert run(LAUNCHED, PATH="/nowhere") == (127, said)


def test_it_runs_on_roslaunchs_own_interpreter(tmp_path: Path) -> None:
    program = tmp_path / "roslaunch"
    program.write_text("#!/bin/echo by\n")
    program.chmod(0o755)
    status, said = run(LAUNCHED, PATH=f"{tmp_path}:/usr/bin:/bin")
    assert (status, said.split()[0], said.split()[-1]) == (0, "by", "a.launch")
