# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything is looked at, under the labels that were promised, and every question has an answer."""

from __future__ import annotations

import time
from typing import Any

import pytest
from dashboards.queries import NEEDS, TEXT_NEEDS, Query, all_queries, needs
from runs import wait_until
from watched import ALONE, EDGE, INTERVAL, MEMBER, ROBOTS, STREAM, Watched
from watchers import RefusedError

HOST_LABELS = {"node", "placement"}
# Job -> the labels of its series beside job and instance.
OF_PODS = dict.fromkeys(("ros-exporter", "apps"), STREAM)
HUB_JOBS = {
    **dict.fromkeys(("prometheus", "loki"), STREAM - {"robot"}),
    **dict.fromkeys(("node-exporter", "kubelet", "kubelet-probes", "cadvisor"), HOST_LABELS),
    **{"log-shipper": STREAM - {"robot"} | {"node"}, "apiserver": set(), **OF_PODS},
}
ALONE_JOBS = {
    **dict.fromkeys(("node-exporter", "kubelet", "cadvisor"), HOST_LABELS | {"robot"}),
    **{"vmagent": STREAM, "log-shipper": STREAM | {"node"}, **OF_PODS},
}
# What this fleet has, and what it has once it has been at work for a while (see NEEDS).
THERE = {
    *("log shipper otelcol", "profile robot", "an action", "a service", "a claim", "an app with metrics of its own"),
    "a topic that has been known for 4 minutes",
}
RAMP = 300.0  # the longest look back that an answer waits for: `offset 3m`, and a minute of it


def test_every_target_is_up_and_labelled(fleet: Watched) -> None:
    def look() -> dict[str, str]:
        """Pool and instance of each -> what is wrong with it."""
        found = fleet.prometheus.targets()
        wrong = {
            f"{one['scrapePool']} {one['labels'].get('instance')}": one["lastError"] or one["health"]
            for one in found
            if one["health"] != "up"
        }
        missing = set(HUB_JOBS) - {one["scrapePool"] for one in found}
        return wrong | dict.fromkeys(missing, "not found")

    wait_until(look, lambda wrong: not wrong, 60, "all targets up", pause=2)
    targets = fleet.prometheus.targets()
    for one in targets:
        labels = set(one["labels"])
        wanted = HUB_JOBS[one["scrapePool"]] | ({"robot"} if one["labels"].get("robot") else set())
        assert labels == wanted | {"job", "instance"}, one["labels"]
        assert one["labels"].get("placement") in (None, "local", "remote"), one["labels"]
    by_job = {job: [one["labels"] for one in targets if one["scrapePool"] == job] for job in HUB_JOBS}
    assert [one["robot"] for one in by_job["ros-exporter"]] == [MEMBER]
    assert {one.get("robot", one["node"]) for one in by_job["node-exporter"]} == {EDGE, MEMBER}
    assert {one["node"] for one in by_job["log-shipper"]} == {EDGE, MEMBER}
    fleet.say(f"{len(targets)} targets of the hub's own cluster, all up")


def test_robot_that_stands_alone_sends_its_targets(fleet: Watched) -> None:
    def look() -> dict[str, Any]:
        found = fleet.prometheus.instant(f'up{{robot="{ALONE}"}}')
        wrong = {str(one["metric"]): one["value"][1] for one in found if one["value"][1] != "1"}
        missing = set(ALONE_JOBS) - {one["metric"]["job"] for one in found}
        return wrong | dict.fromkeys(missing, "not found")

    wait_until(look, lambda wrong: not wrong, 60, f"all targets of {ALONE} up", pause=2)
    found = [one["metric"] for one in fleet.prometheus.instant(f'up{{robot="{ALONE}"}}')]
    for labels in found:
        assert set(labels) == ALONE_JOBS[labels["job"]] | {"__name__", "job", "instance"}, labels
        assert labels["placement"] == "local", labels
    fleet.say(f"{len(found)} targets of {ALONE}, sent by vmagent, all up")


@pytest.mark.parametrize("robot", ROBOTS)
def test_series_of_apps_are_labelled(fleet: Watched, robot: str) -> None:
    """By the app's own exporter, by the ROS exporter and by the kubelet: the same words."""
    for expr in ("counter_lines_total", "container_memory_working_set_bytes{app=~'counter|temperature'}"):
        found = [one["metric"] for one in fleet.prometheus.instant(expr) if one["metric"].get("robot") == robot]
        assert found, f"no {expr} of {robot}"
        for labels in found:
            assert labels["namespace"] == f"robot-{robot}", labels
            assert labels["pod"].startswith(labels["app"] + "-"), labels
            assert labels["placement"] == "local", labels


def answer(fleet: Watched, query: Query) -> str:
    """`data`, `nothing`, or the server's refusal."""
    end = time.time()
    begin = end - 900
    try:
        if query.language == "promql":
            prometheus = fleet.prometheus
            got = prometheus.instant(query.expr) if query.instant else prometheus.over(query.expr, begin, end, 15)
        elif query.instant:
            got = fleet.loki.instant(query.expr)
        else:
            got = fleet.loki.over(query.expr, begin, end)
    except RefusedError as refusal:
        return f"refused: {refusal}"
    return "data" if got else "nothing"


def wants_data(query: Query) -> bool:
    """Whether this fleet, undisturbed, has what the query asks for."""
    return query.kind != "alert" and set(needs(query.expr)) <= THERE


def test_what_is_there_is_spelt_as_the_queries_spell_it() -> None:
    assert {*NEEDS.values(), *TEXT_NEEDS.values()} >= THERE


def test_every_query_is_accepted_and_has_an_answer(fleet: Watched) -> None:
    # the page of one robot asks for one
    queries = [query for query in all_queries() if not query.where.startswith("rosops-robot:")]
    for robot in ROBOTS:
        of_one = [query for query in all_queries(robot) if query.where.startswith("rosops-robot:")]
        assert of_one
        queries += [query._replace(where=f"{robot}: {query.where}") for query in of_one]
    left = {query.where: query for query in queries}
    seen: dict[str, str] = {}

    def look() -> dict[str, str]:
        for where, query in list(left.items()):
            seen[where] = answer(fleet, query)
            if seen[where] == "data" or (seen[where] == "nothing" and not wants_data(query)):
                del left[where]
        return {where: f"{seen[where]}: {query.expr}" for where, query in left.items()}

    try:
        wait_until(look, lambda without: not without, RAMP, "an answer to every query", pause=5)
    finally:
        wanted = [query for query in queries if wants_data(query)]
        got = sum(seen.get(query.where) == "data" for query in queries)
        refused = sum(word.startswith("refused") for word in seen.values())
        fleet.say(
            f"{len(queries)} queries ({sum(q.language == 'logql' for q in queries)} of them LogQL): {refused} refused, "
            f"{len(wanted)} have to have data, {got} have, {sum(query.where in left for query in wanted)} lack it"
        )
    assert len(queries) > 100, "that are not all of them"


def test_no_rule_fails(fleet: Watched) -> None:
    failed = fleet.prometheus.instant("prometheus_rule_evaluation_failures_total > 0")
    assert failed == []
    assert fleet.prometheus.instant(f"prometheus_rule_group_iterations_missed_total > {60 / INTERVAL}") == []
