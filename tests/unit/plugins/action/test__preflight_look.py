# SPDX-License-Identifier: GPL-3.0-or-later
"""The look at a host: its clock against ours, and a Python that runs no module."""

from __future__ import annotations

from typing import Any
from unittest.mock import Mock

import pytest
from ansible_collections.rosops.fleet.plugins.action import _preflight_look
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.host import ActionHost
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import machines
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import run

PART = {"role": "agent", "servers": ["edge1"]}
THEIRS = "ansible-core requires a minimum of Python version 3.9. Current version: 3.8.10 (default, ...)"
FACTS: dict[str, Any] = {"hostname": "robot1", "machine_id": "ab12", "routes": []}


def looked(
    monkeypatch: pytest.MonkeyPatch, found: dict[str, Any], rc: int, out: str
) -> tuple[dict[str, Any], list[str]]:
    """The result where the module says `found`, and what the host's shell was asked."""
    shell = Mock(return_value={"rc": rc, "stdout": out})

    def job(host: ActionHost, name: str, arguments: dict[str, Any]) -> dict[str, Any]:
        assert (name, arguments["reach"]) == ("facts", ["edge1:6443"])
        host.plugin._used_interpreter = "#!/usr/bin/python3"
        return found

    monkeypatch.setattr(machines, "OLDEST", (3, 9))
    monkeypatch.setattr(ActionHost, "job", job)
    monkeypatch.setattr(_preflight_look.ActionModule, "_low_level_execute_command", shell)
    return run(_preflight_look, PART, {"hostvars": {"edge1": {}}}), [one.args[0] for one in shell.mock_calls]


def test_the_clock_is_measured_by_the_call(monkeypatch: pytest.MonkeyPatch) -> None:
    found, asked = looked(monkeypatch, {"facts": {**FACTS, "clock": {"began": 0.0, "ended": 0.0}}}, 0, "")
    assert set(found["facts"]["clock"]) == {"offset", "uncertainty"}
    assert asked == []


def test_a_python_that_is_too_old_is_named_with_the_way_out(monkeypatch: pytest.MonkeyPatch) -> None:
    found, asked = looked(monkeypatch, {"failed": True, "msg": THEIRS}, 0, "(3, 8)\n")
    assert asked == ["/usr/bin/python3 -c 'import sys; print(sys.version_info[:2])'"]
    assert found["failed"]
    assert found["msg"].startswith("robot1 has Python 3.8, and ansible-core ")


@pytest.mark.parametrize(("rc", "out"), [(0, "(3, 11)\n"), (127, "")])
def test_another_failure_keeps_its_own_words(monkeypatch: pytest.MonkeyPatch, rc: int, out: str) -> None:
    assert looked(monkeypatch, {"failed": True, "msg": "boom"}, rc, out)[0]["msg"] == "boom"


def test_nonsense_ends_at_the_host_that_tells_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Others are measured against its facts. Whatever it is: test_hostile has more."""
    found, _asked = looked(monkeypatch, {"facts": {**FACTS, "hostname": 7}}, 0, "")
    assert (found["failed"], "tells nonsense of itself" in found["msg"], "facts" in found) == (True, True, False)
