# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The status as one HTML file: whole, escaped, and new only when it says something new."""

from __future__ import annotations

import base64
import copy
import hashlib
import re
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.page import UNFOLDED, status_page
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import status_rows
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._report import a_robot
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._report.html_check import Page

MADE = "2026-11-21T09:07:52Z"
HOSTILE = "<script>alert(1)</script>\"'><img src=http://example.org/x onerror=alert(1)>&amp;\x00\u202e"

STATUS: dict[str, Any] = {
    "problems": [],
    "hosts": [
        {
            "name": "edge1",
            "group": "edge",
            "address": "10.0.0.11",
            "role": "server",
            "cluster": "edge",
            "reachable": True,
        },
        {"name": "robot1", "group": "robots", "role": "agent", "cluster": "edge", "reachable": True},
        {"name": "robot2", "group": "robots", "cluster": "edge", "reachable": False, "reason": "timed out"},
    ],
    "nodes": [
        {"name": "robot1", "ready": True, "reason": "", "version": "v1", "placement": "local", "robot": "robot1"},
        {"name": "robot2", "ready": False, "reason": "NodeStatusUnknown", "placement": "local", "robot": "robot2"},
    ],
    "placement": [{"node": "robot1", "placement": "local", "runs": ["robot1/sensor"]}],
    "masters": [{"name": "ros-master", "robot": "robot1", "ready": 1, "wanted": 1, "nodes": ["robot1"], "note": ""}],
    "apps": [
        {
            "name": "sensor",
            "robot": "robot1",
            "ready": 1,
            "wanted": 1,
            "nodes": ["robot1"],
            "images": ["a:1"],
            "note": "",
        }
    ],
    "ros_nodes": [{"robot": "robot1", "name": "/sensor", "reachable": True, "services": ["/a", "/b"]}],
    "topics": [
        {"robot": "robot1", "name": "/temperature", "type": "a/B", "rate": 499.83, "note": ""},
        {"robot": "robot1", "name": "/slow", "type": "a/B", "rate": 0.5, "note": ""},
        {"robot": "robot1", "name": "/never", "type": "a/B", "rate": None, "note": "no publisher answers"},
    ],
    "claims": [
        {"robot": "robot1", "name": "logs-pvc", "bound": True, "phase": "Bound", "size": "1Gi", "used_bytes": 2**29}
    ],
    "outcomes": [
        {"host": "robot1", "outcome": "updated", "playbook": "update.yml", "started": MADE, "changed": 3, "note": ""}
    ],
    "steps": [
        {
            "robot": "robot1",
            "id": "0123456789ab",
            "name": "sensor",
            "handoff": "overlap",
            "outcome": "updated",
            "from": ["a:1 (1)"],
            "to": ["a:2 (2)"],
            "seconds": 8.5,
            "busy_wait": 0.0,
            "phases": {"gate": 1.0, "apply": 7.5},
            "note": "",
        }
    ],
}


def page(status: dict[str, Any] | None = None, **more: str) -> Page:
    return Page(status_page(STATUS if status is None else status, MADE, **more))


def section(text: str, key: str) -> str:
    found = re.search(f'<section id="{key}">.*?</section>', text, re.DOTALL)
    assert found, key
    return found[0]


def hostile(value: Any) -> Any:
    if isinstance(value, str):
        return HOSTILE
    if isinstance(value, list):
        return [hostile(item) for item in value]
    if isinstance(value, dict):
        return {key: hostile(item) for key, item in value.items()}
    return value


def test_the_page_is_whole_and_needs_nothing_else() -> None:
    found = page()
    assert found.problems == []
    assert not {"script", "img", "iframe", "object"} & {*found.tags}
    assert found.attributes[0] == ("html", {"lang": "en"})
    assert ("meta", {"name": "viewport", "content": "width=device-width, initial-scale=1"}) in found.attributes
    assert found.texts.count("Fleet status") == 2  # title and heading
    assert page(name="my <fleet>").texts.count("my <fleet>: fleet status") == 2


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
    status = {key: [{**hostile(row), "name": HOSTILE} for row in rows] for key, rows in STATUS.items()}
    status["steps"][0]["phases"] = {HOSTILE: 1.0}
    status["nodes"][0]["labels"] = {HOSTILE: HOSTILE}
    status["problems"] = [{"where": HOSTILE, "what": HOSTILE}]
    text = status_page(status, HOSTILE, limit=HOSTILE)
    found = Page(text)
    assert found.problems == []
    assert not {"script", "img"} & {*found.tags}
    assert "<script" not in text and "\x00" not in text
    assert any("<script>alert(1)</script>" in said for said in found.texts)


