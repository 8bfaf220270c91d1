# SPDX-License-Identifier: GPL-3.0-or-later
"""The role's dashboards: they are what the generator writes, keep to our rules, and ask for what something emits."""

from __future__ import annotations

import copy
import json
import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.configs import config
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.files import checked
from ansible_collections.rosops.fleet.tests.unit.observability.specs import full
from ansible_collections.rosops.fleet.tests.unit.observability.test_dashboards_rules import alerts
from dashboards import build
from dashboards.lint import fleet_findings, logql_findings, page_findings, promql_findings
from dashboards.queries import FILES, Query, all_queries, filled, needs, of_rules

METRICS: dict[str, list[str]] = yaml.safe_load((Path(__file__).resolve().parent / "metrics.yml").read_text("utf-8"))
NAMES = {"fleet", "robot", "application", "ros-graph", "topics", "updates", "hosts-k3s", "logs", "telemetry"}
QUERIES = all_queries()


def known() -> set[str]:
    """Everything that something of ours emits or records."""
    recorded = {
        query.where.partition(": ")[2]
        for path in (FILES / "rules").glob("*.yml")
        for query in of_rules(path)
        if ":" in query.where.partition(": ")[2]
    }
    return recorded.union(*METRICS.values())


@pytest.fixture(name="promql")
def _promql() -> Any:
    # ansible-test's own environment has no parser; the project's has
    return pytest.importorskip("promql_parser", reason="promql-parser is not installed (requirements.txt)")


def pages() -> list[dict[str, Any]]:
    return [json.loads(path.read_text("utf-8")) for path in sorted((FILES / "dashboards").glob("*.json"))]


def test_the_files_are_what_the_generator_writes() -> None:
    assert build.stale(build.FOLDER) == []
    assert set(build.dashboards()) == NAMES


def test_a_changed_missing_or_left_over_file_is_noticed(tmp_path: Path) -> None:
    for name, text in build.written().items():
        (tmp_path / name).write_text(text, "utf-8")
    assert build.stale(tmp_path) == []
    (tmp_path / "fleet.json").write_text("{}", "utf-8")
    (tmp_path / "robot.json").unlink()
    (tmp_path / "old.json").write_text("{}", "utf-8")
    assert build.stale(tmp_path) == ["fleet.json", "old.json", "robot.json"]


@pytest.mark.parametrize("page", pages(), ids=lambda page: str(page["uid"]))
def test_a_dashboard_keeps_to_our_rules(page: dict[str, Any]) -> None:
    assert list(page_findings(page)) == []
    assert page["schemaVersion"] == 40
    assert [mark["name"] for mark in page["annotations"]["list"]] == ["Annotations & Alerts", "Updates"]


def test_the_dashboards_together_keep_to_our_rules_and_those_for_the_users() -> None:
    assert list(fleet_findings(pages())) == []
    files = [(path.name, path.read_bytes()) for path in sorted((FILES / "dashboards").glob("*.json"))]
    assert {one.name for one in checked(files)} == {f"rosops-{name}" for name in NAMES}


@pytest.mark.parametrize("query", [q for q in QUERIES if q.language == "promql"], ids=lambda query: str(query.where))
def test_promql_parses_and_asks_for_what_is_emitted(query: Query, promql: Any) -> None:
    assert list(promql_findings(query, known(), promql.parse, promql.walk)) == []


@pytest.mark.parametrize("query", [q for q in QUERIES if q.language == "logql"], ids=lambda query: str(query.where))
def test_logql_chooses_streams_by_the_labels_of_the_shipper(query: Query) -> None:
    assert list(logql_findings(query)) == []


def test_nothing_is_left_to_fill_in() -> None:
    assert [query.where for query in QUERIES if "$" in query.expr.replace('"$1"', "")] == []


@pytest.mark.parametrize(
    ("job", "files"),
    [("ros-exporter", "plugins/module_utils/_exporter/*.py"), ("apps", "tests/apps/rosops_apps/metrics.py")],
)
def test_our_own_metrics_are_those_in_their_code(job: str, files: str) -> None:
    code = "".join(path.read_text("utf-8") for path in FILES.parents[2].glob(files))
    assert [name for name in METRICS[job] if name not in code] == []


@pytest.mark.parametrize("job", ["kubelet", "cadvisor", "apiserver"])
def test_what_is_asked_for_is_kept_when_it_is_scraped(job: str) -> None:
    jobs = {one["job_name"]: one for one in config("scrape", full({}))["scrape_configs"]}
    own = [job, "kubelet-probes"] if job == "kubelet" else [job]
    patterns = [jobs[name]["metric_relabel_configs"][0]["regex"] for name in own]
    asked = {word for query in QUERIES for word in re.findall(r"[a-z_]\w+", query.expr)} & set(METRICS[job])
    lost = {name for name in asked if not any(re.fullmatch(pattern, name) for pattern in patterns)}
    if job == "apiserver":
        lost -= set(METRICS["kubelet"])  # k3s serves its own metric in both places
    assert asked
    assert lost == set()


