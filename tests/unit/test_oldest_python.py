# SPDX-License-Identifier: GPL-3.0-or-later
"""All code that goes to hosts and into pods is taken by their oldest Python, and by the one of this run; all that the
project runs and checks itself with by Debian 12's own."""

from __future__ import annotations

import json
import re
import subprocess
from importlib import metadata
from pathlib import Path

import pytest
import rooms
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils.pythons import pythons
from packaging.specifiers import SpecifierSet

DEBIAN = "3.11.2"  # Python of Debian 12
PLUGINS = Path(__file__).resolve().parents[2] / "plugins"
IMPORT = """
import importlib, json, sys
sys.path.insert(0, sys.argv[1])
for name in json.loads(sys.argv[2]):
    importlib.import_module(name)
"""


@pytest.mark.parametrize("python", pythons())
def test_it_is_imported(python: str) -> None:
    files = sorted((PLUGINS / rooms.HOSTS).rglob("*.py"))
    names = [".".join(file.relative_to(PLUGINS).with_suffix("").parts) for file in files]
    of_ros = {f"{rooms.HOSTS}.{name.replace('/', '.')}" for name in rooms.ROS_OF_THE_IMAGE}
    assert of_ros <= set(names)
    chosen = json.dumps([name for name in names if name not in of_ros])
    done = subprocess.run([python, "-I", "-S", "-B", "-c", IMPORT, str(PLUGINS), chosen],  # noqa: S603
                          capture_output=True, text=True, check=False)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert len(names) > 60


def test_what_is_pinned_is_for_debians_own_python() -> None:
    pins = re.findall(r"^([\w.-]+)==", (PLUGINS.parent / "constraints.txt").read_text("utf-8"), re.MULTILINE)
    assert len(pins) > 100
    there = {one.name.lower().replace("_", "-"): one for one in metadata.distributions()}
    wanted = {name: there[name.lower()].metadata["Requires-Python"] or "" for name in pins if name.lower() in there}
    assert len(wanted) > 100
    assert [name for name, says in wanted.items() if DEBIAN not in SpecifierSet(says)] == []
