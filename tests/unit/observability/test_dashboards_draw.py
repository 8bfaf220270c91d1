# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Dashboards drawn from answers: each panel at its place, with the figures of the answers and no others.

The answers are made up here; the scenario observability records real ones.
"""

from __future__ import annotations

import http.server
import json
import threading
import urllib.parse
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from dashboards.answers import Answers, key, read, record, server
from dashboards.build import dashboards
from dashboards.draw import CAPTION, draw
from dashboards.queries import Query, of_page
from dashboards.values import name_of, number, rows_of

BEGIN, END = 1_760_000_000.0, 1_760_000_900.0
NAMES = sorted(dashboards())


def series(query: Query, count: int = 2, value: float = 1.0) -> list[dict[str, Any]]:
    """Answers such as a server gives: labels that the query's own words ask for, values over the time."""
    labels = {"good": "2", "total": "3", "topic": "/scan", "node": "/amcl", "app": "sensor", "alertname": "RosNodeDown"}
    found = []
    for index in range(1 if query.instant and "group_left" in query.expr else count):
        metric = {**labels, "robot": f"robot{index + 1}"}
        times = [BEGIN + 60 * step for step in range(16)]
        if (
            query.language == "logql"
            and not query.instant
            and "count_over" not in query.expr
            and "rate(" not in query.expr
        ):
            found.append({"stream": metric, "values": [[str(int(at * 1e9)), f"line <{index}> & more"] for at in times]})
        elif query.instant:
            found.append({"metric": metric, "value": [END, str(value + index)]})
        else:
            found.append({"metric": metric, "values": [[at, str(value * (index + at % 7))] for at in times]})
    return found


def answered(name: str, **more: Any) -> Answers:
    return record(dashboards()[name], lambda query, *_times: series(query, **more), BEGIN, END)


def texts(svg: str) -> list[str]:
    """All that is read in it; it has to be a document for that."""
    return [one.text or "" for one in ET.fromstring(svg).iter("{http://www.w3.org/2000/svg}text")]  # noqa: S314 - ours


@pytest.mark.parametrize("name", NAMES)
def test_every_panel_of_every_dashboard_is_drawn(name: str) -> None:
    page = dashboards()[name]
    said = texts(draw(page, answered(name)))
    assert "no data" not in said
    for panel in page["panels"]:
        assert any(panel["title"].startswith(text.rstrip("…")) and len(text) > 3 for text in said), panel["title"]
    assert said[-1].endswith(f"2025-10-09 08:53:20 to 2025-10-09 09:08:20 UTC. {CAPTION}.")


@pytest.mark.parametrize("name", NAMES)
def test_what_has_no_answer_says_so(name: str) -> None:
    page = dashboards()[name]
    said = texts(draw(page, Answers(page["uid"], BEGIN, END, ".*")))
    assert said.count("no data") == len(page["panels"])


@pytest.mark.parametrize(("name", "robot"), [("fleet", ".*"), ("robot", "robot1")])
def test_nothing_stands_outside_of_the_picture(name: str, robot: str) -> None:
    page = dashboards()[name]
    found = record(page, lambda query, *_times: series(query, count=40, value=12345.678), BEGIN, END, robot)
    root = ET.fromstring(draw(page, found))  # noqa: S314 - ours
    width, height = (float(one) for one in root.attrib["viewBox"].split()[2:])
    for one in root.iter("{http://www.w3.org/2000/svg}rect"):
        if "x" in one.attrib:
            x, y, w, h = (float(one.attrib[word]) for word in ("x", "y", "width", "height"))
            assert x >= 0 and x + w <= width + 0.1 and y >= 0 and y + h <= height, one.attrib
    for one in root.iter("{http://www.w3.org/2000/svg}text"):
        assert 0 <= float(one.attrib["x"]) <= width and 0 <= float(one.attrib["y"]) <= height


def test_a_share_says_of_how_many_on_the_colour_of_its_step() -> None:
    page = dashboards()["fleet"]
    [part, whole] = [draw(page, answered("fleet", count=1, value=value)) for value in (2 / 3, 1.0)]
    assert "2 of 3" in texts(part)
    assert part.count("#b25e00") > 0 and whole.count("#b25e00") == 0  # orange until it is all of them


