# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The code that goes into pods: complete, of Python 3.8's language and library, and runnable from a read-only mount."""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils import _hook_run
from ansible_collections.rosops.fleet.plugins.plugin_utils._hook_files import MODULE_UTILS, hook_files, relative_imports
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils.pythons import pythons

FILES = hook_files()
ETCD_LIMIT = 1 << 20  # a ConfigMap holds no more


def test_every_command_is_there_with_all_that_it_imports() -> None:
    assert {f"{module}.py" for module in _hook_run.COMMANDS.values()} <= set(FILES)
    for text in FILES.values():
        assert {f"{module}.py" for module in relative_imports(text)} <= set(FILES)
    assert FILES["run.py"] == (MODULE_UTILS / "_hook_run.py").read_text("utf-8")
    assert sum(map(len, FILES.values())) < ETCD_LIMIT / 2


def test_imports_in_functions_and_of_names_count() -> None:
    text = "from . import _a, _b\nfrom ._c import x\nimport os\nfrom .. import no\ndef f():\n    from ._d import y\n"
    assert sorted(relative_imports(text)) == ["_a", "_b", "_c", "_d"]


@pytest.mark.parametrize("name", sorted(FILES))
def test_python_3_8_and_its_library_are_enough(name: str) -> None:
    tree = ast.parse(FILES[name], name, feature_version=(3, 8))
    for item in ast.walk(tree):
        modules = [alias.name for alias in item.names] if isinstance(item, ast.Import) else []
        if isinstance(item, ast.ImportFrom) and item.level == 0:
            modules = [item.module or ""]
        for module in modules:
            assert module.partition(".")[0] in sys.stdlib_module_names, f"{name} imports {module}"


@pytest.fixture
def mounted(tmp_path: Path) -> Path:
    """As the kubelet mounts a ConfigMap: links into a directory with a changing name."""
    real = tmp_path / "hooks" / "..2026_01_01"
    real.mkdir(parents=True)
    (tmp_path / "hooks" / "..data").symlink_to(real.name)
    for name, text in {**FILES, "app-a.json": json.dumps({"node": "/a", "expect_node": False})}.items():
        (real / name).write_text(text)
        (tmp_path / "hooks" / name).symlink_to(f"..data/{name}")
    return tmp_path / "hooks"


def run(mounted: Path, word: str, python: str = sys.executable) -> tuple[int, str]:
    environ = {"PATH": os.environ["PATH"], "ROSOPS_APP": "a", "ROSOPS_NODE_NAME": "a"}
    command = [python, "-I", "-S", str(mounted / "run.py"), word]
    found = subprocess.run(command, capture_output=True, text=True, check=False, env=environ, cwd="/")  # noqa: S603
    return found.returncode, found.stdout + found.stderr


@pytest.mark.parametrize("python", pythons())
@pytest.mark.parametrize("word", ["started", "ready", "stop"])
def test_it_runs_from_a_mount_and_writes_nothing_there(mounted: Path, word: str, python: str) -> None:
    before = sorted(mounted.rglob("*"))
    assert run(mounted, word, python) == (0, "")
    assert sorted(mounted.rglob("*")) == before


@pytest.mark.parametrize("word", ["", "jump"])
def test_another_word_is_explained(mounted: Path, word: str) -> None:
    assert run(mounted, word) == (2, "usage: run.py exec|started|ready|stop|keeper\n")


def test_the_readiness_probe_imports_nothing_dear(mounted: Path) -> None:
    """Its price is the start of Python and these modules; xmlrpc.client alone would double it."""
    script = (
        f"import sys; sys.path.insert(0, {str(mounted.parent)!r}); import hooks._hook_ready; "
        "print(sorted({'xmlrpc.client', 'http.client', 'subprocess', 'dataclasses', 'typing', 'pathlib', 'threading'} "
        "& set(sys.modules)))"
    )
    found = subprocess.run([sys.executable, "-I", "-S", "-c", script], capture_output=True, text=True, check=True)  # noqa: S603
    assert found.stdout == "[]\n"
