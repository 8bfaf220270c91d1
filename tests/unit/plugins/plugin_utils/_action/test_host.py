# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever keeps Ansible from working on a robot's host is an error of ours, which becomes this robot's outcome."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest
from ansible.errors import AnsibleConnectionFailure, AnsibleError
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.host import ActionHost, RobotHost
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.node import NodeImages
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import AwayError

AWAY, SUDO = (
    Mock(side_effect=error)
    for error in (AnsibleConnectionFailure("no route to host"), AnsibleError("Incorrect sudo password"))
)


def robot(reach: Callable[..., Any]) -> RobotHost:
    return RobotHost(SimpleNamespace(_low_level_execute_command=reach), {"inventory_hostname": "robot1"})


@pytest.mark.parametrize(("method", "argument"), [("module", {}), ("copy", "b")])
def test_a_robot_that_cannot_be_reached_or_on_which_ansible_cannot_work(
    monkeypatch: pytest.MonkeyPatch, method: str, argument: Any
) -> None:
    monkeypatch.setattr(ActionHost, method, AWAY)
    with pytest.raises(AwayError, match="no route to host"):
        getattr(robot(AWAY), method)("a", argument)
    with pytest.raises(AwayError, match="no route to host"):
        robot(AWAY).there()
    monkeypatch.setattr(ActionHost, method, SUDO)
    with pytest.raises(FleetError, match="did not run on robot1: Incorrect sudo password") as found:
        getattr(robot(SUDO), method)("a", argument)
    assert not isinstance(found.value, AwayError)


def test_a_job_is_called_by_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ActionHost, "module", SUDO)
    with pytest.raises(FleetError, match=r"^k3s_change did not run on robot1"):
        robot(SUDO).job("k3s_change", {"state": "staged"})


def test_also_while_its_images_are_brought(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ActionHost, "module", AWAY)
    with pytest.raises(AwayError):
        NodeImages(robot(AWAY)).bring([], ["redis:7"])
