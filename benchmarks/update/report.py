# SPDX-License-Identifier: GPL-3.0-or-later
"""What a run leaves: report.md and summary.json. Its figures are the records', and the dissertation's own."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .groups import groups
from .measure import ACTION_SECONDS
from .records import KEYS
from .results import Results
from .tables import loss_table, phase_table, tables, usage_table
from .verdicts import TITLES, judge, verdicts

SUMMARY, TEXT = "summary.json", "report.md"
MEANS = KEYS[5:]


def write(results: Results, about: Mapping[str, Any], settings: Mapping[str, Any], problems: list[str]) -> None:
    """All of it, and the report on screen."""
    summary = save(results, about, settings, problems)
    text = as_text(results, summary)
    path = results.write(TEXT, text)
    print(f"\n{text}\nresults: {path.parent}", flush=True)


def save(
    results: Results, about: Mapping[str, Any], settings: Mapping[str, Any], problems: list[str]
) -> dict[str, Any]:
    """The summary so far."""
    summary = summarise(results, about, settings, problems)
    results.write(SUMMARY, json.dumps(summary, indent=2) + "\n")
    return summary


def kept(directory: Path) -> dict[str, Any]:
    """The summary of an earlier run; one that broke off in its first round has none."""
    if not (directory / SUMMARY).exists():
        return {"about": {}, "settings": {}, "problems": ["the run was broken off before its first round was over"]}
    found: dict[str, Any] = json.loads((directory / SUMMARY).read_text(encoding="utf-8"))
    return found


def summarise(
    results: Results, about: Mapping[str, Any], settings: Mapping[str, Any], problems: list[str]
) -> dict[str, Any]:
    """The figures of every group, and the verdicts."""
    findings = judge(results.records)
    return {
        "benchmark": "update",
        "about": dict(about),
        "settings": dict(settings),
        "groups": [
            {
                "app": group.app,
                "update": group.update,
                "arm": group.arm,
                "stress": group.stress,
                "trials": len(group.records),
                "mean": {key: group.mean(key) for key in MEANS},
                "worst": {key: group.worst(key) for key in MEANS},
            }
            for group in groups(results.records)
        ],
        "bars": {
            str(limit): {
                "what": TITLES[limit],
                "verdict": verdict,
                "findings": [[item.verdict, item.text] for item in findings if item.limit == limit],
            }
            for limit, verdict in verdicts(findings).items()
        },
        "problems": problems,
    }


def as_text(results: Results, summary: Mapping[str, Any]) -> str:
    """The report."""
    about = "\n".join(f"- {key}: {value}" for key, value in {**summary["about"], **summary["settings"]}.items())
    bars = "\n".join(_bar(number, limit) for number, limit in summary["bars"].items())
    problems = "\n".join(f"- {problem}" for problem in summary["problems"]) or "none"
    return f"""# Updates by plain Kubernetes and by update.yml

{about}

Means over the trials, in brackets the worst trial. The rows `seed` are the dissertation's figures, on its own machine.
Completion: mean over the goals sent within {ACTION_SECONDS:g} s from the command, or until 5 s after its end if
that is later, against as long at the end of the round's quiet beginning.
Run: from the command to its end. Step: the part of it in which pods change. Before and control: as long as the step,
without an update in the same round.

{tables(results.records)}

## Where messages went

{loss_table(results.details)}

## Seconds by phase

{phase_table(results.details)}

## CPU and memory

{usage_table(results.details)}

## What it must show

{bars}

## Measurements that failed

{problems}
"""


def _bar(number: str, limit: Mapping[str, Any]) -> str:
    lines = [f"{number}. **{limit['verdict']}** {limit['what']}"]
    return "\n".join([*lines, *(f"   - {verdict}: {text}" for verdict, text in limit["findings"])])
