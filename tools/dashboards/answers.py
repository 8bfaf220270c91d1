# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What Prometheus and Loki answered to a dashboard's queries at one time, as a file to draw from."""

from __future__ import annotations

import json
import urllib.parse
import urllib.request
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from .panels import Json
from .queries import Query, of_page

Series = dict[str, Any]
Ask = Callable[[Query, float, float, float], list[Series]]
PATHS = {"promql": "/api/v1", "logql": "/loki/api/v1"}
POINTS = 240  # of a curve
SECONDS = 30


@dataclass(frozen=True)
class Answers:
    """`results` by what was asked; `refused` are queries that had none, with the server's words."""

    uid: str
    begin: float
    end: float
    robot: str
    results: dict[str, list[Series]] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)

    def text(self) -> str:
        return json.dumps(asdict(self), indent=1, sort_keys=True) + "\n"


def read(path: Path) -> Answers:
    """From a file that `Answers.text` was written to."""
    return Answers(**json.loads(path.read_text("utf-8")))


def key(query: Query) -> str:
    """One query over a time and at one time are two questions."""
    return f"{'at' if query.instant else 'over'} {query.expr}"


def record(page: Json, ask: Ask, begin: float, end: float, robot: str = ".*") -> Answers:
    """Ask every query of the dashboard's panels."""
    found = Answers(str(page["uid"]), begin, end, robot)
    for query in of_page(page, robot):
        if query.kind == "panel":
            try:
                found.results[key(query)] = ask(query, begin, end, max((end - begin) / POINTS, 1))
            except OSError as error:  # urllib's errors are OSErrors
                found.refused[query.where] = str(error)
    return found


def server(prometheus: str, loki: str) -> Ask:
    """The two servers' own APIs, by their URLs."""

    def ask(query: Query, begin: float, end: float, step: float) -> list[Series]:
        given = {"query": query.expr}
        if query.instant:
            given["time"] = f"{end:.3f}"
        else:
            given |= {"start": f"{begin:.3f}", "end": f"{end:.3f}", "step": f"{step:g}"}
        base = prometheus if query.language == "promql" else loki
        path = f"{PATHS[query.language]}/query{'' if query.instant else '_range'}"
        url = f"{base}{path}?{urllib.parse.urlencode(given)}"
        with urllib.request.urlopen(url, timeout=SECONDS) as answer:  # noqa: S310 - what the caller named
            return list(json.load(answer)["data"]["result"])

    return ask
