# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the code in a pod is told of its app's parameters."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.pod_settings import app_settings
from ansible_collections.rosops.fleet.tests.unit.robots import robot

PARAMS = {"rate": 20, "/speed": 1}


@pytest.mark.parametrize(
    ("said", "told"),
    [
        ({}, {}),
        ({"params": PARAMS}, {"params": {"~rate": 20, "/speed": 1}}),
        (
            {"params": PARAMS, "keep_params": ["pid/p", "/speed"]},
            {"params": {"~rate": 20, "/speed": 1}, "keep_params": ["~pid/p", "/speed"]},
        ),
        ({"handoff": "replace", "keep_params": ["rate"]}, {"params": {}, "keep_params": ["~rate"]}),
        ({"params": PARAMS, "keep_params": []}, {"params": {"~rate": 20, "/speed": 1}}),
    ],
)
def test_parameters(said: dict[str, Any], told: dict[str, Any]) -> None:
    made = robot({"name": "arm", "image": "x:1", "command": ["run"], **said})
    settings = app_settings(made.apps[0], made)
    assert {key: settings[key] for key in ("params", "keep_params") if key in settings} == told
