# SPDX-License-Identifier: GPL-3.0-or-later
"""A Python environment is made once for what is pinned, and anew when that, or the Python, is another."""

from __future__ import annotations

from pathlib import Path

import pytest
from lablib import environments
from lablib.artifacts import Cache
from lablib.environments import Environment, environment, fingerprint
from lablib.errors import LabError
from lablib.run import Job


def test_the_environment_is_remade_for_new_requirements_or_another_python() -> None:
    marks = {
        fingerprint(b"a==1", "/usr/bin/python3", "3.11.2"),
        fingerprint(b"a==2", "/usr/bin/python3", "3.11.2"),
        fingerprint(b"a==1", "/opt/python3", "3.11.2"),
        fingerprint(b"a==1", "/usr/bin/python3", "3.12.0"),
    }
    assert len(marks) == 4


def test_it_is_remade_when_a_file_changes_that_the_requirements_take_in(
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
    (tmp_path / "core.in").write_text("pytest==8\n")
    for _run in range(2):
        made.ensure()
    assert installs == 1
    (tmp_path / "core.in").write_text("pytest==9\n")
    made.ensure()
    assert installs == 2


def test_an_unknown_one_is_refused_with_the_names_that_there_are(tmp_path: Path) -> None:
    with pytest.raises(LabError, match=r"no environment core-2\.18") as error:
        environment(Cache(tmp_path), "core-2.18")
    assert "core-2.20, core-2.21, importer, old-core" in str(error.value)
