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

FILES = app_files()
ETCD_LIMIT = 1 << 20  # a ConfigMap holds no more


def test_every_command_is_there_with_all_that_it_imports() -> None:
    assert {f"{module}.py" for command, module in COMMANDS.items() if command != "exporter"} <= set(FILES)
    for name, text in FILES.items():
        module = "_pod.run" if name == "run.py" else name[: -len(".py")]
        assert {f"{found}.py" for found in relative_imports(module, text)} <= set(FILES)
    assert FILES["run.py"] == (MODULE_UTILS / "_pod" / "run.py").read_text("utf-8")
    assert sum(map(len, FILES.values())) < ETCD_LIMIT / 2


LATER = """
sys.meta_path.append(Flat({directory!r}))
for name in ("_pod.namesake", "_pod.params", "_pod.latched_topics"):
    found = importlib.import_module(f"{{ROOT}}.{{name}}")
print(found.LatchedTopics.__module__)
"""


def test_what_runs_on_while_its_files_change_finds_what_it_loads_later(tmp_path: Path) -> None:
    """`exec` waits for the master before it loads two of them; a keeper of a collection before 1.0 has the third."""
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    script = FILES["run.py"].rpartition("if __name__")[0] + LATER.format(directory=str(tmp_path))
    found = subprocess.run([sys.executable, "-I", "-c", script], capture_output=True, text=True, check=True)  # noqa: S603
    assert found.stdout == "rosops_fleet._robot.latched_topics\n"


def test_imports_in_functions_and_of_names_count() -> None:
    text = "from . import a, b\nfrom .c import x\nimport os\nfrom .._d.e import y\ndef f():\n    from .._g import h\n"
    assert sorted(relative_imports("_p.q", text)) == ["_d.e", "_g.h", "_p.a", "_p.b", "_p.c"]


def test_no_form_of_an_import_is_overlooked() -> None:
    """What Python itself reads of the files."""
    for name, text in {**FILES, **exporter_files()}.items():
        module = "_pod.run" if name == "run.py" else name[: -len(".py")]
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


@pytest.fixture
def mounted(tmp_path: Path) -> Path:
    """As the kubelet mounts a ConfigMap: links into a directory with a changing name."""
    real = tmp_path / "hooks" / "..2026_01_01"
    real.mkdir(parents=True)
    (tmp_path / "hooks" / "..data").symlink_to(real.name)
    for name, text in FILES.items():
        (real / name).write_text(text)
        (tmp_path / "hooks" / name).symlink_to(f"..data/{name}")
    return tmp_path / "hooks"


SETTINGS = json.dumps({"node": "/a", "expect_node": False})


def run(mounted: Path, word: str, python: str = sys.executable) -> tuple[int, str]:
    environ = {"PATH": os.environ["PATH"], "ROSOPS_SETTINGS": SETTINGS, "ROSOPS_NODE_NAME": "a"}
    command = [python, "-I", "-S", str(mounted / "run.py"), word]
    found = subprocess.run(command, capture_output=True, text=True, check=False, env=environ, cwd="/")  # noqa: S603
    return found.returncode, found.stdout + found.stderr


@pytest.mark.parametrize("python", pythons())
@pytest.mark.parametrize("word", ["started", "stop"])
def test_it_runs_from_a_mount_and_writes_nothing_there(mounted: Path, word: str, python: str) -> None:
    before = sorted(mounted.rglob("*"))
    said = "rosops.fleet: left to SIGTERM: the ROS master does not answer" if word == "stop" else ""
    status, output = run(mounted, word, python)
    assert (status, output[: len(said)], bool(output)) == (0, said, bool(said))
    assert sorted(mounted.rglob("*")) == before


@pytest.mark.parametrize("word", ["", "jump"])
def test_another_word_is_explained(mounted: Path, word: str) -> None:
    assert run(mounted, word) == (2, "usage: run.py exec|started|stop|sidecar|keeper|exporter\n")
