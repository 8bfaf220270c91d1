# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What k3s_info says of a host, out of what systemd and the files show."""

from __future__ import annotations

from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._host.k3s import K3sHost
from ansible_collections.rosops.fleet.plugins.modules.k3s_info import looked

AGENT = {"role": "agent", "files": [], "token": "", "agent_token": "", "servers": []}


@pytest.mark.parametrize(
    ("state", "restarts", "ready"),
    [("active", 0, True), ("active", 9, True), ("activating", 9, False), ("failed", 0, False)],
)
def test_what_runs_now_is_ready_however_often_it_was_started_before(
    tmp_path: Path, state: str, restarts: int, ready: bool
) -> None:
    shown = f"LoadState=loaded\nActiveState={state}\nSubState=running\nNRestarts={restarts}\n"
    host = K3sHost(lambda argv: (0, shown if "show" in argv else "", ""), str(tmp_path))
    assert looked(host, AGENT)["ready"] is ready
