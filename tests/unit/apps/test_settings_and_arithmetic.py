# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings from the environment, and what the service computes."""

from __future__ import annotations

import pytest
from rosops_apps import settings
from rosops_apps.arithmetic import OPERATIONS, operands, operation_of, wrap


@pytest.mark.parametrize(("text", "number"), [("", 500.0), ("0.5", 0.5), ("1000", 1000.0)])
def test_positive(text: str, number: float) -> None:
    assert settings.positive("RATE_HZ", 500.0, {"RATE_HZ": text}) == number


@pytest.mark.parametrize("text", ["0", "-1", "fast", "nan", "inf", "1,5"])
def test_not_positive(text: str) -> None:
    with pytest.raises(settings.SettingError, match="RATE_HZ must be a number above 0"):
        settings.positive("RATE_HZ", 500.0, {"RATE_HZ": text})


@pytest.mark.parametrize(
    ("environ", "expected"),
    [
        ({}, (500.0, 1)),
        ({"RATE_HZ": "500"}, (500.0, 1)),
        ({"RATE_HZ": "250"}, (250.0, 2)),  # every other sample of the same sensor
        ({"RATE_HZ": "0.1"}, (0.1, 5000)),
    ],
)
def test_rates(environ: dict[str, str], expected: tuple[float, int]) -> None:
    assert settings.rates(environ) == expected


@pytest.mark.parametrize("rate", ["300", "1000"])
def test_a_rate_that_the_sensor_cannot_give(rate: str) -> None:
    with pytest.raises(settings.SettingError, match=f"RATE_HZ {rate} must be 500, the sensor's, divided by a whole"):
        settings.rates({"RATE_HZ": rate})


def test_faults() -> None:
    assert settings.faults({}) == (0, False)
    assert settings.faults({"CRASH_AFTER": "2.5", "NEVER_CONNECT": "True"}) == (2.5, True)
    with pytest.raises(settings.SettingError, match="NEVER_CONNECT must be true or false, not 'maybe'"):
        settings.faults({"NEVER_CONNECT": "maybe"})


@pytest.mark.parametrize("request_number", [0, 1, 96, 97, 12345, 2**62])
def test_the_answer_tells_the_operation(request_number: int) -> None:
    a, b = operands(request_number)
    assert [operation_of(a, b, wrap(f(a, b))) for f in OPERATIONS.values()] == list(OPERATIONS)
    assert operation_of(a, b, wrap(a + b + 1)) == "wrong"


@pytest.mark.parametrize(
    ("number", "wrapped"), [(0, 0), (2**63 - 1, 2**63 - 1), (2**63, -(2**63)), (-(2**63) - 1, 2**63 - 1)]
)
def test_wrap(number: int, wrapped: int) -> None:
    assert wrap(number) == wrapped
