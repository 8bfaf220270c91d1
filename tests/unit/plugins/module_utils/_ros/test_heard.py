# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What messages that were heard mean, on a clock that the tests turn."""

from __future__ import annotations

import math
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import FAIL, PASS, WAIT
from ansible_collections.rosops.fleet.plugins.module_utils._ros.conditions import ValueCondition
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Graph, MasterState
from ansible_collections.rosops.fleet.plugins.module_utils._ros.heard import Heard, check_value

STAMP = {"seq": 1, "stamp": 100.0, "frame_id": ""}


def graph(*publishers: str) -> Graph:
    return MasterState({"/t": publishers}, {}, {}).graph


def seen(heard: Heard, now: float = 0.0, *publishers: str) -> tuple[str, str]:
    found = check_value(graph(*(publishers or ("/p",))), heard, now)
    return found.verdict, found.reason


@pytest.mark.parametrize(
    ("bounds", "value", "verdict", "reason"),
    [
        ({"above": 0.4}, 0.41, PASS, "is 0.41"),
        ({"above": 0.4}, 0.4, WAIT, "is 0.4, not above 0.4"),
        ({"above": 0.4}, math.nan, WAIT, "is nan, not above 0.4"),
        ({"above": 0.4}, "full", WAIT, "is 'full', not above 0.4"),
        ({"below": 3.0}, 2, PASS, "is 2"),
        ({"above": 1.0, "below": 3.0}, 3.5, WAIT, "is 3.5, not above 1.0 and below 3.0"),
        ({"equals": 0.4}, 0.4000000059604645, PASS, "is 0.4"),  # as 32 bits have it
        ({"equals": True}, True, PASS, "is True"),
        ({"equals": True}, 0, WAIT, "is 0, not equal to True"),
        ({"equals": "docked"}, "docked", PASS, "is 'docked'"),
        ({"equals": "docked"}, "a" * 99, WAIT, f"is '{'a' * 56}..., not equal to 'docked'"),
    ],
)
def test_the_last_value_counts(bounds: dict[str, Any], value: Any, verdict: str, reason: str) -> None:
    heard = Heard(ValueCondition("/t", "a.b", **bounds), 0.0)
    assert seen(heard, 2.0) == (WAIT, "no message in 2.0 s")
    heard.take({"a": {"b": "another"}}, 1.0)
    heard.take({"a": {"b": value}}, 2.0)
    assert seen(heard, 2.0) == (verdict, reason)
    heard.forget()
    assert seen(heard, 2.0)[0] == WAIT


def test_what_was_heard_stands_in_the_check() -> None:
    heard = Heard(ValueCondition("/t", "a", above=1.0), 0.0)
    heard.take({"a": 2}, 1.0)
    found = check_value(graph("/p", "/q"), heard, 1.0)
    assert (found.kind, found.name) == ("value", "/t a above 1.0")
    assert found.observed == {"publishers": ["/p", "/q"], "value": 2}
    heard.take({"a": ("x", "y")}, 2.0)
    assert check_value(graph("/p"), heard, 2.0).observed == {"publishers": ["/p"], "value": "('x', 'y')"}


def test_a_number_is_no_text() -> None:
    heard = Heard(ValueCondition("/t", "a", equals="1"), 0.0)
    heard.take({"a": 1}, 1.0)
    assert seen(heard, 1.0) == (WAIT, "is 1, not equal to '1'")


def test_a_field_that_no_message_has_fails_at_once() -> None:
    for condition in (ValueCondition("/t", "b", above=1.0), ValueCondition("/t", "b", quiet=1.0)):
        heard = Heard(condition, 0.0)
        heard.take({"a": 1}, 1.0)
        assert seen(heard, 5.0) == (FAIL, "it has no field b: there is a where b is looked for")


def test_who_cannot_be_heard_may_say_anything() -> None:
    for condition in (ValueCondition("/t", "a", above=1.0), ValueCondition("/t", quiet=1.0)):
        heard = Heard(condition, 0.0)
        heard.take({"a": 2}, 0.0)
        heard.unheard = {"/q": "no answer"}
        assert seen(heard, 9.0, "/p", "/q") == (WAIT, "not known, as publishers cannot be heard: /q (no answer)")


def test_nobody_publishes() -> None:
    found = check_value(Graph({}, {}, {}, {}), Heard(ValueCondition("/t", "a", above=1.0), 0.0), 1.0)
    assert (found.verdict, found.reason) == (WAIT, "nobody publishes it")
    quiet = check_value(Graph({}, {}, {}, {}), Heard(ValueCondition("/t", quiet=3.0), 0.0), 3.0)
    assert (quiet.verdict, quiet.reason) == (PASS, "nothing in 3.0 s")


def test_quiet_is_nothing_or_only_zeros() -> None:
    heard = Heard(ValueCondition("/t", quiet=3.0), 10.0)
    assert seen(heard, 12.0) == (WAIT, "2.0 s of 3 s since it is listened to")
    assert seen(heard, 13.0)[0] == PASS
    heard.take({"header": STAMP, "x": 0.0, "name": "a"}, 13.0)
    assert seen(heard, 13.0) == (PASS, "nothing but zeros in 3.0 s")
    heard.take({"x": 0.5}, 14.0)
    heard.take({"x": 0.0}, 16.4)
    assert seen(heard, 16.5) == (WAIT, "2.5 s of 3 s since {'x': 0.5} came")
    assert seen(heard, 17.0) == (PASS, "nothing but zeros in 3.0 s")


def test_still_is_something_and_only_zeros() -> None:
    heard = Heard(ValueCondition("/t", "twist", still=3.0, tolerance=0.01), 10.0)
    assert seen(heard, 13.0) == (WAIT, "not known: no message in 3 s")
    for at in (13.0, 15.0):
        heard.take({"twist": {"x": 0.009, "y": -0.01}, "covariance": (1.0,)}, at)
    assert seen(heard, 16.0) == (PASS, "nothing but zeros in 6.0 s")
    assert seen(heard, 18.1) == (WAIT, "not known: no message in 3 s")  # a driver that died does not stand still
    heard.take({"twist": {"x": -0.011}}, 19.0)
    assert seen(heard, 20.0) == (WAIT, "1.0 s of 3 s since {'x': -0.011} came")
    heard.take({"twist": {"x": math.nan}}, 21.0)
    assert seen(heard, 22.5)[0] == WAIT


def test_a_message_that_cannot_be_read() -> None:
    heard = Heard(ValueCondition("/t", quiet=1.0), 0.0)
    heard.take({}, 5.0, "the message ends early")
    assert seen(heard, 5.0) == (FAIL, "the message ends early")
    heard.take({"x": 0}, 6.0)  # and was one of another publisher
    assert seen(heard, 5.5)[0] == WAIT
