# SPDX-License-Identifier: GPL-3.0-or-later
"""What an application shows to Prometheus."""

from __future__ import annotations

import pytest
from rosops_apps import settings
from rosops_apps.metrics import BUCKETS, Metrics

LABELS = 'pattern="service",name="/add_two_ints"'


def samples(metrics: Metrics) -> dict[str, float]:
    """Metric with its labels but ours -> value."""
    lines = [line for line in metrics.text().splitlines() if not line.startswith("#")]
    found = {name.replace(LABELS, "").replace("{,", "{"): float(value) for name, _, value in (
        line.rpartition(" ") for line in lines)}  # fmt: skip
    assert len(found) == len(lines)
    return found


def test_a_series_is_there_before_the_first_request() -> None:
    found = samples(Metrics("service", "/add_two_ints"))
    assert found["rosops_app_requests_total{}"] == found["rosops_app_failures_total{}"] == 0
    assert found["rosops_app_response_seconds_count{}"] == 0
    assert len(found) == len(BUCKETS) + 5


def test_answers_fall_into_buckets_that_add_up_and_failures_into_none() -> None:
    metrics = Metrics("service", "/add_two_ints")
    for seconds in (0.001, 0.0011, 0.3, 60.0):
        metrics.answered(seconds)
    metrics.failed()
    found = samples(metrics)
    assert (found["rosops_app_requests_total{}"], found["rosops_app_failures_total{}"]) == (5, 1)
    buckets = [found[f'rosops_app_response_seconds_bucket{{le="{bound}"}}'] for bound in (*BUCKETS, "+Inf")]
    assert buckets == sorted(buckets)
    assert buckets[:2] == [1, 2]  # a bound belongs to its own bucket
    assert buckets[-2:] == [3, 4] and found["rosops_app_response_seconds_count{}"] == 4
    assert found["rosops_app_response_seconds_sum{}"] == pytest.approx(60.3021)


def test_an_account_of_the_applications_own_never_counts_down() -> None:
    metrics = Metrics("service", "/add_two_ints")
    for total in (3, 1, 4):
        metrics.failed_so_far(total)
    found = samples(metrics)
    assert (found["rosops_app_requests_total{}"], found["rosops_app_failures_total{}"]) == (4, 4)


def test_the_port_is_a_setting_and_none_by_default() -> None:
    assert settings.metrics_port({}) == 0
    assert settings.metrics_port({"METRICS_PORT": "9400"}) == 9400
    for text in ("0", "65536", "http"):
        with pytest.raises(settings.SettingError, match="METRICS_PORT must be"):
            settings.metrics_port({"METRICS_PORT": text})
