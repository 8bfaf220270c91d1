# SPDX-License-Identifier: GPL-3.0-or-later
"""Nothing that a host says is obeyed: what comes through a parser is right, or its own error, and that in time."""

from __future__ import annotations

import json
import os
import time
import traceback

import pytest
from ansible_collections.rosops.fleet.tests.unit.hostile import PARSERS, json_text, value

MANY = 100_000 if os.environ.get("ROSOPS_TEST_CASES") == "faults" else 100
LONGEST = 5.0  # seconds for one value


@pytest.mark.parametrize("name", PARSERS)
def test_good_values_come_through(name: str) -> None:
    parser = PARSERS[name]
    for one in parser.good:
        assert parser.right(parser.read(json.dumps(one) if parser.spoil is json_text else one))


@pytest.mark.parametrize("name", PARSERS)
def test_no_value_escapes(name: str) -> None:
    parser, escaped, slowest = PARSERS[name], [], 0.0
    for seed in range(MANY):
        one = value(name, seed)
        began = time.process_time()
        try:
            found = parser.read(one)
            wrong = "" if parser.right(found) else f"came through as {found!r:.300}"
        except parser.errors:
            wrong = ""
        except Exception:
            wrong = traceback.format_exc(limit=-4)
        slowest = max(slowest, time.process_time() - began)
        if wrong:
            escaped.append(f"seed {seed}: {wrong}")
    print(f"{name}: {MANY} values, {len(escaped)} escapes, {1000 * slowest:.0f} ms at the longest")
    assert escaped[:3] == []
    assert slowest < LONGEST