def links() -> list[tuple[str, str]]:
    """Dashboard and panel -> where a click on a cell leads."""
    return [
        (f"{page['uid']}: {panel['title']}", link["url"])
        for page in pages()
        for panel in page["panels"]
        for override in panel.get("fieldConfig", {}).get("overrides", [])
        for one in override["properties"]
        if one["id"] == "links"
        for link in one["value"]
    ]


def test_a_row_of_a_robot_leads_to_its_dashboard_and_that_takes_the_name() -> None:
    led = {where: url for where, url in links() if url.startswith("/d/")}
    assert {"rosops-fleet: Robots", "rosops-fleet: Alerts now", "rosops-updates: Latest update of each app"} <= set(led)
    by_uid = {page["uid"]: page for page in pages()}
    for url in led.values():
        found = re.fullmatch(r"/d/([a-z-]+)\?var-(\w+)=\$\{__value\.raw\}&\$\{__url_time_range\}", url)
        assert found, url
        assert found[2] in {variable["name"] for variable in by_uid[found[1]]["templating"]["list"]}


def test_an_alert_leads_to_its_runbook() -> None:
    """The link is made of the alert's name, as ALERTS has no annotations: it has to be what each rule says itself."""
    [url] = {url for _where, url in links() if not url.startswith("/d/")}
    for rule in alerts():
        assert url.replace("${__value.raw}", rule["alert"]) == rule["annotations"]["runbook_url"]


def test_a_share_is_green_when_it_is_all_and_says_of_how_many() -> None:
    shares = [panel for page in pages() for panel in page["panels"] if "of {{total}}" in json.dumps(panel)]
    assert len(shares) >= 8
    for panel in shares:
        steps = panel["fieldConfig"]["defaults"]["thresholds"]["steps"]
        assert steps[-1] == {"color": "green", "value": 1} and panel["options"]["textMode"] == "name"
        assert [target["instant"] for target in panel["targets"]] == [True]


def broken(**changes: Any) -> dict[str, Any]:
    page = copy.deepcopy(build.dashboards()["fleet"])
    return {**page, **changes}


def test_the_lint_sees_what_it_is_there_for() -> None:
    page = broken(uid="fleet", id=7)
    page["panels"][0]["fieldConfig"]["defaults"].pop("unit")
    page["panels"][1]["id"] = 1
    page["panels"][2]["datasource"] = {"type": "prometheus", "uid": "abc"}
    page["panels"][3]["targets"][0]["expr"] = "rate(x[5m])"
    page["panels"][4]["targets"][0]["expr"] = "x{a='$b'}"
    page["panels"][5]["gridPos"]["x"] = 22
    found = "\n".join(page_findings(page))
    told = "rosops-<name>|id of a database|no unit|id 1 is used twice|'abc'|$__rate_interval|$b|leaves"
    assert [part for part in told.split("|") if part not in found] == []
    twice = ["uid rosops-fleet is used 2 times", "title Fleet is used 2 times"]
    assert list(fleet_findings([broken(), broken()])) == twice
    blind = broken(templating={"list": []})
    assert any("data source loki" in finding for finding in page_findings(blind))


@pytest.mark.parametrize(
    ("expr", "part"),
    [
        ("sum(rate(ros_master_up[1m])", "unclosed"),
        ("ros_master_upp", "nothing emits ros_master_upp"),
        ('{__name__=~"otelcol_nothing(_total)?"}', "nothing emits"),
        ('{job="x"}', "without naming"),
    ],
)
def test_the_lint_sees_wrong_promql(expr: str, part: str, promql: Any) -> None:
    query = Query("here", "promql", expr, expr, False)
    assert part in "".join(promql_findings(query, known(), promql.parse, promql.walk))


@pytest.mark.parametrize(
    ("expr", "part"),
    [
        ('{app="x"', "not balanced"),
        ('{job="x"}', "no label job"),
        ('{robot=~".*"}', "empty value"),
        ('count_over_time("x" [1m])', "no streams"),
    ],
)
def test_the_lint_sees_wrong_logql(expr: str, part: str) -> None:
    assert part in "".join(logql_findings(Query("here", "logql", expr, expr, False)))


def test_variables_are_filled_in_and_needs_are_told() -> None:
    assert filled('a{robot=~"$robot", n="${node}"}[$__rate_interval]', "r1") == 'a{robot=~"r1", n=".*"}[1m]'
    assert filled('{namespace="robot-$robot"}', "r1") == '{namespace="robot-r1"}'
    assert needs("sum(ros_master_up)") == []
    assert needs("up == 0") == ["something that is down"]
    assert needs("max_over_time(robot:up:max[6h]) == 1 unless robot:up:max == 1") == ["a robot that is away"]
    assert needs("count(up == 0) or vector(0)") == []
    assert needs("rate(vmagent_rows_total[1m])") == ["profile robot"]
