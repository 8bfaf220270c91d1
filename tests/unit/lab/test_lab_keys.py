# SPDX-License-Identifier: GPL-3.0-or-later
"""The lab's SSH keys are made once, also where hosts boot in parallel or an earlier run was interrupted."""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from lablib import keys
from lablib.keys import Keys


def slow_keygen(calls: list[str]) -> object:
    def run(command: Sequence[str]) -> None:
        key = Path(command[-1])
        assert not key.exists(), "ssh-keygen would ask whether to overwrite it"
        calls.append(key.name)
        key.write_text("private")
        time.sleep(0.05)  # ssh-keygen is not instantaneous: the window in which another host's thread looks
        key.with_name(f"{key.name}.pub").write_text("ssh-ed25519 AAAA rosops-lab")

    return run


def test_hosts_that_boot_in_parallel_share_one_users_key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[str] = []
    monkeypatch.setattr(keys, "run", slow_keygen(calls))
    lab = Keys(tmp_path)
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda _number: lab.user_public(), range(4)))
    assert calls == ["id_ed25519"]
    assert found == ["ssh-ed25519 AAAA rosops-lab"] * 4


def test_half_a_pair_is_made_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[str] = []
    monkeypatch.setattr(keys, "run", slow_keygen(calls))
    (tmp_path / "id_ed25519").write_text("left by an interrupted run")
    assert Keys(tmp_path).user_public() == "ssh-ed25519 AAAA rosops-lab"
    assert calls == ["id_ed25519"]
