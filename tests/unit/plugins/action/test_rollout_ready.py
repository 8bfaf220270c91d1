# SPDX-License-Identifier: GPL-3.0-or-later
"""The action: arguments and environment in, result out, progress on the display."""

from __future__ import annotations

import os
from typing import Any
from unittest.mock import Mock

import pytest
from ansible.errors import AnsibleActionFail
from ansible_collections.rosops.fleet.plugins.action import rollout_ready
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import NotReadyError
from ansible_collections.rosops.fleet.plugins.plugin_utils._action import voice
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import Ref
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.wait import WaitOptions
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import run

TALKER = {"kind": "Deployment", "name": "talker", "namespace": "robot-robot1"}


def action(monkeypatch: pytest.MonkeyPatch, work: Any, args: dict[str, Any], check_mode: bool = False) -> Any:
    monkeypatch.setattr(rollout_ready, "wait_for_rollout", work)
    monkeypatch.setattr(rollout_ready, "look_once", lambda _kube, refs: {"looked": len(refs)})
    monkeypatch.setattr(os, "environ", dict(os.environ))
    args = {"objects": [TALKER], "host": "https://edge1:6443", **args}
    return run(rollout_ready, args, {}, check_mode, K8S_AUTH_API_KEY="from-task")


def test_success(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    monkeypatch.setattr(voice.display, "display", said.append)

    def work(kube: Any, refs: list[Ref], options: WaitOptions) -> dict[str, Any]:
        assert (kube.host, kube._headers("")["authorization"]) == ("https://edge1:6443", "Bearer from-task")
        assert kube._patience == 0  # the wait has a patience of its own
        options.say("1 of 1 still open")
        return {"objects": [], "elapsed": 0.1, "seen": (refs, options.timeout, options.grace)}

    result = action(monkeypatch, work, {"timeout": "20"})
    assert result["seen"] == ([Ref("Deployment", "talker", "robot-robot1")], 20.0, 10.0)
    assert (result["changed"], "failed" in result) == (False, False)
    assert said == ["[robot1] 1 of 1 still open"]


def test_failure_carries_the_objects(monkeypatch: pytest.MonkeyPatch) -> None:
    error = NotReadyError("1 of 1 cannot be rolled out", objects=[TALKER], elapsed=2.0)
    result = action(monkeypatch, Mock(side_effect=error), {})
    assert (result["failed"], result["msg"], result["objects"]) == (True, "1 of 1 cannot be rolled out", [TALKER])


def test_check_mode_only_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    assert action(monkeypatch, None, {}, check_mode=True)["looked"] == 1
    result = action(monkeypatch, None, {"objects": [{"kind": "Node", "namespace": "x"}]}, check_mode=True)
    assert (result["failed"], result["msg"]) == (True, "objects[0].name: missing")


@pytest.mark.parametrize("bad", [{"objects": "x"}, {"objects": None}, {"wait": True}, {"username": "u"}])
def test_bad_arguments(monkeypatch: pytest.MonkeyPatch, bad: dict[str, Any]) -> None:
    with pytest.raises(AnsibleActionFail):
        action(monkeypatch, lambda *_: {}, bad)
