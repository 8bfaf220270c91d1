# SPDX-License-Identifier: GPL-3.0-or-later
"""Every query of dashboards and rules, as Prometheus and Loki are asked: for the lint and for tests on a running lab.

PYTHONPATH=tools python -m dashboards.queries [robot]      # as JSON
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import yaml

CHECKOUT = Path(__file__).resolve().parents[2]
FILES = CHECKOUT / "roles" / "observability" / "files"

# Grafana fills these in. A minute holds several scrapes.
INTERVALS = {"$__rate_interval": "1m", "$__interval": "1m", "$__range": "1h", "$__auto": "1m"}

# What has to be there for a query to have an answer: in a quiet lab these may be empty, and that is no fault.
NEEDS = {
    r"^otelcol_exporter_(enqueue|send)_failed": "a lost log line",
    r"^otelcol_": "log shipper otelcol",
    r"^vmagent_": "profile robot",
    r"^prometheus_remote_storage_": "remote write",
    r"^ros_action_goals$": "an action",
    r"^ros_service_up$": "a service",
    r"^robot_update_": "an update",
    r"^rosops_app_": "an app with metrics of its own",
    r"^rosops_claim_": "a claim",
    r"^kubelet_volume_stats_": "a volume that the kubelet can measure (local-path is none)",
    r"^k3s_": "k3s itself; the lab's stand-in has no such metric",
    r"^node_(hwmon|power_supply)_": "sensors or a battery",
    r"^loki_discarded_": "a refused log line",
    r"^logs_lost:": "a lost log line",
    r"^robot:up:offline$": "a robot that is away",
    r"^ALERTS$": "an alert",
}
# The same, by what the query does with what is there.
TEXT_NEEDS = {
    r"== 0": "something that is down",
    r"error\|fatal": "an error in the logs",
    r'event="update"': "an update",
    r'result!="successful"': "a probe that failed",
    r"unless robot:up:max == 1": "a robot that is away",
    r"offset 3m": "a topic that has been known for 4 minutes",
}


class Query(NamedTuple):
    """One question. `expr` is filled in, `raw` as in the file; `where` is for people.

    `kind` is panel, annotation, variable, record or alert; an alert has an answer only when it fires.
    """

    where: str
    language: str  # promql | logql
    expr: str
    raw: str
    instant: bool
    kind: str = "panel"


def filled(expr: str, robot: str = ".*") -> str:
    """The query with Grafana's variables filled in."""
    for name, value in INTERVALS.items():
        expr = expr.replace(name, value)
    expr = re.sub(r"\$\{?robot\b\}?", robot, expr)
    expr = re.sub(r"\$\{?namespace\b\}?", ".+", expr)
    return re.sub(r"\$\{?search\b\}?", "", re.sub(r"\$\{?(app|node|topic)\b\}?", ".*", expr))


def of_page(page: dict[str, Any], robot: str = ".*") -> Iterator[Query]:
    """The queries of a dashboard: panels, annotations and variables."""
    for panel in page["panels"]:
        for target in panel.get("targets", []):
            language = "logql" if target["datasource"]["type"] == "loki" else "promql"
            where = f"{page['uid']}: {panel['title']} ({target['refId']})"
            instant = bool(target.get("instant")) or target.get("queryType") == "instant"
            yield Query(where, language, filled(target["expr"], robot), target["expr"], instant)
    for mark in page["annotations"]["list"]:
        if mark.get("expr"):
            where = f"{page['uid']}: annotation {mark['name']}"
            yield Query(where, "logql", filled(mark["expr"], robot), mark["expr"], False, "annotation")
    for variable in page["templating"]["list"]:
        found = re.fullmatch(r"label_values\((.+),\s*\w+\)", variable.get("definition", ""))
        if found:
            where = f"{page['uid']}: variable {variable['name']}"
            yield Query(where, "promql", filled(found[1], robot), found[1], True, "variable")


def of_rules(path: Path) -> Iterator[Query]:
    """The expressions of a file of rules."""
    for group in yaml.safe_load(path.read_text("utf-8"))["groups"]:
        for rule in group["rules"]:
            kind = "alert" if "alert" in rule else "record"
            name = rule[kind]
            yield Query(f"{path.name}: {name}", "promql", rule["expr"], rule["expr"], True, kind)


def all_queries(robot: str = ".*") -> list[Query]:
    """Of every dashboard and every rule of the role."""
    pages = [json.loads(path.read_text("utf-8")) for path in sorted((FILES / "dashboards").glob("*.json"))]
    found = [query for page in pages for query in of_page(page, robot)]
    return found + [query for path in sorted((FILES / "rules").glob("*.yml")) for query in of_rules(path)]


def needs(expr: str) -> list[str]:
    """What has to be there for an answer, beside a fleet at work."""
    if expr.endswith("or vector(0)"):
        return []
    words = re.findall(r"[A-Za-z_:][A-Za-z0-9_:]*", expr)
    found = {need for word in words for pattern, need in NEEDS.items() if re.search(pattern, word)}
    return sorted(found | {need for pattern, need in TEXT_NEEDS.items() if re.search(pattern, expr, re.DOTALL)})


if __name__ == "__main__":
    robots = sys.argv[1] if len(sys.argv) > 1 else ".*"
    print(json.dumps([{**query._asdict(), "needs": needs(query.expr)} for query in all_queries(robots)], indent=1))
