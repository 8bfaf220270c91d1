# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The exporter's code: complete, of Python 3.8's language, and runnable from a read-only mount."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.code_files import (
    app_files,
    exporter_files,
    relative_imports,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.exporter import ExporterOptions, exporter_objects
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils.pythons import pythons
from ansible_collections.rosops.fleet.tests.unit.robots import robot

FILES = exporter_files()
CONFIG_MAP_LIMIT = 1 << 20


def test_complete_and_of_its_own() -> None:
    assert "_exporter.main.py" in FILES
    for name, text in FILES.items():
        module = "_pod.run" if name == "run.py" else name[: -len(".py")]
        assert {f"{found}.py" for found in relative_imports(module, text)} <= set(FILES)
    assert not [name for name in app_files() if "exporter" in name]
    assert "_pod.started.py" not in FILES
    assert sum(map(len, FILES.values())) < CONFIG_MAP_LIMIT / 2


@pytest.mark.parametrize("name", sorted(FILES))
def test_python_3_8_and_its_library_are_enough(name: str) -> None:
    tree = ast.parse(FILES[name], name, feature_version=(3, 8))
    for item in ast.walk(tree):
        modules = [alias.name for alias in item.names] if isinstance(item, ast.Import) else []
        if isinstance(item, ast.ImportFrom) and item.level == 0:
            modules = [item.module or ""]
        for module in modules:
            assert module.partition(".")[0] in sys.stdlib_module_names, f"{name} imports {module}"


def test_the_filter() -> None:
    config, deployment = exporter_objects(robot(), exporter_files(), ExporterOptions(interval=5))
    assert set(FILES) == set(config["data"])
    assert deployment["spec"]["template"]["spec"]["containers"][0]["args"][:2] == ["--interval", "5"]


@pytest.fixture
def mounted(tmp_path: Path) -> Path:
    """As the kubelet mounts a ConfigMap: links into a directory with a changing name."""
    real = tmp_path / "exporter" / "..2026_01_01"
    real.mkdir(parents=True)
    (tmp_path / "exporter" / "..data").symlink_to(real.name)
    for name, text in FILES.items():
        (real / name).write_text(text)
        (tmp_path / "exporter" / name).symlink_to(f"..data/{name}")
    return tmp_path / "exporter"


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
def test_it_runs_from_a_mount_without_a_master(mounted: Path, python: str) -> None:
    before = sorted(mounted.rglob("*"))
    environ = {"PATH": os.environ["PATH"], "ROS_MASTER_URI": "http://127.0.0.1:9/"}
    port = str(20000 + os.getpid() % 10000)
    command = [python, "-I", "-S", str(mounted / "run.py"), "exporter", "--address", "127.0.0.1", "--port", port]
    found = subprocess.run(  # noqa: S603 - our own
        [sys.executable, "-c", SCRAPE, *command], capture_output=True, text=True, check=False, env=environ, timeout=60
    )
    assert "ros_master_up 0.0\n" in found.stdout, found.stderr
    assert 'ros_exporter_scrape_errors_total{reason="refused"} 1.0\n' in found.stdout
    assert "\nno OpenSSL\n" in found.stdout
    assert sorted(mounted.rglob("*")) == before


@pytest.mark.parametrize(("words", "code"), [([], 2), (["jump"], 2), (["exporter", "--jump", "1"], 1)])
def test_other_words_are_explained(mounted: Path, words: list[str], code: int) -> None:
    command = [sys.executable, "-I", "-S", str(mounted / "run.py"), *words]
    found = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
    assert found.returncode == code
    assert "usage: " in found.stdout + found.stderr
