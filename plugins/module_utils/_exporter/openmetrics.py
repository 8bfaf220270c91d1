# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Metric families -> OpenMetrics text, which Prometheus, vmagent and the OpenTelemetry collector read. Pure.

Format: https://prometheus.io/docs/specs/om/open_metrics_spec/.
"""

from __future__ import annotations

import math
from typing import Iterable

from .families import COUNTER, Family

CONTENT_TYPE = "application/openmetrics-text; version=1.0.0; charset=utf-8"
TOTAL = "_total"  # ends the name of a counter's sample, and is no part of its family's


def text(families: Iterable[Family]) -> bytes:
    """The whole answer to a scrape. A family without samples is left out: its lines would say nothing."""
    lines = []
    for family in families:
        if not family.samples:
            continue
        name = family.name[: -len(TOTAL)] if family.kind == COUNTER else family.name
        lines += [f"# TYPE {name} {family.kind}", f"# HELP {name} {escaped(family.help)}"]
        for labels, value in family.samples:
            inner = ",".join(f'{key}="{escaped(word)}"' for key, word in sorted(labels.items()))
            lines.append(f"{family.name}{{{inner}}} {number(value)}" if inner else f"{family.name} {number(value)}")
    return "\n".join([*lines, "# EOF\n"]).encode()


def escaped(word: str) -> str:
    """
    >>> escaped('a "b"')
    'a \\\\"b\\\\"'
    """
    return word.replace("\\", r"\\").replace("\n", r"\n").replace('"', r"\"")


def number(value: float) -> str:
    if math.isnan(value):
        return "NaN"
    return repr(float(value)) if math.isfinite(value) else f"{'+' if value > 0 else '-'}Inf"