def test_a_table_has_a_row_of_each_robot_with_all_its_columns() -> None:
    page = dashboards()["fleet"]
    [panel] = [panel for panel in page["panels"] if panel["title"] == "Robots"]
    answers = [
        ("A", [{"metric": {"robot": robot}, "value": [END, up]} for robot, up in (("robot2", "0"), ("robot1", "1"))]),
        ("D", [{"metric": {"robot": "robot1", "__name__": "x"}, "value": [END, "498.3"]}]),
    ]
    headings, cells = rows_of(panel, answers)
    assert [dict(zip(headings, line))["Messages/s"] for line in cells] == ["498 c/s", ""]
    assert [line[:2] for line in cells] == [["robot1", "yes"], ["robot2", "no"]]


def test_a_gap_in_the_answer_is_a_gap_in_the_band() -> None:
    page = dashboards()["robot"]
    line = [[BEGIN + 60 * step, "1"] for step in (*range(5), *range(10, 15))]

    def ask(query: Query, *_times: float) -> list[dict[str, Any]]:
        return (
            [{"metric": {"node": "/amcl"}, "values": line}] if query.expr.startswith("max by (node) (ros_node") else []
        )

    root = ET.fromstring(draw(page, record(page, ask, BEGIN, END, "robot1")))  # noqa: S314 - ours
    assert [one.text for one in root.iter("{http://www.w3.org/2000/svg}title")] == ["/amcl: yes"] * 2


@pytest.mark.parametrize(
    ("value", "unit", "said"),
    [
        (float("nan"), "cps", "-"),
        (0.5, "percentunit", "50 %"),
        (1234.0, "none", "1234"),
        (3.2e9, "bytes", "3.2 GB"),
        (1500.0, "Bps", "1.5 kB/s"),
        (2000.0, "short", "2 k"),
        (0.0123, "s", "0.0123 s"),
        (28562.0, "s", "7.93 hours"),
    ],
)
def test_numbers_have_their_units(value: float, unit: str, said: str) -> None:
    assert number(value, unit) == said


def test_names_are_those_of_the_legend() -> None:
    one = {"metric": {"__name__": "up", "robot": "robot1", "job": "x"}}
    assert name_of(one, "{{robot}} {{gone}}!") == "robot1 !"
    assert name_of(one, "__auto") == "job=x, robot=robot1"
    assert name_of({"metric": {"__name__": "up"}}, "") == "up"


def test_the_answers_come_back_from_their_file(tmp_path: Path) -> None:
    found = answered("updates")
    (tmp_path / "a.json").write_text(found.text(), "utf-8")
    assert read(tmp_path / "a.json") == found


@pytest.fixture
def asked() -> Iterator[tuple[str, list[tuple[str, dict[str, str]]]]]:
    """A server that notes what it is asked, and refuses what has to do with updates."""
    seen: list[tuple[str, dict[str, str]]] = []

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            path, _, query = self.path.partition("?")
            seen.append((path, dict(urllib.parse.parse_qsl(query))))
            refused = "robot_update" in seen[-1][1]["query"]
            self.send_response(422 if refused else 200)
            self.end_headers()
            self.wfile.write(json.dumps({"data": {"result": []}}).encode())

        def log_message(self, *_args: Any) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as made:
        thread = threading.Thread(target=made.serve_forever, args=(0.01,))
        thread.start()
        yield f"http://127.0.0.1:{made.server_port}", seen
        made.shutdown()
        thread.join()


def test_the_servers_are_asked_as_grafana_asks_them(asked: tuple[str, list[tuple[str, dict[str, str]]]]) -> None:
    url, seen = asked
    page = dashboards()["robot"]
    found = record(page, server(url, url), BEGIN, END, "robot1")
    wanted = [query for query in of_page(page, "robot1") if query.kind == "panel"]
    assert len(seen) == len(wanted)
    assert {path for path, _query in seen} == {"/api/v1/query", "/api/v1/query_range", "/loki/api/v1/query_range"}
    assert all(("time" in query) != ("step" in query) for _path, query in seen)
    assert found.refused and all("422" in why for why in found.refused.values())
    assert len(found.results) + len(found.refused) == len({key(query) for query in wanted})
