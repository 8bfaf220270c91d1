# SPDX-License-Identifier: GPL-3.0-or-later
"""The user's tasks at a host that is off; whose turn it is otherwise, ansible-playbook shows (test_guarded_tasks)."""

from __future__ import annotations

import contextlib
from unittest.mock import Mock

import pytest
from ansible_collections.rosops.fleet.plugins.action import _guarded
from ansible_collections.rosops.fleet.plugins.plugin_utils._action import gated
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.host import RobotHost
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import AwayError
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import run
from ansible_collections.rosops.fleet.tests.unit.robots import fleet_of, robot


def test_a_host_that_is_off_is_deferred(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RobotHost, "there", Mock(side_effect=AwayError("no route to host")))
    monkeypatch.setattr(_guarded.ActionModule, "cluster", lambda *_args: contextlib.nullcontext())
    monkeypatch.setattr(gated, "KubeCluster", Mock())
    ended = run(_guarded, {}, {"guarded_tasks": "/srv/reboot.yml", **fleet_of(robot())})
    assert ended["outcome"]["outcome"] == "deferred-offline"
    assert "nothing was touched" in ended["outcome"]["reason"]


def test_what_is_said_is_the_outcome() -> None:
    wrong = {"guarded_tasks": "/srv/reboot.yml", "update_failure_budget": "many", **fleet_of(robot())}
    ended = run(_guarded, {}, wrong)
    assert ended["outcome"]["outcome"] == "failed"
    assert ended["msg"].startswith("failed: nothing was touched: ")
