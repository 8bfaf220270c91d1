# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an action says while it goes on."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._action import base, voice


def test_a_name_can_write_neither_to_the_terminal_nor_another_hosts_line(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    monkeypatch.setattr(voice.display, "display", said.append)
    action: Any = SimpleNamespace()
    base.FleetAction.say(action, {"inventory_hostname": "robot1"})("busy: /a\x1b[2J\x9b1m\n[robot2] failed")
    assert said == ["[robot1] busy: /a\\x1b[2J\\x9b1m\n  [robot2] failed"]
