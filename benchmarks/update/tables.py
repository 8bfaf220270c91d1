# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records -> the tables of the report, beside the dissertation's own figures. Pure; Markdown."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from . import seed
from .groups import Group, groups
from .records import Record
from .verdicts import kind

NONE = "-"
NAMES = ("update", "arm", "stress", "trials")
Row = list[str]


def number(value: float | None, digits: int = 0) -> str:
    """A figure, or a dash."""
    return NONE if value is None else f"{value:,.{digits}f}"


def mean_worst(group: Group, key: str, digits: int = 0) -> str:
    """`mean (worst)`; one of them where they are the same."""
    mean, worst = group.mean(key), group.worst(key)
    if mean is None or mean == worst:
        return number(mean, digits)
    return f"{number(mean, max(digits, 1))} ({number(worst, digits)})"


def change(group: Group, earlier: str, later: str) -> str:
    """`before -> during, n x`."""
    ratio = group.ratio(later, earlier)
    factor = NONE if ratio is None else f"{ratio:.2f} x"
    return f"{number(group.mean(earlier), 1)} -> {number(group.mean(later), 1)}, {factor}"


def _step(group: Group) -> Row:
    return [number(group.mean("step_s"), 1), number(group.mean("busy_wait_s"), 1)]


def _pubsub(group: Group) -> Row:
    figures = [mean_worst(group, key) for key in ("sent", "lost", "duplicates", "gap_ms", "gap_control_ms")]
    return [*figures, *_step(group)]


def _service(group: Group) -> Row:
    latency = change(group, "p95_before_ms", "p95_during_ms")
    return [mean_worst(group, "sent"), mean_worst(group, "failed"), latency, *_step(group)]


def _action(group: Group) -> Row:
    figures = [mean_worst(group, key) for key in ("sent", "aborted", "lost", "twice")]
    return [*figures, change(group, "completion_before_ms", "completion_during_ms"), *_step(group)]


HEADS: Mapping[str, tuple[str, list[str], Callable[[Group], Row]]] = {
    "pubsub": (
        "Pub/sub (table 4.4)",
        ["sent", "lost", "duplicates", "longest gap ms", "gap in control ms", "step s", "busy wait s"],
        _pubsub,
    ),
    "service": ("Service (table 4.2)", ["requests", "failed", "p95 ms", "step s", "busy wait s"], _service),
    "action": (
        "Action (table 4.3)",
        ["goals", "aborted", "lost", "twice", "completion ms", "step s", "busy wait s"],
        _action,
    ),
}


def _ratio(pair: Mapping[str, float]) -> str:
    return f"{pair['before']} -> {pair['during']}, {pair['during'] / pair['before']:.2f} x"


def seed_rows(name: str) -> list[Row]:
    """The dissertation's figures in the table's columns."""
    if name == "pubsub":
        return [
            [
                case,
                "seed",
                "no",
                "10",
                f"{seed.SENT:,}",
                str(lost),
                NONE,
                f"{seed.DOWNTIME_MS[case]} (est.)",
                NONE,
                NONE,
                NONE,
            ]
            for case, lost in seed.LOST.items()
        ]
    if name == "service":
        return [
            [
                "service/server",
                "seed",
                "no",
                "10",
                NONE,
                str(seed.SERVICE_FAILED),
                _ratio(seed.SERVICE_P95_MS),
                NONE,
                NONE,
            ]
        ]
    return [
        [
            "action/server",
            "seed",
            "no",
            "10",
            NONE,
            str(seed.ACTION_ABORTED),
            NONE,
            NONE,
            _ratio(seed.ACTION_MS),
            NONE,
            NONE,
        ]
    ]


def theirs() -> str:
    """The dissertation's figures alone."""
    return "\n\n".join(
        f"### {title}\n\n{markdown([*NAMES, *heads], seed_rows(name))}" for name, (title, heads, _row) in HEADS.items()
    )


