# SPDX-License-Identifier: GPL-3.0-or-later
"""The page says which versions are pinned, and whose support has ended."""

from __future__ import annotations

import datetime

import support
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.role_specs import role_options

IMAGES = {
    "collector": "otelcol",
    "Prometheus": "prometheus",
    "Loki": "loki",
    "Grafana": "grafana",
    "Alertmanager": "alertmanager",
    "node-exporter": "node_exporter",
    "vmagent": "vmagent",
}


def test_the_page_has_the_versions_that_are_pinned() -> None:
    images = role_options("observability")["observability_images"]["options"]
    pinned = {part: images[name]["default"].rpartition(":")[2] for part, name in IMAGES.items()}
    found = support.rows(support.PAGE.read_text(encoding="utf-8"))
    assert {part: version for part, (version, _end) in found.items()} == {
        "k3s": role_options("k3s")["k3s_version"]["default"],
        **pinned,
    }


def test_a_part_is_past_its_end_from_the_day_after() -> None:
    page = "| a | v1.2 | 2026-03-02 | x |\n| b | 2.0 | not said | x |\n| part | version | its support ends | tried |\n"
    assert support.past(page, datetime.date(2026, 3, 2)) == []
    assert support.past(page, datetime.date(2026, 3, 3)) == ["a v1.2: its support ended on 2026-03-02"]
