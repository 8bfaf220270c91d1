# SPDX-License-Identifier: GPL-3.0-or-later
"""The status as one HTML file: whole, escaped, and new only when it says something new."""

from __future__ import annotations

import base64
import hashlib
import re
from dataclasses import replace

from ansible_collections.rosops.fleet.plugins.plugin_utils._report.page import UNFOLDED, status_page
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import (
    Host,
    LastRun,
    Status,
    Step,
    Topic,
    Trouble,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._report import a_robot
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._report.a_fleet import SOURCES, fleet_status
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._report.html_check import Page, rewritten

MADE = "2026-11-21T09:07:52Z"
HOSTILE = "<script>alert(1)</script>\"'><img src=http://example.org/x onerror=alert(1)>&amp;\x00\u202e"

STATUS = replace(
    fleet_status(SOURCES),
    outcomes=(LastRun("robot1", "updated", "update.yml", MADE, 3),),
    steps=(Step("robot1", "sensor", "overlap", "updated", ("a:1",), ("a:2",), 8.5),),
)
DOWN = replace(STATUS.apps[1], ready=0, note="CrashLoopBackOff")


def page(status: Status = STATUS, **more: str) -> Page:
    return Page(status_page(status, MADE, **more))


def section(text: str, key: str) -> str:
    found = re.search(f'<section id="{key}">.*?</section>', text, re.DOTALL)
    assert found, key
    return found[0]


def test_the_page_is_whole_and_needs_nothing_else() -> None:
    found = page()
    assert found.problems == []
    assert not {"script", "img", "iframe", "object"} & {*found.tags}
    assert found.attributes[0] == ("html", {"lang": "en"})
    assert ("meta", {"name": "viewport", "content": "width=device-width, initial-scale=1"}) in found.attributes
    assert found.texts.count("Fleet status") == 2  # title and heading
    assert page(name="my <fleet>").texts.count("my <fleet>: fleet status") == 2
    assert "<code>robot1:&amp;x</code>" in status_page(STATUS, MADE, limit="robot1:&x")


def test_the_check_of_this_test_finds_what_is_wrong() -> None:
    found = Page('<p id="a"><p id="a"></p><a href="#b"></a><img src="x"><a href="http://x" onclick="y"></a></div>')
    assert len(found.problems) == 6


def test_the_policy_lets_the_pages_own_style_through_and_nothing_else() -> None:
    text = status_page(STATUS, MADE)
    style = re.search("<style>(.*?)</style>", text, re.DOTALL)
    assert style
    digest = base64.b64encode(hashlib.sha256(style[1].encode()).digest()).decode()
    assert f"default-src 'none'; style-src 'sha256-{digest}'" in text
    assert "url(" not in style[1] and "@import" not in style[1]
    assert "'; img-src data:; base-uri 'none'; form-action 'none'\"" in text
    assert "style=" not in text


def test_every_cell_belongs_to_a_header() -> None:
    found = page()
    tables, rows, heads = (found.tags.count(tag) for tag in ("table", "caption", "thead"))
    assert tables == rows == heads == 11
    scopes = [about.get("scope") for tag, about in found.attributes if tag == "th"]
    assert set(scopes) == {"col", "row"}
    assert all(about["data-label"] for tag, about in found.attributes if tag == "td")


def test_what_comes_from_elsewhere_is_text() -> None:
    labelled = replace(STATUS.nodes[0], labels={"zone": "a"})
    given = replace(STATUS, nodes=(labelled,), problems=(Trouble("a", "b"),))
    text = status_page(rewritten(given, HOSTILE), HOSTILE, limit=HOSTILE)
    found = Page(text)
    assert found.problems == []
    assert not {"script", "img"} & {*found.tags}
    assert "<script" not in text and "\x00" not in text
    assert any("<script>alert(1)</script>" in said for said in found.texts)


def test_who_hears_whom_is_a_table_and_what_is_not_connected_is_seen() -> None:
    status = Status(links=tuple(a_robot.rows(broken=(("/merger", "/amcl"), ("/ekf", "/docking")))))
    text = section(status_page(status, MADE), "links")
    [scan, *_more] = re.findall('<tr role="row" class="warn">(.*?)</tr>', text, re.DOTALL)
    assert re.findall("<span>(.*?)</span>", scan) == [
        "robot1", "/odometry/filtered", "no", "/ekf", "/amcl, /move_base, /slam, /docking", "/ekf and /docking",
    ]  # fmt: skip
    assert ("not connected" in text, text.count('class="warn"')) == (True, 2)
    assert "not connected" not in section(status_page(Status(links=tuple(a_robot.rows())), MADE), "links")


def test_an_empty_fleet() -> None:
    found = page(Status())
    assert found.problems == []
    assert {"Nothing was found.", "No update has been reported yet.", "None."} <= {*found.texts}


def test_what_is_wrong_comes_first_and_a_robot_that_is_off_last() -> None:
    status = replace(
        STATUS,
        nodes=(*STATUS.nodes, replace(STATUS.nodes[1], name="robot2", reason="NodeStatusUnknown")),
        outcomes=(LastRun("robot1", "rolled-back", "update.yml", note="half the rate"),),
        problems=(Trouble("cluster edge", "does not answer"),),
    )
    text = status_page(status, MADE)
    wants = section(text, "problems")
    assert re.findall('<li class="(bad|warn)">.*?<strong>(.*?)</strong>', wants) == [
        ("bad", "node robot1"),
        ("bad", "cluster edge"),
        ("bad", "app stats of robot1"),
        ("bad", "last update.yml on robot1"),
        ("warn", "host robot2"),
    ]
    assert "<strong>host robot2</strong>: offline: timed out" in wants
    assert "NodeStatusUnknown" not in wants  # told with its host
    assert re.findall('<tr role="row" class="(.*?)">', section(text, "nodes")) == ["bad", "warn"]


def test_a_large_fleets_tables_are_folded() -> None:
    topics = tuple(Topic("robot1", f"/t{number}", rate=number + 1.0) for number in range(500))
    hosts = tuple(Host(f"robot{number}", "robots") for number in range(100))
    text = status_page(replace(STATUS, topics=topics, hosts=hosts), MADE)
    assert "<details><summary><h2>Topics</h2>" in text and UNFOLDED < 500
    assert "<details><summary><h2>By host</h2>" in text
    assert "<details open><summary><h2>Apps</h2>" in text


def test_a_new_time_or_a_rate_that_trembles_makes_no_new_page() -> None:
    trembles = (STATUS.topics[0], replace(STATUS.topics[1], rate=499.9))
    first = status_page(STATUS, MADE)
    for status in (STATUS, replace(STATUS, topics=trembles)):
        assert status_page(status, "2026-11-21T10:00:00Z", first) == first
    assert status_page(STATUS, MADE, '<time id="made">').startswith("<!DOCTYPE html>")  # a page of another make
    second = status_page(replace(STATUS, apps=(DOWN,)), "2026-11-21T10:00:00Z", first)
    assert second != first and "2026-11-21 10:00:00 UTC" in second
