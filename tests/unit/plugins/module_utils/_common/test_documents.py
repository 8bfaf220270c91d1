# SPDX-License-Identifier: GPL-3.0-or-later
"""JSON of others: what is made to do harm is an error of ours, at once."""

from __future__ import annotations

import time
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.documents import json_of


def test_it_reads_what_the_library_reads() -> None:
    assert json_of('{"a": [1, -9223372036854775808, 1.5, NaN, "x", null]}')["a"][:3] == [1, -(2**63), 1.5]
    assert json_of(b"[true]") == [True]


@pytest.mark.parametrize("text", ["", "{", "[" * 100_000, '{"a":' * 100_000, "9" * 4_000_000, None, 7])
def test_what_is_none_or_does_harm(text: Any) -> None:
    began = time.process_time()
    with pytest.raises(ValueError):
        json_of(text)
    assert time.process_time() - began < 1
