# SPDX-License-Identifier: GPL-3.0-or-later
"""The lab as pip installs it: what it is made of, and where it keeps its state."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

CHECKOUT = Path(__file__).resolve().parents[3]
LAB = CHECKOUT / "tests" / "lab"
ASK = "from rosops_lab.lablib import paths; print(paths.CHECKOUT, paths.STATE, paths.COMMAND, paths.APPS.is_dir())"
PACKAGE = tomllib.loads((LAB / "pyproject.toml").read_text("utf-8"))


def test_its_versions_are_the_checkout_s() -> None:
    assert PACKAGE["project"]["version"] == yaml.safe_load((CHECKOUT / "galaxy.yml").read_text("utf-8"))["version"]
    pinned = (CHECKOUT / "requirements.txt").read_text("utf-8").splitlines()
    assert [need for need in PACKAGE["project"]["dependencies"] if need not in pinned] == []


@pytest.mark.parametrize("given", [True, False])
def test_its_state_is_of_the_directory_that_it_is_called_in_or_that_is_given(given: bool, tmp_path: Path) -> None:
    site, work = tmp_path / "site", tmp_path / "work"
    work.mkdir()
    for name in ("lablib", "apps"):
        shutil.copytree(LAB / name, site / "rosops_lab" / name)
    environ = {name: value for name, value in os.environ.items() if name != "ROSOPS_LAB_HOME"}
    environ |= {"PYTHONPATH": str(site), **({"ROSOPS_LAB_HOME": str(work)} if given else {})}
    done = subprocess.run(  # noqa: S603 - our own
        [sys.executable, "-c", ASK], cwd=tmp_path if given else work, env=environ, check=True, capture_output=True,
        text=True,
    )  # fmt: skip
    assert done.stdout.split() == [str(work), str(work / ".lab"), "rosops-lab", "True"]


def test_every_part_that_the_lab_reads_is_in_it() -> None:
    data = {pattern.split("/")[0] for pattern in PACKAGE["tool"]["setuptools"]["package-data"]["rosops_lab"]}
    there = {path.name for path in LAB.iterdir() if path.name[0] not in "._" and not path.name.endswith(".md")}
    assert there - data <= {"lab", "find_python", "lablib", "pyproject.toml", "build", "rosops_lab.egg-info"}
