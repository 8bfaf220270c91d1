# SPDX-License-Identifier: GPL-3.0-or-later
"""Records -> the tables of the report, beside the dissertation's own figures. Pure; Markdown."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from . import seed
from .groups import Group, groups
from .records import Record
from .scenario import RATE
from .verdicts import kind

NONE = "-"
NAMES = ("update", "arm", "stress", "trials", "ended")
Row = list[str]


def number(value: float | None, digits: int = 0) -> str:
    """A figure, or a dash."""
    return NONE if value is None else f"{value:,.{digits}f}"


def mean_worst(group: Group, key: str, digits: int = 0) -> str:
    """`mean (worst)` of the trials' own figures; one of them where they are the same."""
    mean, worst = group.mean(key), group.worst(key)
    if mean is None or mean == worst:
        return number(mean, digits)
    return f"{number(mean, max(digits, 1))} ({number(worst, digits)})"


def change(group: Group, earlier: str, later: str) -> str:
    """`before -> during, n x`."""
    ratio = group.ratio(later, earlier)
    factor = NONE if ratio is None else f"{ratio:.2f} x"
    return f"{number(group.mean(earlier), 1)} -> {number(group.mean(later), 1)}, {factor}"


def _times(group: Group) -> Row:
    return [number(group.mean("step_s"), 1), number(group.mean("run_s"), 1)]


def _pubsub(group: Group) -> Row:
    return [*(mean_worst(group, key) for key in ("sent", "lost", "gap_ms", "gap_control_ms")), *_times(group)]


def _lateness(group: Group) -> Row:
    ages = [mean_worst(group, key) for key in ("oldest_control_ms", "oldest_ms", "oldest_run_ms")]
    twice = [figure / RATE for figure in group.values("duplicates")]
    seconds = NONE if not twice else f"{sum(twice) / len(twice):.1f} ({max(twice):.1f})"
    return [*ages, seconds, *(mean_worst(group, key) for key in ("ran_back", "furthest_back_ms"))]


def _service(group: Group) -> Row:
    counted = [mean_worst(group, "sent"), mean_worst(group, "failed")]
    keys = ("p50_before_ms", "p50_run_ms", "p95_before_ms", "p95_step_ms", "p95_run_ms")
    answers = [mean_worst(group, key, 1) for key in keys]
    ratio = group.ratio("p95_run_ms", "p95_before_ms")
    tail = [mean_worst(group, key, 1) for key in ("p99_before_ms", "p99_run_ms")]
    return [*counted, *answers, NONE if ratio is None else f"{ratio:.2f}", *tail, *_times(group)]


def _action(group: Group) -> Row:
    figures = [mean_worst(group, key) for key in ("sent", "aborted", "lost", "twice")]
    completion = [change(group, "completion_before_ms", "completion_during_ms")]
    longest = mean_worst(group, "completion_longest_ms")
    return [*figures, *completion, longest, number(group.mean("busy_wait_s"), 1), *_times(group)]


@dataclass(frozen=True)
class Kind:
    """A table: of what kind of case, its columns, and the dissertation's figures in them."""

    title: str
    of: str
    heads: Sequence[str]
    row: Callable[[Group], Row]
    seed: Mapping[str, Mapping[str, str]]  # case -> column -> figure


def _ratio(pair: Mapping[str, float]) -> str:
    return f"{pair['before']} -> {pair['during']}, {pair['during'] / pair['before']:.2f} x"


KINDS = (
    Kind(
        "Pub/sub (table 4.4)",
        "pubsub",
        ["sent", "lost", "longest gap ms", "gap in control ms", "step s", "run s"],
        _pubsub,
        {
            case: {"sent": f"{seed.SENT:,}", "lost": str(lost), "longest gap ms": f"{seed.DOWNTIME_MS[case]} (est.)"}
            for case, lost in seed.LOST.items()
        },
    ),
    Kind(
        "Pub/sub: how late, how long twice, in which order",
        "pubsub",
        ["oldest in control ms", "oldest in step ms", "oldest in run ms", "twice s", "ran back", "furthest back ms"],
        _lateness,
        {},
    ),
    Kind(
        "Service (table 4.2)",
        "service",
        [
            *("requests", "failed", "p50 before ms", "p50 in run", "p95 before ms", "p95 in step", "p95 in run"),
            *("run / before", "p99 before ms", "p99 in run", "step s", "run s"),
        ],
        _service,
        {
            "service/server": {
                "failed": str(seed.SERVICE_FAILED),
                "p95 before ms": str(seed.SERVICE_P95_MS["before"]),
                "p95 in run": str(seed.SERVICE_P95_MS["during"]),
                "run / before": f"{seed.SERVICE_P95_MS['during'] / seed.SERVICE_P95_MS['before']:.2f}",
            }
        },
    ),
    Kind(
        "Action (table 4.3)",
        "action",
        ["goals", "aborted", "lost", "twice", "completion ms", "longest ms", "busy wait s", "step s", "run s"],
        _action,
        {"action/server": {"aborted": str(seed.ACTION_ABORTED), "completion ms": _ratio(seed.ACTION_MS)}},
    ),
)


