# SPDX-License-Identifier: GPL-3.0-or-later
"""A module run by its main(): options in, result out; and the master that it asks."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest
from ansible.module_utils.testing import patch_module_args
from ansible_collections.rosops.fleet.plugins.module_utils._ros import jobs
from ansible_collections.rosops.fleet.tests.unit.plugins.modules.a_master import Master


@pytest.fixture(name="main")
def _main(capsys: pytest.CaptureFixture[str]) -> Callable[..., dict[str, Any]]:
    def run(module: Any, **params: Any) -> dict[str, Any]:
        with patch_module_args(params), pytest.raises(SystemExit) as ended:
            module.main()
        result: dict[str, Any] = json.loads(capsys.readouterr().out)
        assert ended.value.code == (1 if result.get("failed") else 0)
        return result

    return run


@pytest.fixture
def master(monkeypatch: pytest.MonkeyPatch) -> Master:
    made = Master()
    monkeypatch.setattr(jobs, "Ros1Client", made)
    return made
