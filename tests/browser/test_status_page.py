# SPDX-License-Identifier: GPL-3.0-or-later
"""The status page in a browser: it renders, quietly, without fetching anything, and fits a phone.

`fleet.yml` are rows of the lab's fleet: hosts to claims from one run of status.yml, outcomes and steps from the report
of one of update.yml. What robot2 shows when it is off was put in by hand. Screenshots: tests/output/browser/.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import chromium
import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.keys import read
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.page import status_page
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import Status
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._report import a_robot
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._report.html_check import rewritten

HERE = Path(__file__).resolve().parent
SHOTS = HERE.parent / "output" / "browser"
MADE = "2026-11-21T09:07:52Z"
PHONE, DESK = 360, 1280
LOCAL, REMOTE = ("add-two-ints", "temperature"), ("add-two-ints-client", "temperature-stats")
UNBROKEN = "x" * 300  # a name that offers no place to break a line at

WIDER_THAN_THE_WINDOW = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
# Elements that stick out, but for what may be scrolled within itself and what is only there for screen readers.
STICKING_OUT = """
[...document.querySelectorAll('body *')].filter(one => {
  const box = one.getBoundingClientRect();
  return box.width > 0 && box.right > document.documentElement.clientWidth + 1
    && !one.closest('.wide') && !one.closest('.skip, caption, thead');
}).map(one => one.outerHTML.slice(0, 80))
"""
# The contrast of all texts with what is behind them, as WCAG 2 defines it.
FAINT = """
(() => {
  const light = text => {
    const [r, g, b] = text.match(/[0-9.]+/g).map(Number).map(v => v / 255)
      .map(v => v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const behind = one => {
    for (; one; one = one.parentElement) {
      const colour = getComputedStyle(one).backgroundColor;
      if (!/, 0\\)$/.test(colour)) return colour;
    }
    return 'rgb(255, 255, 255)';
  };
  return [...document.querySelectorAll('body *')].filter(one =>
    [...one.childNodes].some(node => node.nodeType === 3 && node.data.trim())
  ).map(one => {
    const style = getComputedStyle(one);
    const [a, b] = [light(style.color), light(behind(one))].sort((x, y) => y - x);
    return [(a + 0.05) / (b + 0.05), one.outerHTML.slice(0, 80)];
  }).filter(([ratio]) => ratio < 4.5);
})()
"""


# The graph is a made-up robot's, with one connection that is missing.
LINKS = a_robot.rows(broken=(("/merger", "/amcl"),))
ROWS = read(Status, yaml.safe_load((HERE / "fleet.yml").read_text("utf-8")))
APPS = tuple(
    replace(row, name=name, images=("lab/apps:1.0",)) for row in ROWS.masters for name in sorted(LOCAL + REMOTE)
)
AT_THE_EDGE = {"placement": "remote", "nodes": ("edge1",), "ready": 1, "note": ""}
RECORDED = replace(
    ROWS,
    links=tuple(LINKS),
    helpers=tuple(replace(row, name="ros-keeper") for row in ROWS.masters),
    apps=tuple(replace(row, **AT_THE_EDGE) if row.name in REMOTE else row for row in APPS),
)
# What somebody would write who wants the page to run or to burst.
HOSTILE = f"<script>console.log('run')</script><img src=http://example.org/x.png onerror=alert(1)>\"'{UNBROKEN}"


def large(robots: int = 60, topics: int = 12) -> Status:
    """Many robots with many topics, from one a minute to a thousand a second; robot1 has half the rates."""
    names = [f"robot{number}" for number in range(robots)]
    factors = dict(zip(names, [1.0, 0.5, *[0.98, 1.02] * robots]))
    host, topic = RECORDED.hosts[1], RECORDED.topics[0]
    return replace(
        RECORDED,
        hosts=tuple(replace(host, name=name, reachable=number % 7 > 0) for number, name in enumerate(names)),
        apps=tuple(replace(row, robot=name, nodes=(name,)) for name in names for row in RECORDED.apps[:5]),
        topics=tuple(
            replace(topic, robot=name, name=f"/camera/{number}/image_raw/compressed", rate=0.017 * 2.7**number * factor)
            for name, factor in factors.items()
            for number in range(topics)
        ),
        links=tuple(replace(row, robot=name) for name in names for row in RECORDED.links),
        steps=tuple(replace(row, robot=name) for name in names for row in RECORDED.steps),
    )


MODELS = {"fleet": RECORDED, "empty": Status(), "hostile": rewritten(RECORDED, HOSTILE), "large": large()}


def written(name: str) -> Path:
    SHOTS.mkdir(parents=True, exist_ok=True)
    file = SHOTS / f"{name}.html"
    file.write_text(status_page(MODELS[name], MADE), encoding="utf-8")
    return file


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [PHONE, DESK])
@pytest.mark.parametrize("name", list(MODELS))
def test_the_page(browser: chromium.Chromium, name: str, width: int, dark: bool) -> None:
    file = written(name)
    browser.open(file, width, dark=dark)
    browser.screenshot(SHOTS / f"{name}-{width}{'-dark' if dark else ''}.png")
    assert browser.console == []
    assert [url for url in browser.requests if not url.startswith("data:")] == [file.as_uri()]
    assert browser.evaluate(WIDER_THAN_THE_WINDOW) <= 0
    assert browser.evaluate(STICKING_OUT) == []
    assert browser.evaluate(FAINT) == []
    assert browser.evaluate("document.title") == "Fleet status"


def test_what_is_seen_of_the_fleet(browser: chromium.Chromium) -> None:
    browser.open(written("fleet"), DESK)
    text = browser.evaluate("document.body.innerText")
    for words in ("host robot2: offline", "add-two-ints-client", "498 Hz", "deferred-offline", "/temperature_5790328c"):
        assert words in text
    browser.screenshot(SHOTS / "fleet-status.png", above="#hosts")


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_a_connection_that_is_missing_is_seen(browser: chromium.Chromium, dark: bool) -> None:
    browser.open(written("fleet"), DESK, dark=dark)
    rows = "[...document.querySelectorAll('#links tbody tr{}')]"
    assert browser.evaluate(rows.format("") + ".length") == len(LINKS)
    [broken] = browser.evaluate(rows.format(".warn") + ".map(one => one.innerText)")
    assert "/scan" in broken and "/merger and /amcl" in broken
    edges = rows + ".map(one => getComputedStyle(one).borderLeftColor)"
    [edge] = browser.evaluate(edges.format(".warn"))
    assert edge == ("rgb(240, 176, 74)" if dark else "rgb(138, 82, 0)")


def test_tables_stay_tables_on_a_phone(browser: chromium.Chromium) -> None:
    """For a screen reader, though each row is drawn as a card."""
    page = written("fleet")
    browser.open(page, PHONE)
    nodes = browser.ask("Accessibility.getFullAXTree")["nodes"]
    roles = [node["role"]["value"] for node in nodes if not node["ignored"]]
    assert roles.count("table") == page.read_text("utf-8").count("<table") > 10
    assert roles.count("columnheader") > 60 and roles.count("rowheader") > 30 and roles.count("cell") > 100
    assert browser.evaluate("getComputedStyle(document.querySelector('tbody tr')).display") == "flex"


def test_the_checks_of_this_file_find_what_they_look_for(browser: chromium.Chromium, tmp_path: Path) -> None:
    file = tmp_path / "bad.html"
    file.write_text(
        '<!DOCTYPE html><title>bad</title><img src="http://127.0.0.1:9/x.png"><script>console.error("said"); fail()'
        '</script><p style="width:2000px;color:#ccc;background:#fff">too wide and too faint</p>'
    )
    browser.open(file, DESK)
    assert "http://127.0.0.1:9/x.png" in browser.requests
    assert any("said" in line for line in browser.console) and any("exception" in line for line in browser.console)
    assert browser.evaluate(WIDER_THAN_THE_WINDOW) > 0
    assert len(browser.evaluate(STICKING_OUT)) == 1
    assert len(browser.evaluate(FAINT)) == 1
