# SPDX-License-Identifier: GPL-3.0-or-later
"""The code that goes into pods: complete, runnable from a read-only mount, and in every namespace that needs it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._pod.run import COMMANDS
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.code_files import (
    app_files,
    code_maps,
    relative_imports,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils.pythons import pythons
from ansible_collections.rosops.fleet.tests.unit.robots import robot

FILES = app_files()
CONFIG_MAP_LIMIT = 1 << 20


def test_it_fits_and_has_all_commands() -> None:
    assert sum(map(len, FILES.values())) < CONFIG_MAP_LIMIT / 2
    assert {f"{module}.py" for module in COMMANDS.values()} <= set(FILES)


def test_imports_in_functions_and_of_names_count() -> None:
    text = "from . import a, b\nfrom .c import (\n    x,\n)\nfrom .._d.e import y\ndef f():\n    from .._g import h\n"
    assert sorted(relative_imports("_p.q", text)) == ["_d.e", "_g.h", "_p.a", "_p.b", "_p.c"]


# --- run from a mount -------------------------------------------------------------------------------------------------

# `exec` waits for the master before it loads some; a keeper of a collection before 1.0 has the last one. The files of
# both may be newer ones by then. `_pod.launch` runs by itself, where an image has roslaunch.
IMPORT = """
sys.meta_path.append(Flat({directory!r}))
for name in {names!r}:
    found = importlib.import_module(f"{{ROOT}}.{{name}}")
print(found.__name__)
"""


def test_whatever_is_loaded_later_is_found(tmp_path: Path) -> None:
    files, last = FILES, "_pod.latched_topics"
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    names = [name.removesuffix(".py") for name in files if name not in ("run.py", "_pod.launch.py", f"{last}.py")]
    tried = IMPORT.format(directory=str(tmp_path), names=[*names, last])
    script = files["run.py"].rpartition("if __name__")[0] + tried
    found = subprocess.run([sys.executable, "-I", "-c", script], capture_output=True, text=True, check=True)  # noqa: S603
    assert found.stdout == f"rosops_fleet.{last}\n"
    assert {"_pod.namesake", "_pod.params"} <= set(names)


def mounted(place: Path, files: dict[str, str]) -> Path:
    """As the kubelet mounts a ConfigMap: links into a directory with a changing name."""
    real = place / "hooks" / "..2026_01_01"
    real.mkdir(parents=True)
    (place / "hooks" / "..data").symlink_to(real.name)
    for name, text in files.items():
        (real / name).write_text(text)
        (place / "hooks" / name).symlink_to(f"..data/{name}")
    return place / "hooks"


ENVIRON = {
    "PATH": os.environ["PATH"],
    "ROSOPS_SETTINGS": json.dumps({"node": "/a", "expect_node": False}),
    "ROSOPS_NODE_NAME": "a",
    "ROS_MASTER_URI": "http://127.0.0.1:9/",
}


def run(command: list[str]) -> tuple[int, str]:
    found = subprocess.run(  # noqa: S603 - our own
        command, capture_output=True, text=True, check=False, env=ENVIRON, cwd="/", timeout=60
    )
    return found.returncode, found.stdout + found.stderr


@pytest.mark.parametrize("python", pythons())
@pytest.mark.parametrize("word", ["started", "stop"])
def test_it_runs_from_a_mount_and_writes_nothing_there(tmp_path: Path, word: str, python: str) -> None:
    place = mounted(tmp_path, FILES)
    before = sorted(place.rglob("*"))
    said = "rosops.fleet: left to SIGTERM: the ROS master does not answer" if word == "stop" else ""
    status, output = run([python, "-I", "-S", str(place / "run.py"), word])
    assert (status, output[: len(said)], bool(output)) == (0, said, bool(said))
    assert sorted(place.rglob("*")) == before


@pytest.mark.parametrize(("words", "code"), [([], 2), (["jump"], 2), (["keeper", "--jump", "1"], 1)])
def test_other_words_are_explained(tmp_path: Path, words: list[str], code: int) -> None:
    place = mounted(tmp_path, FILES)
    status, output = run([sys.executable, "-I", "-S", str(place / "run.py"), *words])
    assert (status, "usage: " in output) == (code, True)


SCRAPE = """
import re, subprocess, sys, time, urllib.request
process = subprocess.Popen(sys.argv[1:], stdout=subprocess.PIPE, text=True)
try:
    print(process.stdout.readline().strip())
    port = sys.argv[-1]
    print(urllib.request.urlopen(f"http://127.0.0.1:{port}/ready", timeout=5).status)
    for _try in range(200):
        text = urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=5).read().decode()
        if "ros_master_up" in text:
            break
        time.sleep(0.05)
    print(text)
finally:
    process.kill()
    process.wait()
"""


@pytest.mark.parametrize("python", pythons())
def test_what_shows_metrics_runs_from_a_mount_without_a_master(tmp_path: Path, python: str) -> None:
    place = mounted(tmp_path, FILES)
    before, port = sorted(place.rglob("*")), str(20000 + os.getpid() % 10000)
    command = [python, "-I", "-S", str(place / "run.py"), "keeper", "--keep", "off", "--port", port]
    _status, output = run([sys.executable, "-c", SCRAPE, *command])
    assert "ros_master_up 0.0\n" in output
    assert 'ros_exporter_scrape_errors_total{reason="refused"} 1.0\n' in output
    assert output.splitlines()[1] == "200"
    assert sorted(place.rglob("*")) == before


# --- where it is ------------------------------------------------------------------------------------------------------

CODE = {"run.py": "code"}
APP = {"name": "a", "image": "example.org/a:1", "args": ["x"]}
FLEETS, PLAIN, BESIDE = {**APP, "scope": "fleet"}, {**APP, "hooks": "none"}, {**APP, "hooks": "sidecar"}
ROBOT, FLEET = "robot-r1", "fleet"
SHARED, EXTERNAL = {"mode": "shared"}, {"mode": "external", "uri": "http://192.0.2.1:11311"}


@pytest.mark.parametrize(
    ("apps", "master", "places"),
    [
        ([], {}, [ROBOT]),  # the keeper's pod needs it
        ([], EXTERNAL, []),
        ([], {**EXTERNAL, "seen": True}, [ROBOT]),
        ([], SHARED, [FLEET]),
        ([APP], {}, [ROBOT]),
        ([APP], EXTERNAL, [ROBOT]),
        ([APP], SHARED, [ROBOT, FLEET]),
        ([PLAIN], {}, [ROBOT]),
        ([PLAIN], EXTERNAL, []),
        ([BESIDE], EXTERNAL, [ROBOT]),
        ([FLEETS], SHARED, [FLEET]),
        ([FLEETS], EXTERNAL, [FLEET]),
    ],
)
def test_one_map_per_namespace_in_use(apps: list[Any], master: Any, places: list[str]) -> None:
    seen = {"enabled": "seen" in master}
    objects = code_maps(robot(*apps, name="r1", master=master, observability=seen), CODE)
    assert [one["metadata"]["namespace"] for one in objects] == places
    assert all((one["metadata"]["name"], one["data"]) == ("rosops-code", CODE) for one in objects)
