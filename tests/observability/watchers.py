# SPDX-License-Identifier: GPL-3.0-or-later
"""What the fleet's watchers are asked from outside: Prometheus and Loki at the hub's ports."""

from __future__ import annotations

import json
import urllib.error
import urllib.parse
import urllib.request
from dataclasses import dataclass
from typing import Any

Series = dict[str, Any]
TIMEOUT = 30


class RefusedError(Exception):
    """A query that is none."""


def ask(url: str, **parameters: Any) -> Any:
    """The answer's `data`; RefusedError with the server's words."""
    query = urllib.parse.urlencode(parameters)
    try:
        with urllib.request.urlopen(f"{url}?{query}", timeout=TIMEOUT) as answer:  # noqa: S310 - the lab's own hub
            return json.load(answer)["data"]
    except urllib.error.HTTPError as error:
        raise RefusedError(f"{error.code}: {error.read().decode(errors='replace')[:500]}") from None


@dataclass(frozen=True)
class Prometheus:
    """Its API."""

    url: str

    def instant(self, expr: str, at: float | None = None) -> list[Series]:
        """The series of a query at one time."""
        when = {} if at is None else {"time": f"{at:.3f}"}
        return list(ask(f"{self.url}/api/v1/query", query=expr, **when)["result"])

    def over(self, expr: str, begin: float, end: float, step: float) -> list[Series]:
        """The series of a query over a time, as a graph asks for it."""
        times = {"start": f"{begin:.3f}", "end": f"{end:.3f}", "step": f"{step:g}"}
        return list(ask(f"{self.url}/api/v1/query_range", query=expr, **times)["result"])

    def samples(self, selector: str, begin: float, end: float) -> list[Series]:
        """The samples themselves, as they were taken."""
        return self.instant(f"{selector}[{max(end - begin, 1):.0f}s]", end)

    def value(self, expr: str) -> float | None:
        """Of the only series that there is."""
        found = self.instant(expr)
        return float(found[0]["value"][1]) if len(found) == 1 else None

    def targets(self) -> list[dict[str, Any]]:
        """Those that it looks at."""
        return list(ask(f"{self.url}/api/v1/targets", state="active")["activeTargets"])

    def firing(self, name: str, **labels: str) -> list[Series]:
        """An alert's instances that fire."""
        found = ask(f"{self.url}/api/v1/alerts")["alerts"]
        wanted = {"alertname": name, **labels}.items()
        return [one for one in found if one["state"] == "firing" and wanted <= one["labels"].items()]


@dataclass(frozen=True)
class Loki:
    """Its API."""

    url: str

    def instant(self, expr: str) -> list[Series]:
        """The series of a metric query."""
        return list(ask(f"{self.url}/loki/api/v1/query", query=expr)["result"])

    def over(self, expr: str, begin: float, end: float, step: float = 60, limit: int = 100) -> list[Series]:
        """Streams, or the series of a metric query."""
        times = {"start": f"{begin:.3f}", "end": f"{end:.3f}", "step": f"{step:g}", "limit": limit}
        return list(ask(f"{self.url}/loki/api/v1/query_range", query=expr, **times)["result"])

    def streams(self, selector: str, begin: float, end: float) -> list[dict[str, str]]:
        """The labels of streams, without what is kept with a line."""
        return list(
            ask(f"{self.url}/loki/api/v1/series", **{"match[]": selector}, start=f"{begin:.3f}", end=f"{end:.3f}")
        )

    def lines(self, selector: str, begin: float, end: float, page: int = 4000) -> list[str]:
        """Every line, the oldest first, page by page; a line of the same time as a page's last is not lost."""
        found: dict[tuple[int, str], None] = {}
        start = int(begin * 1e9)
        while True:
            given = {"query": selector, "start": start, "end": int(end * 1e9), "limit": page, "direction": "forward"}
            result = ask(f"{self.url}/loki/api/v1/query_range", **given)["result"]
            got = sorted((int(time), line) for stream in result for time, line, *_more in stream["values"])
            new = {one: None for one in got if one not in found}
            found.update(new)
            if len(got) < page or not new:
                return [line for _time, line in sorted(found)]
            start = got[-1][0]
