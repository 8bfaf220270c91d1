# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a rehearsal showed, by the accounts of before and after."""

from __future__ import annotations

import json
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._rehearsal.review import (
    Asked,
    accounts,
    asked,
    received,
    review,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._rehearsal.recordings import RECORDING

BEGAN = 1000.0
STEP = {
    "name": "temperature",
    "handoff": "overlap",
    "outcome": "rolled-back",
    "started": BEGAN,
    "phases": {"wait": 1.0, "rollout": 4.5},
}


def account(messages: int, missing: int | None = 0, twice: int = 0, gaps: Any = ()) -> dict[str, Any]:
    return {"messages": messages, "missing": missing, "twice": twice, "publishers": ["/temperature_a"], "gaps": gaps}


BEFORE = {"/temperature_stats": {"/temperature": account(100, 7, 1)}}
AFTER = {
    "/temperature_stats": {
        "/temperature": account(5100, 10, 4, [(BEGAN - 1, 9.0), (BEGAN + 1, 0.25), (BEGAN + 2, 0.125)]),
        "/other": account(5, None),
        "/holes": account(5, 2),
    }
}


def test_accounts_are_found_among_parameters() -> None:
    values = {"/rehearsal/arm/driver": json.dumps({"/a": account(1)}), "/speed": 0.5}
    assert accounts(values) == {"/arm/driver": {"/a": {**account(1), "gaps": []}}}


def test_what_came_between() -> None:
    holes, temperature = received(BEFORE, AFTER, BEGAN, ["/temperature"])
    assert (temperature.topic, temperature.subscriber) == ("/temperature", "/temperature_stats")
    assert (temperature.messages, temperature.missing, temperature.twice) == (5000, 3, 3)
    assert temperature.silence == 0.25
    assert (holes.topic, holes.missing) == ("/holes", 2)  # not the changed app's, but something is missing


def test_greetings_between_two_looks() -> None:
    then = {"/stats": {"/sum": {"asked": 100, "refused": 2}, "/topic": account(7)}}
    now = {"/stats": {"/sum": {"asked": 150, "refused": 5}, "/topic": account(9)}}
    assert [*asked(then, now)] == [Asked("/sum", "/stats", 50, 3)]
    found = review("robot2", RECORDING, {"temperature": {}}, {}, then, now)
    assert found.asked == (Asked("/sum", "/stats", 50, 3),)
    assert found.lines()[-1] == "/sum by /stats: asked 50 times, 3 refused"


def test_a_stand_in_that_began_anew_meanwhile_counts_from_there() -> None:
    then = {"/stats": {"/temperature": account(500, 7), "/sum": {"asked": 100, "refused": 50}}}
    now = {"/stats": {"/temperature": account(20, 1), "/sum": {"asked": 10, "refused": 1}}}
    [one] = received(then, now, BEGAN, [])
    assert (one.messages, one.missing) == (20, 1)
    assert [*asked(then, now)] == [Asked("/sum", "/stats", 10, 1)]


def test_a_stand_in_that_is_new() -> None:
    [found] = received({}, BEFORE, BEGAN, ["/temperature"])
    assert (found.messages, found.missing) == (100, 7)


def test_a_rehearsal_that_took_the_version_back() -> None:
    outcome = {"outcome": "rolled-back", "reason": "temperature: its rate", "steps": [STEP]}
    found = review("robot2", RECORDING, {"temperature": {"image": "x:2"}}, outcome, BEFORE, AFTER)
    assert (found.robot, found.recorded, found.outcome, found.seconds) == ("robot2", "robot1", "rolled-back", 5.5)
    assert {one.topic for one in found.received} == {"/temperature", "/holes"}
    assert found.lines() == [
        "robot1's graph, temperature changed: rolled-back",
        "temperature: its rate",
        "temperature: rolled-back by overlap: wait 1.0 s, rollout 4.5 s",
        "/holes at /temperature_stats: 5 messages, 2 lost, 0 twice, longest silence 0.00 s",
        "/temperature at /temperature_stats: 5000 messages, 3 lost, 3 twice, longest silence 0.25 s",
    ]
    assert json.loads(json.dumps(found.as_dict()))["steps"] == [STEP]


def test_a_rehearsal_in_which_nothing_was_done() -> None:
    found = review("robot2", RECORDING, {"temperature": {}}, {}, BEFORE, BEFORE)
    assert (found.outcome, found.seconds) == ("", 0)
    assert found.received[0].silence == 0.0
    assert found.lines()[0] == "robot1's graph, temperature changed: nothing was done"
    unnumbered = {"/temperature_stats": {"/temperature": account(4, None)}}
    [one] = review("robot2", RECORDING, {"temperature": {}}, {}, {}, unnumbered).received
    assert one.missing is None
    assert "without numbers" in review("robot2", RECORDING, {"temperature": {}}, {}, {}, unnumbered).lines()[1]
