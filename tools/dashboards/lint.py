# SPDX-License-Identifier: GPL-3.0-or-later
"""What every dashboard and rule of ours has to keep to. Pure: pages and queries in, findings out."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from typing import Any

from .queries import Query, of_page

Page = dict[str, Any]
SOURCES = {"prometheus": "${prometheus}", "loki": "${loki}"}
WITH_UNITS = {"timeseries", "stat", "state-timeline", "table", "gauge", "bargauge"}
# What the log shipper puts on a stream (level and the rest come from parsers in the query).
STREAM_LABELS = {"robot", "namespace", "app", "pod", "placement"}
FIXED_RANGE = re.compile(r"\[\s*[0-9]")


def page_findings(page: Page) -> Iterator[str]:
    """Of one dashboard by itself."""
    uid = str(page.get("uid"))
    if not re.fullmatch(r"rosops-[a-z0-9-]+", uid):
        yield f"{uid}: a uid of ours is rosops-<name>"
    if page.get("id") is not None:
        yield f"{uid}: has the id of a database"
    names = {variable["name"] for variable in page["templating"]["list"]}
    for kind in SOURCES:
        chosen = [v for v in page["templating"]["list"] if v["type"] == "datasource" and v["query"] == kind]
        if [v["current"]["value"] for v in chosen] != [kind]:
            yield f"{uid}: needs one variable for the data source {kind}, whose value is its UID"
    for source in sources(page):
        if source.get("uid") not in (SOURCES.get(source.get("type", "")), "-- Grafana --"):
            yield f"{uid}: data source {source} is not chosen by a variable"
    ids = Counter(panel["id"] for panel in page["panels"])
    yield from (f"{uid}: panel id {number} is used twice" for number, count in ids.items() if count > 1)
    for panel in page["panels"]:
        defaults = panel.get("fieldConfig", {}).get("defaults", {})
        if panel["type"] in WITH_UNITS and not defaults.get("unit"):
            yield f"{uid}: {panel['title']}: has no unit"
    for query in of_page(page):
        if (
            query.language == "promql"
            and re.search(r"\b(rate|irate|increase)\(", query.raw)
            and (FIXED_RANGE.search(query.raw) or "$__rate_interval" not in query.raw)
        ):
            yield f"{query.where}: the range of a rate is $__rate_interval"
        used = set(re.findall(r"\$\{?([a-z]\w*)", query.raw))
        yield from (f"{query.where}: ${name} is no variable of the dashboard" for name in sorted(used - names))
    yield from _overlaps(page)


def sources(node: Any) -> Iterator[dict[str, Any]]:
    """Every data source that something in a dashboard names."""
    if isinstance(node, dict):
        if isinstance(node.get("datasource"), dict):
            yield node["datasource"]
        node = list(node.values())
    if isinstance(node, list):
        for value in node:
            yield from sources(value)


def _overlaps(page: Page) -> Iterator[str]:
    taken: dict[tuple[int, int], str] = {}
    for panel in page["panels"]:
        place = panel["gridPos"]
        if place["x"] + place["w"] > 24:
            yield f"{page['uid']}: {panel['title']} leaves the page"
        for x in range(place["x"], place["x"] + place["w"]):
            for y in range(place["y"], place["y"] + place["h"]):
                if taken.setdefault((x, y), panel["title"]) != panel["title"]:
                    yield f"{page['uid']}: {panel['title']} lies over {taken[x, y]}"
                    return


def fleet_findings(pages: Sequence[Page]) -> Iterator[str]:
    """Of all dashboards together: Grafana stops writing any of them when two share a uid or a title."""
    for key in ("uid", "title"):
        seen = Counter(str(page[key]) for page in pages)
        yield from (f"{key} {value} is used {count} times" for value, count in seen.items() if count > 1)


def promql_findings(query: Query, known: Collection[str], parse: Callable[[str], Any], walk: Any) -> Iterator[str]:
    """Whether a query parses, and asks only for metrics that something emits."""
    try:
        tree = parse(query.expr)
    except ValueError as error:
        yield f"{query.where}: {error}"
        return
    named: list[str | None] = []

    def look(node: Any) -> None:
        if type(node).__name__ == "VectorSelector":
            named.append(_metric(node))

    walk(tree, look)
    for pattern in named:
        if pattern is None:
            yield f"{query.where}: asks for series without naming a metric"
        elif not any(re.fullmatch(pattern, name) for name in known):
            yield f"{query.where}: nothing emits {pattern}"


def _metric(selector: Any) -> str | None:
    """The metric's name, or the pattern that it is chosen by."""
    if selector.name:
        return re.escape(str(selector.name))
    values = [m.value for m in selector.matchers.matchers if m.name == "__name__"]
    return str(values[0]) if values else None


def logql_findings(query: Query) -> Iterator[str]:
    """There is no parser of LogQL for Python: its outline and its stream labels. Loki itself judges in the lab."""
    bare = re.sub(r'"(?:\\.|[^"\\])*"|`[^`]*`', '""', query.expr)
    for pair in ("{}", "()", "[]"):
        if bare.count(pair[0]) != bare.count(pair[1]):
            yield f"{query.where}: {pair} are not balanced"
    streams = re.findall(r"\{([^}]*)\}", bare)
    if not streams:
        yield f"{query.where}: chooses no streams"
    for stream in streams:
        labels = set(re.findall(r'(\w+)\s*(?:=~|!~|!=|=)\s*""', stream))
        yield from (f"{query.where}: streams have no label {label}" for label in sorted(labels - STREAM_LABELS))
    chosen = re.findall(r'[{,]\s*\w+\s*(=~?)\s*"([^"]*)"', query.expr)
    if not any(value if sign == "=" else not re.fullmatch(value, "") for sign, value in chosen):
        yield f"{query.where}: Loki wants a matcher that an empty value does not meet"
