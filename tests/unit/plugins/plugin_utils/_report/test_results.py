# SPDX-License-Identifier: GPL-3.0-or-later
"""What results of tasks say."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.results import message_of


@pytest.mark.parametrize(
    ("result", "message"),
    [
        ({"msg": "plain"}, "plain"),
        ({"msg": "non-zero return code", "stderr": "boom", "rc": 1}, "non-zero return code: boom"),
        ({"stdout": "said here"}, "said here"),
        ({}, "failed without a message"),
        ({"censored": "the output has been hidden", "msg": "secret"}, "hidden by no_log"),
        ({"results": [{"failed": True, "msg": "a"}, {"msg": "fine"}, {"failed": True, "msg": "a"}], "msg": "x"}, "a"),
        ({"results": [{"failed": True, "censored": "", "msg": "secret"}]}, "hidden by no_log"),
        ({"results": "odd", "msg": "still said"}, "still said"),
        ({"msg": "x" * 5000}, "x" * 4000),
    ],
)
def test_messages(result: dict[str, Any], message: str) -> None:
    assert message_of(result) == message
