# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys of a Rigelfile where a fleet's variables stand: nothing reads them there. docs/rigel.md has all keys. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.finding import Problem, join_path

INSTEAD = {
    "additional_k8s_params": "the keys and overrides of an app in ros_apps; for the master ros_master_overrides",
    "deploy_ros_master": "ros_master_mode, which is robot, shared, or external with ros_master_uri",
    "distributed": "placement of an app in ros_apps, which is local or remote",
    "readiness": "readiness of an app in ros_apps",
    "rolling_update": "pattern or handoff of an app in ros_apps",
    "ros_version": "nothing: an app's image has its ROS, and that is ROS 1; ROS 2 is not served",
}


def without_rigels(variables: Mapping[str, Any], path: str, problems: list[Problem]) -> dict[str, Any]:
    """The host's variables but for these, each of which is a problem that says what to write instead."""
    problems += [
        Problem(join_path(path, name), "is a key of a Rigelfile and has no effect here", INSTEAD[name])
        for name in variables
        if name in INSTEAD
    ]
    return {name: value for name, value in variables.items() if name not in INSTEAD}
