# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A module of the collection run against a scene's master, in this process."""

from __future__ import annotations

import json
from typing import Any

import pytest
from ansible.module_utils.testing import patch_module_args
from scene import Scene


class Run:
    """`run(module, **options)` gives its result; a failed module fails the test."""

    def __init__(self, scene: Scene, capsys: pytest.CaptureFixture[str]) -> None:
        self.scene, self.capsys = scene, capsys

    def __call__(self, module: Any, **params: Any) -> dict[str, Any]:
        self.capsys.readouterr()
        params = {"master_uri": self.scene.uri, **params}
        with patch_module_args(params), pytest.raises(SystemExit):
            module.main()
        result: dict[str, Any] = json.loads(self.capsys.readouterr().out.splitlines()[-1])
        assert not result.get("failed"), result
        return result