def _table(kind_of: Kind, rows: Iterable[Row]) -> str:
    theirs = [
        [case, "seed", "no", "10", NONE, *(figures.get(head, NONE) for head in kind_of.heads)]
        for case, figures in kind_of.seed.items()
    ]
    return f"## {kind_of.title}\n\n{markdown([*NAMES, *kind_of.heads], [*theirs, *rows])}"


def theirs() -> str:
    """The dissertation's figures alone."""
    return "\n\n".join(_table(one, []) for one in KINDS if one.seed)


def tables(records: Iterable[Record]) -> str:
    """All tables. Figures are means over the trials, in brackets the worst one."""
    every = groups(records)
    parts = []
    for one in KINDS:
        of_kind = [group for group in every if kind(group) == one.of]
        if of_kind:
            rows = [
                [group.case, group.arm, "yes" if group.stress else "no", str(len(group.records)), group.ended(),
                 *one.row(group)]
                for group in of_kind
            ]  # fmt: skip
            parts.append(_table(one, rows))
    return "\n\n".join(parts)


def success(records: Iterable[Record]) -> str:
    """Per arm: how many updates ended as they should."""
    found: dict[str, list[bool]] = {}
    for item in records:
        found.setdefault(item["arm"], []).append(item["step_s"] is not None)
    return "; ".join(f"{arm} {sum(ended)} of {len(ended)}" for arm, ended in found.items())


def _by_case(details: Iterable[Mapping[str, Any]]) -> dict[tuple[str, str, bool], list[Mapping[str, Any]]]:
    """(Update, arm, stress) -> its trials."""
    kept: dict[tuple[str, str, bool], list[Mapping[str, Any]]] = {}
    for item in details:
        kept.setdefault((f"{item['app']}/{item['update']}", item["arm"], item["stress"]), []).append(item)
    return kept


def phase_table(details: Iterable[Mapping[str, Any]]) -> str:
    """Mean seconds of every phase, by update, arm and stress; `run` is the whole command."""
    kept = _by_case(details)
    names = list(dict.fromkeys(name for items in kept.values() for item in items for name in item["phases"]))
    rows = []
    for (case, arm, stress), items in kept.items():
        phases = [number(_mean(item["phases"].get(name) for item in items), 2) for name in names]
        run = _mean(seconds(item["run_span"]) for item in items)
        rows.append([case, arm, "yes" if stress else "no", *phases, number(run, 2)])
    return markdown(["update", "arm", "stress", *names, "run"], rows)


def loss_table(details: Iterable[Mapping[str, Any]]) -> str:
    """Pub/sub, sums over the trials: what the applications' own queues dropped is not what an update lost."""
    kept = _by_case(item for item in details if "dropped_by_queues" in item)
    keys = ("lost", "dropped_by_queues", "lost_during", "lost_control", "not_sent")
    rows = [
        [case, arm, "yes" if stress else "no", *(number(_sum(item[key] for item in items)) for key in keys),
         number(max((item["subscriber_processes"] for item in items), default=None))]
        for (case, arm, stress), items in kept.items()
    ]  # fmt: skip
    heads = ["lost", "dropped by own queues", "lost in the update", "lost in the control", "never published"]
    return markdown(["update", "arm", "stress", *heads, "subscriber processes (most)"], rows)


def seconds(span: Sequence[float]) -> float:
    """How long a span of the details is."""
    return float(span[1] - span[0])


def _sum(values: Iterable[float | None]) -> float | None:
    known = list(values)
    return None if None in known else sum(value for value in known if value is not None)


def loop_table(details: Iterable[Mapping[str, Any]]) -> str:
    """How late a control loop's ticks came, by update, arm and stress."""
    rows = []
    for (case, arm, stress), items in _by_case(details).items():
        middle, most = (
            [_mean(item["loop"][span][key] for item in items) for span in ("before", "step")]
            for key in ("p999_us", "worst_us")
        )
        factor = middle[1] / middle[0] if middle[0] and middle[1] is not None else None
        figures = [*(number(value, 0) for value in middle), number(factor, 2), *(number(value, 0) for value in most)]
        rows.append([case, arm, "yes" if stress else "no", str(len(items)), *figures])
    heads = ["p99.9 before us", "in step us", "factor", "worst before us", "in step us"]
    return markdown(["update", "arm", "stress", "trials", *heads], rows)


def usage_table(details: Iterable[Mapping[str, Any]]) -> str:
    """CPU (per cent of one core) and memory of both arms: pods with their probes and hooks, and all of both hosts."""
    kept: dict[tuple[str, bool], list[Mapping[str, Any]]] = {}
    for item in details:
        kept.setdefault((item["arm"], item["stress"]), []).append(item)
    rows = []
    for (arm, stress), items in kept.items():
        loads = [item.get("load_before") for item in items]
        for part in ("quiet", "updates"):
            figures = [
                number(_mean((item[f"usage_{part}"] or {}).get(key) for item in items), 1)
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
