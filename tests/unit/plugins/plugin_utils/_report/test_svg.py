# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Axes, bars and dots, and what becomes of text that is none."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.svg import (
    Axis,
    Bar,
    axis_of,
    decade_axis,
    escaped,
    linear_axis,
    plot,
    round_up,
    shortened,
)

SVG = "{http://www.w3.org/2000/svg}"


def drawn(*rows: Bar, axis: Axis | None = None, dots: bool = False) -> ET.Element:
    text = plot("Rates of <topics>", 'a "description"', rows, axis or linear_axis(10), dots)
    return ET.fromstring(text)  # noqa: S314 - our own text


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("<script>alert('x')</script>", "&lt;script&gt;alert(&#x27;x&#x27;)&lt;/script&gt;"),
        ('" onload="x', "&quot; onload=&quot;x"),
        ("a&amp;b", "a&amp;amp;b"),
        ("a\x00b\x1b[31m\ud800", "a\ufffdb\ufffd[31m\ufffd"),
        ("tab\tline\nüñ", "tab\tline\nüñ"),
        (3, "3"),
    ],
)
def test_escaped(text: object, expected: str) -> None:
    assert escaped(text) == expected
    escaped(text).encode()  # what is written to a file


@pytest.mark.parametrize(("value", "top"), [(-1, 1), (0, 1), (0.02, 0.02), (3, 4), (4.1, 8), (8.5, 10), (499, 800)])
def test_a_round_end_of_the_axis(value: float, top: float) -> None:
    assert round_up(value) == top


def test_a_linear_axis() -> None:
    axis = linear_axis(150, " s")
    assert list(axis.ticks) == [(0, "0 s"), (25, "50 s"), (50, "100 s"), (75, "150 s"), (100, "200 s")]
    assert axis.place(50) == 25


def test_an_axis_in_decades() -> None:
    axis = decade_axis(0.5, 500, " Hz")
    assert [words for _place, words in axis.ticks] == ["0.1 Hz", "1 Hz", "10 Hz", "100 Hz", "1000 Hz"]
    assert [round(axis.place(value)) for value in (0.1, 10, 1000)] == [0, 50, 100]
    assert (axis.place(0), axis.place(0.0001), axis.place(10**6)) == (0, 0, 100)


@pytest.mark.parametrize(
    ("values", "decades"), [([], False), ([0], False), ([5], False), ([10, 200], False), ([0, 1, 500], True)]
)
def test_small_values_are_seen_beside_large_ones(values: list[float], decades: bool) -> None:
    assert axis_of(values)[1] is decades


def test_one_value_has_an_axis_in_decades_too() -> None:
    assert len(decade_axis(10, 10).ticks) == 2


def test_bars_lie_one_after_the_other() -> None:
    row = Bar("robot1", [("c1", 2.0, "gate"), ("c2", 0.0, "wait"), ("c3", 3.0, "apply")], "5 s")
    rects = [item.attrib for item in drawn(row).iter(f"{SVG}rect") if item.attrib["class"] != "track"]
    assert [(item["class"], item["x"], item["width"]) for item in rects] == [
        ("c1", "0.00%", "20.00%"),
        ("c3", "20.00%", "30.00%"),
    ]


def test_dots_stay_inside() -> None:
    axis = decade_axis(1, 100)
    rows = [Bar("a", [("c1", value, "")], "") for value in (1.0, 10.0, 100.0)]
    circles = [item.attrib["cx"] for item in drawn(*rows, axis=axis, dots=True).iter(f"{SVG}circle")]
    assert circles == ["1.50%", "50.00%", "98.50%"]


def test_a_spread_around_a_dot() -> None:
    found = drawn(Bar("a", [("c1", 10.0, "")], "", (1.0, 100.0)), axis=decade_axis(0.1, 1000), dots=True)
    (spread,) = [item.attrib for item in found.iter(f"{SVG}rect") if item.attrib["class"] == "spread"]
    assert (spread["x"], spread["width"]) == ("25.00%", "50.00%")


def test_a_plot_says_what_it_is() -> None:
    found = drawn(Bar("a", [], "1"))
    assert found.attrib["role"] == "img"
    names = found.attrib["aria-labelledby"].split()
    said = {item.attrib["id"]: item.text for item in found if "id" in item.attrib}
    assert [said[name] for name in names] == ["Rates of <topics>", 'a "description"']


def test_no_row_is_a_plot_too() -> None:
    assert drawn().attrib["height"] == "24"


def test_a_long_label_is_cut_in_the_middle_and_said_in_full() -> None:
    label = "robot1 /a/very/long/name/of/a/topic/temperature"
    assert len(shortened(label)) == 32
    assert shortened(label).startswith("robot1 /a/") and shortened(label).endswith("temperature")
    assert f"{label}: 5 Hz" in [item.text for item in drawn(Bar(label, [], "5 Hz")).iter(f"{SVG}title")]


def test_what_a_label_says_is_text() -> None:
    hostile = Bar("<script>x</script>", [('c1" onload="x', 1.0, "<b>")], "</svg>")
    text = plot("t", "d", [hostile], linear_axis(1))
    assert "<script" not in text and "<b>" not in text and 'onload="' not in text and text.count("</svg>") == 1
