# SPDX-License-Identifier: GPL-3.0-or-later
"""What a run of the tests counts as its own."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest
from lablib.names import checkout_id
from remains import PLACES, files, mounts, podmans

MINE = checkout_id("/checkout")
# As podman 4.3 prints them.
ANSWERS: dict[str, list[Mapping[str, object]]] = {
    "ps": [{"Names": [name]} for name in (f"rosops-{MINE}-demo-edge1", "rosops-0000ffff-demo-edge1", "postgres")],
    "network": [{"name": "podman"}, {"name": f"rosops-{MINE}-demo"}],
    "volume": [{"Name": f"rosops-{MINE}-demo-edge1-rancher"}],
}
MOUNTS = """\
proc /proc proc rw 0 0
tmpfs /checkout/.lab/mnt tmpfs rw 0 0
tmpfs /checkout-of-another tmpfs rw 0 0
"""


def test_of_podman_s_objects_those_of_the_checkout_s_labs() -> None:
    assert podmans(lambda words: ANSWERS[words[0]], "/checkout") == [
        f"container rosops-{MINE}-demo-edge1",
        f"network rosops-{MINE}-demo",
        f"volume rosops-{MINE}-demo-edge1-rancher",
    ]


def test_mounts_in_own_directories() -> None:
    assert mounts(MOUNTS, ["/checkout", "/tmp"]) == ["mount /checkout/.lab/mnt"]  # noqa: S108 - a name, nothing is written


def test_files_where_tools_put_them(tmp_path: Path) -> None:
    (tmp_path / "ansible_abc").mkdir()
    (tmp_path / "other").touch()
    patterns = [f"{tmp_path}/ansible*", f"{tmp_path}/pytest-of-*"]
    assert files(patterns) == [f"file {tmp_path / 'ansible_abc'}"]


def test_where_ansible_runs_modules_is_its_own_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / ".ansible" / "tmp").mkdir(parents=True)
    assert files(PLACES) == []
    (tmp_path / ".ansible" / "collections").mkdir()
    assert files(PLACES) == [f"file {tmp_path}/.ansible/collections"]
