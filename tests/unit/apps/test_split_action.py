# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""An action's seven message definitions."""

from __future__ import annotations

import pytest
from split_action import definitions


def test_seven_definitions() -> None:
    made = definitions("Walk", "int32 steps\n---\nbool done\n---  \nint32 left\n")
    assert made["WalkGoal.msg"].strip() == "int32 steps"
    assert made["WalkResult.msg"].strip() == "bool done"
    assert made["WalkFeedback.msg"].strip() == "int32 left"
    assert made["WalkActionGoal.msg"].splitlines() == [
        "Header header",
        "actionlib_msgs/GoalID goal_id",
        "WalkGoal goal",
    ]
    assert made["WalkActionResult.msg"].splitlines()[1:] == ["actionlib_msgs/GoalStatus status", "WalkResult result"]
    assert made["WalkAction.msg"].splitlines() == [
        "WalkActionGoal action_goal",
        "WalkActionResult action_result",
        "WalkActionFeedback action_feedback",
    ]
    assert len(made) == 7


def test_a_part_is_missing() -> None:
    with pytest.raises(SystemExit, match=r"Walk.action: goal, result and feedback"):
        definitions("Walk", "int32 steps\n---\nbool done\n")