def test_who_hears_whom_is_a_table_and_what_is_not_connected_is_seen() -> None:
    status = {"links": a_robot.rows(broken=(("/merger", "/amcl"), ("/ekf", "/docking")))}
    text = section(status_page(status, MADE), "links")
    [scan, *_more] = re.findall('<tr role="row" class="warn">(.*?)</tr>', text, re.DOTALL)
    assert re.findall("<span>(.*?)</span>", scan) == [
        "robot1", "/odometry/filtered", "no", "/ekf", "/amcl, /move_base, /slam, /docking", "/ekf and /docking",
    ]  # fmt: skip
    assert ("not connected" in text, text.count('class="warn"')) == (True, 2)
    assert "not connected" not in section(status_page({"links": a_robot.rows()}, MADE), "links")


def test_an_empty_fleet() -> None:
    found = page(status_rows({}, {}, {}))
    assert found.problems == []
    assert {"Nothing was found.", "No update has been reported yet.", "None."} <= {*found.texts}
    assert Page(status_page({}, MADE)).problems == []


def test_a_robot_that_is_off() -> None:
    text = status_page(STATUS, MADE)
    wants = section(text, "problems")
    assert "<strong>host robot2</strong>: offline: timed out" in wants
    assert "NodeStatusUnknown" not in wants  # told with its host
    assert '<tr role="row" class="warn">' in section(text, "nodes")
    assert 'class="bad"' not in text


def test_what_is_wrong_comes_first() -> None:
    status = copy.deepcopy(STATUS)
    status["apps"][0].update(ready=0, note="CrashLoopBackOff")
    status["outcomes"][0].update(outcome="rolled-back", note="half the rate")
    status["problems"] = [{"where": "cluster edge", "what": "does not answer"}]
    items = re.findall(
        '<li class="(bad|warn)">.*?<strong>(.*?)</strong>', section(status_page(status, MADE), "problems")
    )
    assert items == [
        ("bad", "cluster edge"),
        ("bad", "app sensor of robot1"),
        ("bad", "last update.yml on robot1"),
        ("warn", "host robot2"),
    ]


def test_a_large_fleets_tables_are_folded() -> None:
    status = copy.deepcopy(STATUS)
    status["topics"] = [{**STATUS["topics"][0], "name": f"/t{number}", "rate": number + 1.0} for number in range(500)]
    status["hosts"] = [{**STATUS["hosts"][1], "name": f"robot{number}"} for number in range(100)]
    text = status_page(status, MADE)
    assert "<details><summary><h2>Topics</h2>" in text and UNFOLDED < 500
    assert "<details><summary><h2>By host</h2>" in text
    assert "<details open><summary><h2>Apps</h2>" in text


def test_a_new_time_alone_makes_no_new_page() -> None:
    first = status_page(STATUS, MADE)
    assert status_page(STATUS, "2026-11-21T10:00:00Z", first) == first
    changed = copy.deepcopy(STATUS)
    changed["apps"][0]["ready"] = 0
    second = status_page(changed, "2026-11-21T10:00:00Z", first)
    assert second != first and "2026-11-21 10:00:00 UTC" in second


def test_a_rate_that_trembles_makes_no_new_page() -> None:
    trembling = copy.deepcopy(STATUS)
    trembling["topics"][0]["rate"] = 499.9
    first = status_page(STATUS, MADE)
    assert status_page(trembling, "2026-11-21T10:00:00Z", first) == first


@pytest.mark.parametrize("previous", ["", "something else", '<time id="made">'])
def test_a_page_of_another_make_is_replaced(previous: str) -> None:
    assert status_page(STATUS, MADE, previous).startswith("<!DOCTYPE html>")


def test_a_limited_run_says_so() -> None:
    assert "<code>robot1:&amp;x</code>" in status_page(STATUS, MADE, limit="robot1:&x")
