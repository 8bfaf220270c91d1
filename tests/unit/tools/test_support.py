# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The page says which versions are pinned, and whose support has ended."""

from __future__ import annotations

import datetime

import support
import yaml

ROLES = support.PAGE.parents[1] / "roles"
IMAGES = {
    "collector": "otelcol",
    "Prometheus": "prometheus",
    "Loki": "loki",
    "Grafana": "grafana",
    "Alertmanager": "alertmanager",
    "node-exporter": "node_exporter",
    "vmagent": "vmagent",
}


def defaults(role: str) -> dict[str, str]:
    found: dict[str, str] = yaml.safe_load((ROLES / role / "defaults" / "main.yml").read_text(encoding="utf-8"))
    return found


def test_the_page_has_the_versions_that_are_pinned() -> None:
    images = defaults("observability")
    pinned = {part: images[f"observability_{name}_image"].rpartition(":")[2] for part, name in IMAGES.items()}
    found = support.rows(support.PAGE.read_text(encoding="utf-8"))
    assert {part: version for part, (version, _end) in found.items()} == {
        "k3s": defaults("k3s")["k3s_version"],
        **pinned,
    }


def test_a_part_is_past_its_end_from_the_day_after() -> None:
    page = "| a | v1.2 | 2026-03-02 | x |\n| b | 2.0 | not said | x |\n| part | version | its support ends | tried |\n"
    assert support.past(page, datetime.date(2026, 3, 2)) == []
    assert support.past(page, datetime.date(2026, 3, 3)) == ["a v1.2: its support ended on 2026-03-02"]
