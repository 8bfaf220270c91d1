# SPDX-License-Identifier: GPL-3.0-or-later
"""What a run of the tests counts as its own."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest
from remains import PLACES, files, mounts, podmans

# As podman 4.3 prints them.
ANSWERS: dict[str, list[Mapping[str, object]]] = {
    "ps": [{"Names": ["rosops-ID-demo-edge1"]}, {"Names": ["rosops-0000ffff-demo-edge1"]}, {"Names": ["postgres"]}],
    "network": [{"name": "podman"}, {"name": "rosops-ID-demo"}],
    "volume": [{"Name": "rosops-ID-demo-edge1-rancher"}],
}
MOUNTS = """\
proc /proc proc rw 0 0
tmpfs /checkout/.lab/mnt tmpfs rw 0 0
tmpfs /checkout-of-another tmpfs rw 0 0
"""


def test_of_podman_s_objects_those_of_the_checkout_s_labs() -> None:
    from lablib.names import checkout_id  # noqa: PLC0415 - remains makes the lab's package known

    mine = checkout_id("/checkout")
    answers = {
        word: [{key: _with(value, mine) for key, value in one.items()} for one in found]
        for word, found in ANSWERS.items()
    }
    assert podmans(lambda words: answers[words[0]], "/checkout") == [
        f"container rosops-{mine}-demo-edge1",
        f"network rosops-{mine}-demo",
        f"volume rosops-{mine}-demo-edge1-rancher",
    ]


def _with(value: object, checkout: str) -> object:
    return [_with(one, checkout) for one in value] if isinstance(value, list) else str(value).replace("ID", checkout)


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
