# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is read of a pod's containers, whoever asks."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import Object
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.pods import (
    HINT,
    error_end,
    trouble,
    why_not_ready,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_objects import pod

NO_PYTHON = 'exec: "python3": executable file not found in $PATH: unknown'
ENDED = {"terminated": {"exitCode": 128, "reason": "StartError", "message": NO_PYTHON}}


def reason(verdict: object) -> str:
    return str(getattr(verdict, "reason", verdict))


@pytest.mark.parametrize(
    ("container", "told"),
    [
        ({"state": {"waiting": {"reason": "RunContainerError", "message": NO_PYTHON}}}, [trouble, why_not_ready]),
        (
            {"state": {"waiting": {"reason": "CrashLoopBackOff"}}, "lastState": ENDED, "restartCount": 2},
            [trouble, why_not_ready],
        ),
        ({"state": ENDED}, [why_not_ready, lambda one: error_end(one, {})]),
        ({"state": {"waiting": {"reason": "ContainerCreating", "message": NO_PYTHON}}}, [why_not_ready]),
    ],
)
def test_a_missing_python_is_explained_once_wherever_it_is_told(
    container: Object, told: list[Callable[[Object], object]]
) -> None:
    one = pod("talker-1", [], [{"name": "ros-app", **container}])
    for tell in told:
        assert reason(tell(one)).count(HINT) == 1, tell


def test_what_the_app_says_itself_is_not_explained() -> None:
    ended = {"exitCode": 1, "message": "No module named rospy"}
    assert HINT not in why_not_ready(pod("talker-1", [], [{"name": "ros-app", "state": {"terminated": ended}}]))
