# SPDX-License-Identifier: GPL-3.0-or-later
"""Samples of the hosts' cgroups -> CPU and memory of an arm. Pure."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable, Mapping
from typing import Any

from .windows import Span

MIB = 1024 * 1024
Samples = list[dict[str, Any]]


def usage(samples: Mapping[str, Samples], span: Span, foreign: Collection[str]) -> dict[str, float | None]:
    """Means over a span: `pods_*` are all pods but the foreign ones, on all hosts; `hosts_*` all that the hosts do.

    CPU in per cent of one core, memory in MiB.
    """
    chosen = [[item for item in series if span.holds(item["time"])] for series in samples.values()]
    found: dict[str, float | None] = {"pods_cpu": 0.0, "pods_mib": 0.0, "hosts_cpu": 0.0, "hosts_mib": 0.0}
    for series in chosen:
        for key, value in _host(series, foreign).items():
            known = found[key]
            found[key] = None if known is None or value is None else round(known + value, 2)
    return found if chosen else dict.fromkeys(found)


def _host(series: Samples, foreign: Collection[str]) -> dict[str, float | None]:
    if len(series) < 2:
        return dict.fromkeys(("pods_cpu", "pods_mib", "hosts_cpu", "hosts_mib"))
    seconds = series[-1]["time"] - series[0]["time"]
    pods_ns = sum(_pods_cpu(older, newer, foreign) for older, newer in itertools.pairwise(series))
    return {
        "pods_cpu": pods_ns / seconds / 1e7,
        "pods_mib": _mean(_own(item, foreign, 1) for item in series) / MIB,
        "hosts_cpu": (series[-1]["host"][0] - series[0]["host"][0]) / seconds / 1e7,
        "hosts_mib": _mean(item["host"][1] for item in series) / MIB,
    }


def _pods_cpu(older: Mapping[str, Any], newer: Mapping[str, Any], foreign: Collection[str]) -> int:
    """What the pods used between two samples; one that is new in the second began at 0, one that is gone is let go."""
    return sum(
        values[0] - older["pods"].get(uid, [0, 0])[0] for uid, values in newer["pods"].items() if uid not in foreign
    )


def _own(item: Mapping[str, Any], foreign: Collection[str], column: int) -> int:
    return sum(values[column] for uid, values in item["pods"].items() if uid not in foreign)


def _mean(values: Iterable[int]) -> float:
    every = list(values)
    return sum(every) / len(every)
