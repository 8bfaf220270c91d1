# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The last outcomes as rows, from the JSON files that the callback fleet_report has written. Pure.

There may be none, several (one per playbook or kept by hand), and spoilt ones. Each host's newest run counts.
"""

from __future__ import annotations

import json
from typing import Any, Dict, Iterable, Mapping

Row = Dict[str, Any]

# Runs that only look. Whoever looks twice still wants to know what became of the last change.
LOOKING = frozenset({"status.yml", "validate.yml"})


def read_reports(texts: Mapping[str, str]) -> tuple[list[Row], list[Row]]:
    """Reports of runs that may have changed something, the oldest first, and what cannot be read. By file name."""
    found: list[Row] = []
    problems: list[Row] = []
    for name, text in sorted(texts.items()):
        try:
            report = json.loads(text)
            hosts = [dict(host) for host in report["hosts"]]
            looking = report["check_mode"] or report["playbook"] in LOOKING
            kept = {"playbook": str(report["playbook"]), "started": str(report["started"]), "hosts": hosts}
            _rows = outcome_rows([kept]), step_rows([kept])  # one that cannot be shown must not keep the others from it
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            problems.append({"where": name, "what": f"not a report of fleet_report ({type(error).__name__})"})
            continue
        if not looking:
            found.append(kept)
    return sorted(found, key=lambda report: str(report["started"])), problems


def outcome_rows(reports: Iterable[Mapping[str, Any]]) -> list[Row]:
    """What the newest run that had the host made of it."""
    rows: dict[str, Row] = {}
    for report in reports:
        for host in report["hosts"]:
            name, lines = str(host.get("host", "")), str(host.get("reason") or "").strip().splitlines()
            note = " ".join(line.strip() for line in lines[:2])
            failed = host.get("failed_task")
            rows[name] = {
                "host": name,
                "outcome": str(host.get("outcome", "")),
                "playbook": report["playbook"],
                "started": report["started"],
                "changed": len(host.get("changed") or []),
                "note": f"{failed}: {note}" if failed else note,
            }
    return [rows[name] for name in sorted(rows)]


def step_rows(reports: Iterable[Mapping[str, Any]]) -> list[Row]:
    """The steps of each robot's newest run that had any, in their order."""
    newest: dict[str, list[Row]] = {}
    for report in reports:
        for host in report["hosts"]:
            steps = [_step(str(host.get("host", "")), step) for step in host.get("steps") or []]
            if steps:
                newest[steps[0]["robot"]] = steps
    return [step for robot in sorted(newest) for step in newest[robot]]


def _step(robot: str, step: Mapping[str, Any]) -> Row:
    phases = {str(name): float(seconds) for name, seconds in (step.get("phases") or {}).items()}
    return {
        "robot": robot,
        "id": str(step.get("id") or ""),
        "name": str(step.get("name", "")),
        "handoff": str(step.get("handoff", "")),
        "outcome": str(step.get("outcome", "")),
        "from": _versions(step.get("from")),
        "to": _versions(step.get("to")),
        "seconds": round(sum(phases.values()), 3),
        "busy_wait": float(step.get("busy_wait") or 0),
        "phases": phases,
        "note": str(step.get("reason") or ""),
    }


def _versions(apps: Any) -> list[str]:
    """`image (revision)` of each app of the step."""
    versions = [version for version in (apps or {}).values() if isinstance(version, Mapping)]
    return [f"{version.get('image', '')} ({version.get('revision', '')})" for version in versions]
