# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of what stages depend on: it names too much, and never too little."""

from __future__ import annotations

import re
from pathlib import Path, PurePosixPath

import pytest
from affected import needs
from inputs import STAGES, contents, depends, digest, file_digest

CHECKOUT = Path(__file__).resolve().parents[3]
OF_PYTEST = {
    "molecule-update": "tests/update/",
    "dist": "tests/dist/",
    "test-bad-input": "tests/bad_input/",
    "test-browser": "tests/browser/",
    "test-playbooks": "tests/unit/playbooks/",
    "test-ros": "tests/ros/",
}


def test_what_the_tests_of_a_stage_import_is_in_its_row() -> None:
    files = {name: (CHECKOUT / name).read_text("utf-8") for name in contents(CHECKOUT) if name.endswith(".py")}
    below: dict[str, set[str]] = {}
    for stage, directory in OF_PYTEST.items():
        reached, new = set[str](), {name for name in files if name.startswith(directory)}
        assert new
        while new:
            below |= {name: {*needs(PurePosixPath(name), files[name], files)} for name in new - below.keys()}
            reached |= new
            new = {one for name in new for one in below[name]} - reached
        assert [name for name in sorted(reached) if not depends(stage, name)] == []


def test_every_row_is_of_a_target() -> None:
    targets = re.findall(r"^([a-z-]+):", (CHECKOUT / "Makefile").read_text("utf-8"), re.MULTILINE)
    assert set(STAGES) <= set(targets)
    names = {one for row in STAGES.values() for one in row}
    assert [name for name in names if not (CHECKOUT / name).exists()] == []


@pytest.mark.parametrize(
    ("stage", "name", "found"),
    [
        ("docs", "docs/updates.md", True),
        ("docs", "docs.txt", False),
        ("docs", "tests/unit/test_rooms.py", False),
        ("docs", "Makefile", True),
        ("test-ros", "plugins/module_utils/_ros/gate.py", True),
        ("test-go", "plugins/module_utils/_ros/gate.py", False),
        *((stage, "benchmarks/update/seed.py", True) for stage in ("test-unit", "lint", "molecule-fleet")),
        ("molecule-update", "tests/unit/test_rooms.py", False),
        ("molecule-update", "tests/update/fleet.py", True),
    ],
)
def test_what_a_stage_depends_on(stage: str, name: str, found: bool) -> None:
    assert depends(stage, name) is found
    assert (digest(stage, {name: "1"}, []) != digest(stage, {name: "2"}, [])) is found


def test_a_stage_depends_on_its_machine_too() -> None:
    assert digest("docs", {}, ["Python 3.11"]) != digest("docs", {}, ["Python 3.12"])


def test_a_file_is_its_content_its_mode_and_whether_it_is_a_link(tmp_path: Path) -> None:
    path, link = tmp_path / "a", tmp_path / "b"
    path.write_text("1")
    link.symlink_to("a")
    found = [file_digest(path), file_digest(link)]
    path.chmod(0o755)
    found.append(file_digest(path))
    path.write_text("2")
    assert len({*found, file_digest(path)}) == 4