def tables(records: Iterable[Record]) -> str:
    """All tables. Figures are means over the trials, in brackets the worst one."""
    every = groups(records)
    parts = []
    for name, (title, heads, row) in HEADS.items():
        of_kind = [group for group in every if kind(group) == name]
        if of_kind:
            rows = [
                [group.case, group.arm, "yes" if group.stress else "no", str(len(group.records)), *row(group)]
                for group in of_kind
            ]
            parts.append(f"## {title}\n\n{markdown([*NAMES, *heads], [*seed_rows(name), *rows])}")
    return "\n\n".join(parts)


def phase_table(details: Iterable[Mapping[str, Any]]) -> str:
    """Mean seconds of every phase, by update, arm and stress; `run` is the whole command."""
    kept: dict[tuple[str, str, bool], list[Mapping[str, Any]]] = {}
    for item in details:
        kept.setdefault((f"{item['app']}/{item['update']}", item["arm"], item["stress"]), []).append(item)
    names = list(dict.fromkeys(name for items in kept.values() for item in items for name in item["phases"]))
    rows = []
    for (case, arm, stress), items in kept.items():
        phases = [number(_mean(item["phases"].get(name) for item in items), 2) for name in names]
        rows.append([case, arm, "yes" if stress else "no", *phases, number(_mean(item["run_s"] for item in items), 2)])
    return markdown(["update", "arm", "stress", *names, "run"], rows)


def loss_table(details: Iterable[Mapping[str, Any]]) -> str:
    """Pub/sub, sums over the trials: what the applications' own queues dropped is not what an update lost."""
    kept: dict[tuple[str, str, bool], list[Mapping[str, Any]]] = {}
    for item in details:
        if "dropped_by_queues" in item:
            kept.setdefault((f"{item['app']}/{item['update']}", item["arm"], item["stress"]), []).append(item)
    keys = ("lost", "dropped_by_queues", "lost_during", "lost_control", "not_sent")
    rows = [
        [case, arm, "yes" if stress else "no", *(number(_sum(item[key] for item in items)) for key in keys),
         number(max((item["subscriber_processes"] for item in items), default=None))]
        for (case, arm, stress), items in kept.items()
    ]  # fmt: skip
    heads = ["lost", "dropped by own queues", "lost in the update", "lost in the control", "never published"]
    return markdown(["update", "arm", "stress", *heads, "subscriber processes (most)"], rows)


def _sum(values: Iterable[float | None]) -> float | None:
    known = list(values)
    return None if None in known else sum(value for value in known if value is not None)


def usage_table(details: Iterable[Mapping[str, Any]]) -> str:
    """CPU (per cent of one core) and memory of both arms: pods with their probes and hooks, and all of both hosts."""
    kept: dict[tuple[str, bool], dict[int, Mapping[str, Any]]] = {}
    for item in details:
        kept.setdefault((item["arm"], item["stress"]), {})[item["trial"]] = item
    rows = []
    for (arm, stress), trials in kept.items():
        loads = [trial.get("load_before") for trial in trials.values()]
        for part in ("quiet", "updates"):
            figures = [
                number(_mean((item[f"usage_{part}"] or {}).get(key) for item in trials.values()), 1)
                for key in ("pods_cpu", "pods_mib", "hosts_cpu", "hosts_mib")
            ]
            rows.append([arm, "yes" if stress else "no", part, *figures, number(_mean(loads), 1)])
    heads = ["arm", "stress", "while", "pods CPU %", "pods MiB", "hosts CPU %", "hosts MiB", "machine's load before"]
    return markdown(heads, rows)


def _mean(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known else None


def markdown(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table that also reads well as plain text."""
    every = [list(heads), *map(list, rows)]
    widths = [max(len(row[column]) for row in every) for column in range(len(heads))]
    lines = [
        "| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) + " |" for row in every
    ]
    lines.insert(1, "|" + "|".join("-" * (width + 2) for width in widths) + "|")
    return "\n".join(lines)
