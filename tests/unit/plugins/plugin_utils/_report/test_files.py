# SPDX-License-Identifier: GPL-3.0-or-later
"""Where reports and pages lie and how they get there."""

from __future__ import annotations

from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._report import files


@pytest.fixture(autouse=True)
def config(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(files.C, "CONFIG_FILE", str(tmp_path / "ansible.cfg"))


def test_paths_start_at_the_ansible_cfg(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert files.placed("reports/a.html") == tmp_path / "reports" / "a.html"
    assert files.placed("/srv/a.html") == Path("/srv/a.html")
    assert files.placed("") is None
    monkeypatch.setenv("HOME", "/home/me")
    assert files.placed("~/a.html") == Path("/home/me/a.html")
    monkeypatch.setattr(files.C, "CONFIG_FILE", None)
    monkeypatch.chdir(tmp_path)
    assert files.placed("a.html") == tmp_path / "a.html"


def test_a_file_is_whole_and_has_the_mode_that_was_asked_for(tmp_path: Path) -> None:
    page = tmp_path / "new" / "fleet.html"
    assert files.text_of(page) == ""
    for text in ("first", "line\r\nüñ\n"):
        files.write(page, text, 0o640)
        assert files.text_of(page) == text
    assert page.stat().st_mode & 0o777 == 0o640
    files.write(page, "what a host said")
    assert page.stat().st_mode & 0o777 == 0o600
    assert [file.name for file in page.parent.iterdir()] == ["fleet.html"]


def test_a_device_is_written_to_and_stays(tmp_path: Path) -> None:
    null = tmp_path / "null"
    null.symlink_to("/dev/null")
    files.write(null, "a report that nobody wants")
    assert null.is_symlink()
    assert [file.name for file in tmp_path.iterdir()] == ["null"]
