# SPDX-License-Identifier: GPL-3.0-or-later
"""What a task says while it goes on."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._action import voice


def test_a_name_can_write_neither_to_the_terminal_nor_another_hosts_line(capsys: pytest.CaptureFixture[str]) -> None:
    voice.say("robot1", "busy: /a\x1b[2J\x9b1m\n[robot2] failed")
    assert capsys.readouterr().out == "[robot1] busy: /a\\x1b[2J\\x9b1m\n  [robot2] failed\n"
