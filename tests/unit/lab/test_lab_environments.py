# SPDX-License-Identifier: GPL-3.0-or-later
"""A Python environment is made once for what is pinned, and anew when that, or the Python, is another."""

from __future__ import annotations

from pathlib import Path

import pytest
from lablib import environments
from lablib.artifacts import Cache
from lablib.environments import Environment, environment
from lablib.errors import LabError
from lablib.run import Job


def test_it_is_made_once_and_anew_for_another_requirement_or_python(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    installs = 0

    def build(job: Job) -> None:
        nonlocal installs
        installs += "install" in job.command
        made.python.parent.mkdir(parents=True, exist_ok=True)
        made.python.touch()

    monkeypatch.setattr(environments, "build", build)
    monkeypatch.setattr(environments, "LOGS", tmp_path)
    made = Environment(tmp_path / "core", tmp_path / "core-2.21.txt")
    made.requirements.write_text("-r core.in\nansible-core==2.21.5\n")
    (tmp_path / "core.in").write_text("pytest==8\n")  # which it takes in

    def makes() -> int:
        before = installs
        made.ensure()
        made.ensure()
        return installs - before

    assert makes() == 1
    made.requirements.write_text("-r core.in\nansible-core==2.21.6\n")
    assert makes() == 1
    (tmp_path / "core.in").write_text("pytest==9\n")
    assert makes() == 1
    for attribute in ("executable", "version"):
        monkeypatch.setattr(environments.sys, attribute, "another")
        assert makes() == 1


def test_an_unknown_one_is_refused_with_the_names_that_there_are(tmp_path: Path) -> None:
    with pytest.raises(LabError, match=r"no environment core-2\.18") as error:
        environment(Cache(tmp_path), "core-2.18")
    assert "core-2.20, core-2.21, importer, old-core" in str(error.value)
