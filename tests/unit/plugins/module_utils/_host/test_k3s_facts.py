# SPDX-License-Identifier: GPL-3.0-or-later
"""What is said of a host's k3s, out of what systemd and the files show."""

from __future__ import annotations

from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._host.k3s import K3sHost
from ansible_collections.rosops.fleet.plugins.module_utils._host.k3s_facts import k3s_facts

AGENT = {"role": "agent", "files": [], "token": "", "agent_token": "", "servers": []}


@pytest.mark.parametrize(("role", "path", "etcd"), [
    ("server", "db/etcd", True), ("server", "db/state.db", False), ("agent", "db/etcd", False),
])  # fmt: skip
def test_which_datastore_a_server_has(tmp_path: Path, role: str, path: str, etcd: bool) -> None:
    (tmp_path / "var/lib/rancher/k3s/server" / path).mkdir(parents=True)
    host = K3sHost(lambda _argv: (0, "", ""), str(tmp_path))
    found = k3s_facts(host, {**AGENT, "role": role})
    assert (found["etcd"], found["data"]) == (etcd, role == "server")


@pytest.mark.parametrize(
    ("state", "restarts", "ready"),
    [("active", 0, True), ("active", 9, True), ("activating", 9, False), ("failed", 0, False)],
)
def test_what_runs_now_is_ready_however_often_it_was_started_before(
    tmp_path: Path, state: str, restarts: int, ready: bool
) -> None:
    shown = f"LoadState=loaded\nActiveState={state}\nSubState=running\nNRestarts={restarts}\n"
    host = K3sHost(lambda argv: (0, shown if "show" in argv else "", ""), str(tmp_path))
    assert k3s_facts(host, AGENT)["ready"] is ready
