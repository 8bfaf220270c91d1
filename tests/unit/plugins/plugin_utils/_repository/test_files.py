# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is written and what stays."""

from __future__ import annotations

from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.plugin_utils._repository.files import Change, Plan, plan, read, write

WANTED = {"a/b.yml": "1\n", "c": "2\n", "d": "3\n"}


def test_what_is_missing_is_written_and_what_differs_stays() -> None:
    assert plan(WANTED, {"c": "2\n", "d": "mine\n"}, force=False) == Plan([Change("a/b.yml", None, "1\n")], ["d"])


def test_force_writes_what_differs_and_nothing_else() -> None:
    planned = plan(WANTED, {"c": "2\n", "d": "mine\n", "a/b.yml": ""}, force=True)
    assert planned == Plan([Change("a/b.yml", "", "1\n"), Change("d", "mine\n", "3\n")], [])


def test_what_was_written_is_read(tmp_path: Path) -> None:
    assert read(tmp_path / "new", WANTED) == {}
    write(tmp_path / "new", plan(WANTED, {}, force=False).write)
    assert read(tmp_path / "new", WANTED) == WANTED


def test_a_file_that_is_no_text_differs(tmp_path: Path) -> None:
    (tmp_path / "c").write_bytes(b"\xff")
    assert plan(WANTED, read(tmp_path, WANTED), force=False).kept == ["c"]


def test_what_is_in_the_way_is_named(tmp_path: Path) -> None:
    (tmp_path / "c").mkdir()
    with pytest.raises(FleetError, match=r"/c: Is a directory\. Move it out of the way"):
        read(tmp_path, WANTED)
    (tmp_path / "a").write_text("")
    with pytest.raises(FleetError, match=r"/a(/b\.yml)?: (File exists|Not a directory)"):
        write(tmp_path, [Change("a/b.yml", None, "1\n")])


def test_a_link_that_leads_nowhere_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "c").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(FleetError, match="/c: No such file"):
        read(tmp_path, WANTED)
