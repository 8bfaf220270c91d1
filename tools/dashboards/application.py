# SPDX-License-Identifier: GPL-3.0-or-later
"""The dashboard of applications, as the dissertation's figure 4.1: what they were asked, beside what they used."""

from __future__ import annotations

from .page import OF_ROBOT, ROBOTS, page
from .panels import Json, graph, label_variable, query, stat
from .updates import latest_updates

R = f'{OF_ROBOT}, app=~"$app"'
NAMESPACES = 'namespace=~"robot-.+"'
POD = f'{R}, {NAMESPACES}, pod!=""'
BY = "by (robot, app)"
LEGEND = "{{robot}} {{app}}"
APPS = label_variable("app", f"label_values(container_memory_working_set_bytes{{{OF_ROBOT}, {NAMESPACES}}}, app)")
ANY = (("green", None), ("red", 0.001))
OWN = "By the app's own metrics; see docs/observability.md, An app's own metrics."


def calls(metric: str, by: str = BY) -> str:
    """How many a second."""
    return f"sum {by} (rate(rosops_app_{metric}{{{R}}}[$__rate_interval]))"


def response(share: float, by: str) -> str:
    """The time within which this share of the calls was answered."""
    return f"histogram_quantile({share:g}, {calls('response_seconds_bucket', by)})"


def application() -> Json:
    """What apps were asked and how they answered, what they used, and what updated them."""
    rows = [
        [
            stat("Requests", "reqps", query(calls("requests_total", "")), about=OWN),
            stat("Failures", "reqps", query(calls("failures_total", "")), about=OWN, steps=ANY),
            stat("Response, p50", "s", query(response(0.5, "by (le)")), about=OWN),
            stat("Response, p95", "s", query(response(0.95, "by (le)")), about=OWN),
        ],
        [
            graph("Requests", "reqps", query(calls("requests_total"), LEGEND), about=OWN),
            graph("Failures", "reqps", query(calls("failures_total"), LEGEND), about=OWN),
            graph(
                "Response",
                "s",
                query(response(0.5, "by (robot, app, le)"), f"{LEGEND} p50"),
                query(response(0.95, "by (robot, app, le)"), f"{LEGEND} p95"),
                about=OWN,
            ),
        ],
        [
            graph(
                "Processor",
                "short",
                query(f"sum {BY} (rate(container_cpu_usage_seconds_total{{{POD}}}[$__rate_interval]))", LEGEND),
                about="Cores.",
            ),
            graph("Memory", "bytes", query(f"sum {BY} (container_memory_working_set_bytes{{{POD}}})", LEGEND)),
        ],
        [latest_updates(R)],
    ]
    return page("application", "Application", "Apps: requests, failures, response; updates", rows, [ROBOTS, APPS])
