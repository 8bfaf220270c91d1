# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Minimal configurations of the programs: enough for a sample to go all the way."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any


def write(path: Path, config: dict[str, Any]) -> str:
    """JSON, which is YAML, too."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(config, indent=1))
    return str(path)


def prometheus(targets: dict[str, int], alertmanager: int, rules: str) -> dict[str, Any]:
    return {
        "global": {"scrape_interval": "1s", "evaluation_interval": "1s"},
        "rule_files": [rules],
        "alerting": {
            "alertmanagers": [{"static_configs": [{"targets": [f"127.0.0.1:{alertmanager}"]}]}],
        },
        "scrape_configs": [
            {"job_name": job, "static_configs": [{"targets": [f"127.0.0.1:{port}"], "labels": {"robot": "robot1"}}]}
            for job, port in targets.items()
        ],
    }


def always_firing() -> dict[str, Any]:
    rule = {"alert": "Always", "expr": "up == 1", "labels": {"severity": "info"}}
    return {"groups": [{"name": "test", "rules": [rule]}]}


def alertmanager() -> dict[str, Any]:
    return {"route": {"receiver": "none"}, "receivers": [{"name": "none"}]}


def vmagent(target: int) -> dict[str, Any]:
    job = {"job_name": "by-vmagent", "static_configs": [{"targets": [f"127.0.0.1:{target}"]}]}
    return {"global": {"scrape_interval": "1s"}, "scrape_configs": [job]}
