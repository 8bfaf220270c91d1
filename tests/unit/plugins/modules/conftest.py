# SPDX-License-Identifier: GPL-3.0-or-later
"""A module run by its main(): options in, result out."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest
from ansible.module_utils.testing import patch_module_args


@pytest.fixture(name="main")
def _main(capsys: pytest.CaptureFixture[str]) -> Callable[..., dict[str, Any]]:
    def run(module: Any, **params: Any) -> dict[str, Any]:
        with patch_module_args(params), pytest.raises(SystemExit) as ended:
            module.main()
        result: dict[str, Any] = json.loads(capsys.readouterr().out)
        assert ended.value.code == (1 if result.get("failed") else 0)
        return result

    return run
