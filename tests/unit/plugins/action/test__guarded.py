# SPDX-License-Identifier: GPL-3.0-or-later
"""The user's tasks behind the gate: whose turn it is, and what becomes of the host."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.action import _guarded
from ansible_collections.rosops.fleet.plugins.plugin_utils._action import gated
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.host import ActionHost, RobotHost
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import AwayError
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import AtRest, run
from ansible_collections.rosops.fleet.tests.unit.robots import fleet_of, robot


class World:
    def __init__(self, monkeypatch: pytest.MonkeyPatch, directory: Path) -> None:
        self.away = False
        monkeypatch.setattr(ActionHost, "module", lambda _host, _name, _args, *_more: self.there())
        monkeypatch.setattr(RobotHost, "there", lambda _host: self.there())
        monkeypatch.setattr(_guarded.ActionModule, "cluster", lambda *_args: contextlib.nullcontext())
        monkeypatch.setattr(gated, "KubeCluster", lambda *_args: AtRest(300))
        monkeypatch.setattr(gated.C, "DEFAULT_LOCAL_TMP", str(directory))

    def there(self) -> dict[str, Any]:
        if self.away:
            raise AwayError("no route to host")
        return {}

    def task(self, check_mode: bool = False, args: dict[str, Any] | None = None, **more: Any) -> dict[str, Any]:
        variables = {"guarded_tasks": "/srv/reboot.yml", "update_failure_budget": "0", **fleet_of(robot()), **more}
        return run(_guarded, args or {}, variables, check_mode)


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> World:
    return World(monkeypatch, tmp_path)


def test_the_tasks_have_their_turn_and_are_proven(world: World) -> None:
    begun = world.task()
    assert (begun["turn"], begun["changed"]) == ("make", False)
    ended = world.task(args={"line": begun["line"]})
    assert "outcome" not in ended  # what the tasks have changed says it
    assert not {"failed", "turn"} & set(ended)


def test_a_host_that_is_off_is_deferred(world: World) -> None:
    world.away = True
    ended = world.task()
    assert ended["outcome"]["outcome"] == "deferred-offline"
    assert "nothing was touched" in ended["outcome"]["reason"]


def test_no_further_wave_begins_after_a_failure(world: World) -> None:
    begun = world.task()
    world.task(args={"line": begun["line"], "failure": "no"})
    later = world.task(ansible_play_batch=["robot2"], ansible_play_hosts_all=["robot1", "robot2"])
    assert later["outcome"]["outcome"] == "unchanged"
    assert "not begun: robot1 failed" in later["outcome"]["reason"]
