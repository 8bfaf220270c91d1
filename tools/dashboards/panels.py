# SPDX-License-Identifier: GPL-3.0-or-later
"""What Grafana's dashboards are made of (schema of Grafana 11.5): panels, variables and the page around them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

Json = dict[str, Any]

PROMETHEUS = {"type": "prometheus", "uid": "${prometheus}"}
LOKI = {"type": "loki", "uid": "${loki}"}
SCHEMA_VERSION = 40  # Grafana 11.5's
COLUMNS = 24
GREEN_ABOVE = (("red", None), ("green", 1))
RED_ABOVE = (("green", None), ("red", 1))
YES_NO = {"0": ("no", "red"), "1": ("yes", "green")}
Steps = Sequence[tuple[str, "float | None"]]


def query(expr: str, legend: str = "", *, instant: bool = False) -> Json:
    """One PromQL query. A table takes the last value of each series, a graph all of them."""
    target: Json = {"datasource": PROMETHEUS, "editorMode": "code", "expr": expr, "legendFormat": legend or "__auto"}
    return {**target, "format": "table" if instant else "time_series", "instant": instant, "range": not instant}


def latest(expr: str) -> Json:
    """A column of a table."""
    return query(expr, instant=True)


def log_query(expr: str, legend: str = "", *, instant: bool = False) -> Json:
    """One LogQL query: lines, or numbers counted from them."""
    kind = "instant" if instant else "range"
    target: Json = {"datasource": LOKI, "editorMode": "code", "expr": expr, "queryType": kind}
    return {**target, "legendFormat": legend} if legend else target


def _thresholds(steps: Steps) -> Json:
    return {"mode": "absolute", "steps": [{"color": color, "value": value} for color, value in steps]}


def _mappings(texts: Mapping[str, tuple[str, str]]) -> list[Json]:
    options = {
        value: {"text": text, "color": color, "index": i} for i, (value, (text, color)) in enumerate(texts.items())
    }
    return [{"type": "value", "options": options}]


def _panel(kind: str, title: str, targets: Sequence[Json], about: str, **rest: Any) -> Json:
    source = targets[0]["datasource"]
    named = [{**target, "refId": chr(ord("A") + i)} for i, target in enumerate(targets)]
    return {"type": kind, "title": title, "description": about, "datasource": source, "targets": named, **rest}


def graph(title: str, unit: str, *targets: Json, about: str = "", stack: bool = False, floor: float | None = 0) -> Json:
    """Curves over time."""
    custom = {
        "drawStyle": "line",
        "fillOpacity": 30 if stack else 8,
        "lineWidth": 1,
        "showPoints": "never",
        "spanNulls": False,
        "stacking": {"group": "A", "mode": "normal" if stack else "none"},
    }
    defaults: Json = {"unit": unit, "custom": custom, "color": {"mode": "palette-classic"}}
    if floor is not None:
        defaults["min"] = floor
    options = {
        "legend": {"displayMode": "table", "placement": "bottom", "calcs": ["lastNotNull", "max"], "showLegend": True},
        "tooltip": {"mode": "multi", "sort": "desc"},
    }
    return _panel(
        "timeseries", title, targets, about, fieldConfig={"defaults": defaults, "overrides": []}, options=options
    )


def stat(title: str, unit: str, *targets: Json, about: str = "", steps: Steps = (("blue", None),)) -> Json:
    """One large number, coloured."""
    defaults = {"unit": unit, "thresholds": _thresholds(steps), "color": {"mode": "thresholds"}}
    options = {
        "colorMode": "background",
        "graphMode": "area",
        "justifyMode": "center",
        "textMode": "auto",
        "reduceOptions": {"calcs": ["lastNotNull"], "fields": "", "values": False},
    }
    return _panel("stat", title, targets, about, fieldConfig={"defaults": defaults, "overrides": []}, options=options)


def share(title: str, good: str, total: str, about: str = "") -> Json:
    """`2 of 3`, green only when it is all of them. The numbers are labels, so that the text can have both."""
    names = f'count_values("good", {good}) * on () group_left (total) count_values("total", {total})'
    target = query(f"({good}) / ({total}) * on () group_left (good, total) ({names})", "{{good}} of {{total}}")
    # the last value alone: each number that there has been is a series of its own
    target = {**target, "instant": True, "range": False}
    panel = stat(title, "percentunit", target, about=about, steps=(("red", None), ("orange", 0.5), ("green", 1)))
    return {**panel, "options": {**panel["options"], "graphMode": "none", "textMode": "name"}}


def states(title: str, *targets: Json, about: str = "", texts: Mapping[str, tuple[str, str]] | None = None) -> Json:
    """A band per series: when it was up and when it was not."""
    custom = {"fillOpacity": 80, "lineWidth": 0}
    defaults = {
        "unit": "none",
        "custom": custom,
        "mappings": _mappings(texts or YES_NO),
        "color": {"mode": "thresholds"},
    }
    defaults["thresholds"] = _thresholds(GREEN_ABOVE)
    options = {"mergeValues": True, "rowHeight": 0.8, "showValue": "never", "legend": {"showLegend": False}}
    config = {"defaults": defaults, "overrides": []}
    return _panel("state-timeline", title, targets, about, fieldConfig=config, options=options)


def table(
    title: str,
    columns: Mapping[str, tuple[str, str]],
    *targets: Json,
    about: str = "",
    links: Mapping[str, tuple[str, str]] | None = None,
) -> Json:
    """The last values, a row per set of labels. `columns`: field of the answer -> (heading, unit); others are left out.

    With several queries the answer's fields are `Value #A`, `Value #B`, with one it is `Value`.
    `links`: heading -> title and URL of where a click on a cell leads.
    """
    led = links or {}
    overrides = [
        {"matcher": {"id": "byName", "options": heading}, "properties": [*_column(unit), *_link(*led.get(heading, ()))]}
        for heading, unit in columns.values()
        if unit or heading in led
    ]
    shown = {field: heading for field, (heading, _unit) in columns.items()}
    transformations = [
        {"id": "merge", "options": {}},
        {"id": "filterFieldsByName", "options": {"include": {"names": list(columns)}}},
        {
            "id": "organize",
            "options": {"renameByName": shown, "indexByName": {field: i for i, field in enumerate(columns)}},
        },
    ]
    config = {"defaults": {"unit": "none", "custom": {"align": "auto", "filterable": True}}, "overrides": overrides}
    return _panel("table", title, targets, about, fieldConfig=config, transformations=transformations, options={})


def _link(title: str = "", url: str = "") -> list[Json]:
    return [{"id": "links", "value": [{"title": title, "url": url, "targetBlank": False}]}] if url else []


def _column(unit: str) -> list[Json]:
    if not unit:
        return []
    if unit != "yes/no":
        return [{"id": "unit", "value": unit}]
    cell = {"id": "custom.cellOptions", "value": {"type": "color-text"}}
    return [{"id": "mappings", "value": _mappings(YES_NO)}, cell]


def logs(title: str, *targets: Json, about: str = "") -> Json:
    """Log lines, newest first."""
    options = {"showTime": True, "wrapLogMessage": True, "sortOrder": "Descending", "enableLogDetails": True}
    return _panel("logs", title, targets, about, options=options)


def source_variable(name: str) -> Json:
    """The data source as a variable: its UID is provisioned, and a user may choose another one."""
    current = {"selected": True, "text": name.capitalize(), "value": name}
    return {
        "type": "datasource",
        "name": name,
        "label": name.capitalize(),
        "query": name,
        "current": current,
        "hide": 0,
    }


def label_variable(name: str, expr: str, *, many: bool = True, empty: str = ".*") -> Json:
    """Values of a label, by a query like label_values(up, robot). `empty` is what stands for all of them."""
    every = {"selected": True, "text": ["All"], "value": ["$__all"]} if many else {}
    return {
        "type": "query",
        "name": name,
        "label": name.capitalize(),
        "datasource": PROMETHEUS,
        "definition": expr,
        "query": {"query": expr, "refId": "variable"},
        "refresh": 2,  # whenever the time range changes: robots come and go
        "sort": 1,
        "multi": many,
        "includeAll": many,
        "current": every,
        **({"allValue": empty} if many else {}),
    }


def text_variable(name: str, label: str) -> Json:
    """Something to type."""
    return {"type": "textbox", "name": name, "label": label, "query": "", "current": {"text": "", "value": ""}}


def placed(rows: Sequence[Sequence[Json]], heights: Mapping[str, int]) -> list[Json]:
    """The panels with their ids and places: each row shares the width."""
    panels: list[Json] = []
    top = 0
    for row in rows:
        width, rest = divmod(COLUMNS, len(row))
        left = 0
        height = max(heights.get(panel["type"], 8) for panel in row)
        for i, panel in enumerate(row):
            share = width + (1 if i < rest else 0)
            place = {"h": height, "w": share, "x": left, "y": top}
            panels.append({"id": len(panels) + 1, "gridPos": place, **panel})
            left += share
        top += height
    return panels
