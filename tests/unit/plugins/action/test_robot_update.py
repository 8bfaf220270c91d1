# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The robot's host as the engine sees it: that it went away is an error of ours, wherever it is noticed."""

from __future__ import annotations

from typing import Any

import pytest
from ansible.errors import AnsibleConnectionFailure
from ansible_collections.rosops.fleet.plugins.action.robot_update import RobotHost
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.host import ActionHost
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.node import NodeImages
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import AwayError


def away(*_args: Any) -> dict[str, Any]:
    raise AnsibleConnectionFailure("no route to host")


@pytest.mark.parametrize("method", ["module", "copy"])
def test_a_robot_that_cannot_be_reached(monkeypatch: pytest.MonkeyPatch, method: str) -> None:
    monkeypatch.setattr(ActionHost, method, away)
    with pytest.raises(AwayError, match="no route to host"):
        getattr(RobotHost(None, {"inventory_hostname": "robot1"}), method)("a", "b")


def test_also_while_its_images_are_brought(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ActionHost, "module", away)
    with pytest.raises(AwayError):
        NodeImages(RobotHost(None, {"inventory_hostname": "robot1"})).bring([], ["redis:7"])
