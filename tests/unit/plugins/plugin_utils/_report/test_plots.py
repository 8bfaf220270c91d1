# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Axes, bars and dots of the status page; as they stand in the page: test_page."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.plots import (
    Part,
    axis_of,
    decade_axis,
    linear_axis,
    plots,
    rate_words,
    round_up,
)


def topic(rate: float, robot: str = "r", name: str = "/t") -> dict[str, Any]:
    return {"robot": robot, "name": name, "rate": rate}


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


def test_what_is_beyond_the_axis_lies_at_its_end() -> None:
    axis = decade_axis(0.5, 500, " Hz")
    assert [axis.part("c1", low, high).begin for low, high in ((0, 0), (0.0001, 1), (10**6, 10**7))] == [0, 0, 100]
    assert axis.part("c1", 0, 10**7) == Part("c1", 0, 100)


@pytest.mark.parametrize(
    ("values", "decades"), [([], False), ([0], False), ([5], False), ([10, 200], False), ([0, 1, 500], True)]
)
def test_small_values_are_seen_beside_large_ones(values: list[float], decades: bool) -> None:
    assert axis_of(values, "").decades is decades


def test_one_value_has_an_axis_in_decades_too() -> None:
    assert len(decade_axis(10, 10, "").ticks) == 2


def test_nothing_to_draw() -> None:
    assert plots({}) == []
    nothing = {"topics": [{"rate": None}], "steps": [{"phases": {}}], "claims": [{"size": "", "used_bytes": 1}]}
    assert plots(nothing) == []


def test_a_topics_rate_is_a_bar() -> None:
    (plot,) = plots({"topics": [topic(10.0), topic(40.0, name="/u")]})
    assert plot.caption == "Messages per second."
    assert [(one.label, one.value, one.parts, one.dot) for one in plot.bars] == [
        ("r /u", "40.0 Hz", [Part("c1", 0, 100)], None),
        ("r /t", "10.0 Hz", [Part("c1", 0, 25)], None),
    ]


def test_in_decades_a_rate_is_a_dot() -> None:
    (plot,) = plots({"topics": [topic(1.0), topic(100.0, name="/u"), topic(0.0, name="/none")]})
    assert "a power of ten" in plot.caption
    assert [(one.value, list(one.parts), one.dot) for one in plot.bars] == [
        ("100 Hz", [], 100.0),
        ("1.00 Hz", [], 0.0),
        ("0 Hz", [], 0.0),
    ]


def test_of_many_robots_a_band_from_the_lowest_to_the_highest() -> None:
    rates = [10.0, *[100.0] * 23, 1000.0]
    (plot,) = plots({"topics": [topic(rate, f"robot{number}") for number, rate in enumerate(rates)]})
    (one,) = plot.bars
    assert (one.label, one.value, one.parts, one.dot) == ("/t", "10.0 Hz to 1000 Hz", [Part("spread", 0, 100)], 50.0)


def test_phases_lie_one_after_the_other() -> None:
    phases = {"gate": 2.0, "wait": 0.0, "apply": 3.0}
    (plot,) = plots({"steps": [{"robot": "r", "name": "a", "outcome": "updated", "seconds": 5.0, "phases": phases}]})
    assert plot.bars[0].parts == [
        Part("c7", 0.0, 25.0, "gate 2.0 s"),
        Part("c2", 25.0, 0.0, "wait 0.0 s"),
        Part("c1", 25.0, 37.5, "apply 3.0 s"),
    ]


def test_a_phase_that_is_not_known_has_a_colour_and_its_name() -> None:
    step = {"robot": "r", "name": "a", "outcome": "updated", "seconds": 3.0, "phases": {"later": 1.0, "gate": 2.0}}
    (plot,) = plots({"steps": [step]})
    assert [(part.colour, part.words) for part in plot.bars[0].parts] == [("c5", "later 1.0 s"), ("c7", "gate 2.0 s")]
    assert plot.legend == [("c7", "gate"), ("c5", "later")]


def test_a_claim_beyond_its_size_is_full() -> None:
    claim = {"robot": "r", "name": "c", "bound": True, "size": "1Ki", "used_bytes": 4096}
    (plot,) = plots({"claims": [claim]})
    assert plot.bars[0].value == "4.0 KiB of 1Ki"
    assert plot.bars[0].parts == [Part("c2", 0, 100, "400.0 %")]


@pytest.mark.parametrize(
    ("rate", "words"),
    [
        (0, "0 Hz"),
        (-1, "0 Hz"),
        (0.04, "0.040 Hz"),
        (0.9999, "1.00 Hz"),
        (9.999, "10.0 Hz"),
        (99.96, "100 Hz"),
        (1e4, "10000 Hz"),
    ],
)
def test_rates_have_three_digits(rate: float, words: str) -> None:
    assert rate_words(rate) == words
