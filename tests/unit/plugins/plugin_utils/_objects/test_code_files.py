# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The code that goes into pods: complete, and runnable from a read-only mount."""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._pod.run import COMMANDS
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.code_files import (
    MODULE_UTILS,
    app_files,
    exporter_files,
    relative_imports,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils.pythons import pythons

FILES = {"app": app_files(), "exporter": exporter_files()}
CONFIG_MAP_LIMIT = 1 << 20


def module_of(name: str) -> str:
    return "_pod.run" if name == "run.py" else name.removesuffix(".py")


@pytest.mark.parametrize("files", FILES.values(), ids=FILES)
def test_each_is_there_with_all_that_it_imports_and_fits(files: dict[str, str]) -> None:
    for name, text in files.items():
        assert {f"{found}.py" for found in relative_imports(module_of(name), text)} <= set(files)
    assert files["run.py"] == (MODULE_UTILS / "_pod" / "run.py").read_text("utf-8")
    assert sum(map(len, files.values())) < CONFIG_MAP_LIMIT / 2


def test_each_pod_has_its_commands_and_not_the_others() -> None:
    assert {f"{module}.py" for command, module in COMMANDS.items() if command != "exporter"} <= set(FILES["app"])
    assert not [name for name in FILES["app"] if "exporter" in name]
    assert "_exporter.main.py" in FILES["exporter"] and "_pod.started.py" not in FILES["exporter"]


LATER = """
sys.meta_path.append(Flat({directory!r}))
for name in ("_pod.namesake", "_pod.params", "_pod.latched_topics"):
    found = importlib.import_module(f"{{ROOT}}.{{name}}")
print(found.LatchedTopics.__module__)
"""


def test_what_runs_on_while_its_files_change_finds_what_it_loads_later(tmp_path: Path) -> None:
    """`exec` waits for the master before it loads two of them; a keeper of a collection before 1.0 has the third."""
    for name, text in FILES["app"].items():
        (tmp_path / name).write_text(text)
    script = FILES["app"]["run.py"].rpartition("if __name__")[0] + LATER.format(directory=str(tmp_path))
    found = subprocess.run([sys.executable, "-I", "-c", script], capture_output=True, text=True, check=True)  # noqa: S603
    assert found.stdout == "rosops_fleet._robot.latched_topics\n"


def test_imports_in_functions_and_of_names_count() -> None:
    text = "from . import a, b\nfrom .c import x\nimport os\nfrom .._d.e import y\ndef f():\n    from .._g import h\n"
    assert sorted(relative_imports("_p.q", text)) == ["_d.e", "_g.h", "_p.a", "_p.b", "_p.c"]


def test_no_form_of_an_import_is_overlooked() -> None:
    """What Python itself reads of the files."""
    for name, text in {**FILES["app"], **FILES["exporter"]}.items():
        module = module_of(name)
        named = [item for item in ast.walk(ast.parse(text)) if isinstance(item, ast.ImportFrom) and item.level]
        whole = [item.module for item in named if _is_module(module, item)]
        found = relative_imports(module, text)
        assert len([one for one in found if any(one.endswith(str(end)) for end in whole)]) >= len(whole), name
        assert len(found) == sum(1 if _is_module(module, item) else len(item.names) for item in named), name


def _is_module(module: str, item: ast.ImportFrom) -> bool:
    """Whether it names a module, and not a package of which it takes modules."""
    return bool(item.module) and (item.level < len(module.split(".")) or "." in str(item.module))


def test_imports_of_a_package_in_a_package() -> None:
    text = "from . import a\nfrom .b import x\nfrom .. import c\nfrom ..d import y\nfrom ..._e.f import z\n"
    assert sorted(relative_imports("_p.r.q", text)) == ["_e.f", "_p.c", "_p.d", "_p.r.a", "_p.r.b"]


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
    place = mounted(tmp_path, FILES["app"])
    before = sorted(place.rglob("*"))
    said = "rosops.fleet: left to SIGTERM: the ROS master does not answer" if word == "stop" else ""
    status, output = run([python, "-I", "-S", str(place / "run.py"), word])
    assert (status, output[: len(said)], bool(output)) == (0, said, bool(said))
    assert sorted(place.rglob("*")) == before


@pytest.mark.parametrize(
    ("files", "words", "code"),
    [("app", [], 2), ("app", ["jump"], 2), ("exporter", ["jump"], 2), ("exporter", ["exporter", "--jump", "1"], 1)],
)
def test_other_words_are_explained(tmp_path: Path, files: str, words: list[str], code: int) -> None:
    place = mounted(tmp_path, FILES[files])
    status, output = run([sys.executable, "-I", "-S", str(place / "run.py"), *words])
    assert (status, "usage: " in output) == (code, True)


SCRAPE = """
import re, subprocess, sys, time, urllib.request
process = subprocess.Popen(sys.argv[1:], stdout=subprocess.PIPE, text=True)
try:
    print(process.stdout.readline().strip())
    port = sys.argv[-1]
    for _try in range(200):
        text = urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=5).read().decode()
        if "ros_master_up" in text:
            break
        time.sleep(0.05)
    print(text)
    maps = open(f"/proc/{process.pid}/maps").read()
    print("OpenSSL" if "libssl" in maps else "no OpenSSL")
finally:
    process.kill()
    process.wait()
"""


@pytest.mark.parametrize("python", pythons())
def test_the_exporter_runs_from_a_mount_without_a_master(tmp_path: Path, python: str) -> None:
    place = mounted(tmp_path, FILES["exporter"])
    before, port = sorted(place.rglob("*")), str(20000 + os.getpid() % 10000)
    command = [python, "-I", "-S", str(place / "run.py"), "exporter", "--address", "127.0.0.1", "--port", port]
    _status, output = run([sys.executable, "-c", SCRAPE, *command])
    assert "ros_master_up 0.0\n" in output
    assert 'ros_exporter_scrape_errors_total{reason="refused"} 1.0\n' in output
    assert "\nno OpenSSL\n" in output
    assert sorted(place.rglob("*")) == before
