# SPDX-License-Identifier: GPL-3.0-or-later
"""The decisions of a hold, event by event; the time is told to it."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._robot import goal_rules as rules
from ansible_collections.rosops.fleet.plugins.module_utils._robot.goal_rules import Goal, Hold, Sight
from ansible_collections.rosops.fleet.plugins.module_utils._ros.tcpros import RECALLING

OLD, NEW, CLIENT = "http://old/", "http://new/", "http://client/"
ACTIVE = 1
UP = Sight(NEW, True, True, False)
ALL = Sight(NEW, True, True, True, frozenset({CLIENT}))


def hold() -> Hold:
    return Hold("/work", "/worker", OLD, until=60.0)


def goal(name: str, at: float, alone: bool = False) -> Goal:
    return Goal(name, (int(at), 0), name.encode(), at, CLIENT, alone)


def kinds(done: list[rules.Order]) -> list[str]:
    return [f"{do.kind} {do.goal.id}" if do.goal else do.kind for do in done]


def up(it: Hold, sight: Sight) -> None:
    """A new server comes at 10 s, and says what it has."""
    it.step(sight, 10.0)
    it.status(NEW, [], 10.1)


def test_held_goals_are_forwarded_in_their_order_once() -> None:
    it = hold()
    assert it.goal(goal("a", 1.0))
    assert it.goal(goal("b", 2.0))
    assert not it.goal(goal("a", 2.1))  # on the second connection to the same client
    assert it.step(Sight(), 3.0) == []
    assert it.step(Sight(NEW), 10.0) == [rules.Order(rules.ADVERTISE)]  # no status yet
    it.status(NEW, [], 10.1)
    assert kinds(it.step(UP, 10.2)) == ["open", "send a", "send b"]
    assert it.step(UP, 10.3) == []
    assert it.status(NEW, [("a", ACTIVE), ("b", 0)], 10.4) == ["a", "b"]
    assert it.forwarded == 2
    assert it.step(ALL, 10.5) == []
    assert kinds(it.step(ALL, 11.6)) == ["finish"]


def test_what_the_old_server_lists_is_its_own() -> None:
    it = hold()
    it.goal(goal("a", 1.0))
    assert it.status(OLD, [("a", ACTIVE)], 1.2) == ["a"]
    assert not it.goal(goal("a", 1.3))
    up(it, UP)
    assert kinds(it.step(UP, 10.2)) == ["open"]


def test_nothing_goes_out_before_clients_hear_results() -> None:
    it = hold()
    it.goal(goal("a", 1.0))
    deaf = Sight(NEW, True, False, False)
    it.step(deaf, 10.0)
    it.status(NEW, [], 10.1)
    assert kinds(it.step(deaf, 10.2)) == ["advertise"]
    assert it.taking
    # a client that never connects is no reason to wait for ever
    assert kinds(it.step(deaf, 15.2)) == ["open", "send a"]
    assert not it.taking


def test_a_goal_that_the_new_server_may_have_got_directly() -> None:
    it = hold()
    up(it, ALL)
    it.step(ALL, 10.2)
    it.goal(goal("a", 10.3))
    assert it.step(ALL, 10.4) == []  # wait for a status
    assert it.status(NEW, [("a", ACTIVE)], 10.6) == ["a"]
    assert it.forwarded == 0

    it.goal(goal("b", 10.5))
    assert it.step(ALL, 10.9) == []
    it.status(NEW, [], 10.8)
    it.status(NEW, [], 11.0)  # two statuses without it: the server has not got it
    assert kinds(it.step(ALL, 11.1)) == ["send b"]


def test_a_goal_of_a_client_that_the_server_is_not_connected_to_goes_at_once() -> None:
    it = hold()
    up(it, UP)
    it.step(UP, 10.2)
    it.goal(goal("a", 10.3, alone=True))
    assert it.step(ALL, 10.3) == []  # connected since: it might have come both ways
    assert kinds(it.step(UP, 10.35)) == ["send a"]


def test_goals_after_all_is_given_back_are_no_reason_to_stay() -> None:
    """A client that sends back to back has a goal that no status lists yet at nearly every moment."""
    it = hold()
    up(it, ALL)
    it.step(ALL, 10.2)
    it.goal(goal("a", 11.2))
    assert kinds(it.step(ALL, 11.3)) == ["finish"]


def test_what_the_new_server_was_told_and_said_is_nothing_to_the_one_after_it() -> None:
    it = hold()
    it.goal(goal("a", 1.0))
    it.cancel("a", (0, 0))
    it.goal(goal("b", 2.0))
    up(it, ALL)
    assert kinds(it.step(ALL, 10.2)) == ["open", "cancel a"]
    it.status(NEW, [("a", RECALLING)], 10.3)
    assert kinds(it.step(ALL, 10.4)) == ["send a", "send b"]
    assert it.step(Sight(), 10.5) == []  # it dies before it lists them
    assert it.taking
    it.goal(goal("c", 11.5))
    third = replace(ALL, server="http://third/")
    assert it.step(third, 12.8) == [rules.Order(rules.ADVERTISE)]
    it.status(third.server, [], 12.9)
    assert kinds(it.step(third, 13.0)) == ["open", "cancel a"]
    it.status(third.server, [("a", RECALLING)], 13.1)
    assert kinds(it.step(third, 13.2)) == ["send a", "send b", "send c"]


def test_a_forwarded_goal_that_is_not_listed_is_sent_again() -> None:
    it = hold()
    it.goal(goal("a", 1.0))
    up(it, UP)
    it.step(UP, 10.2)
    assert it.step(UP, 13.0) == []
    assert kinds(it.step(UP, 13.3)) == ["send a"]


@pytest.mark.parametrize(
    ("cancel", "meant"),
    [
        (("b", (0, 0)), ["b"]),
        (("", (0, 0)), ["a", "b"]),  # all
        (("", (1, 0)), ["a"]),  # all up to then
        (("other", (0, 0)), []),
    ],
)
def test_a_cancel_of_held_goals(cancel: tuple[str, tuple[int, int]], meant: list[str]) -> None:
    it = hold()
    it.goal(goal("a", 1.0))
    it.goal(goal("b", 2.0))
    assert it.cancel(*cancel) == meant


def test_a_cancelled_goal_is_answered_but_not_started() -> None:
    it = hold()
    it.goal(goal("a", 1.0))
    it.cancel("a", (0, 0))
    it.status(OLD, [("a", RECALLING)], 1.5)  # the old server got the cancel, never the goal
    up(it, UP)
    assert kinds(it.step(UP, 10.2)) == ["open", "cancel a"]
    assert it.step(UP, 10.3) == []
    assert it.status(NEW, [("a", RECALLING)], 10.4) == []
    assert kinds(it.step(UP, 10.5)) == ["send a"]
    assert it.status(NEW, [("a", 8)], 10.6) == ["a"]


def test_no_new_server() -> None:
    it = hold()
    it.goal(goal("a", 1.0))
    assert it.pick({"/worker": OLD}, 30.0) == ""
    assert it.step(Sight(), 59.0) == []
    assert kinds(it.step(Sight(), 61.0)) == ["warn"]
    assert it.step(Sight(), 62.0) == []
    assert it.pick({"/worker": OLD}, 62.0) == OLD  # from then on the old one will do
    assert kinds(it.step(Sight(), 661.0)) == ["give up a", "finish"]


def test_picking_a_server() -> None:
    it = hold()
    assert it.pick({"/worker": OLD, "/worker_b": NEW}, 1.0) == NEW
    assert it.pick({"/worker": NEW, "/another": "http://x/"}, 1.0) == NEW
    it.release(1.0)
    assert it.pick({"/worker": OLD}, 1.0) == OLD


def test_held_twice() -> None:
    it = hold()
    it.goal(goal("a", 1.0))
    it.step(UP, 5.0)
    it.status(NEW, [], 5.1)
    it.step(UP, 5.2)
    it.again("/worker", NEW, 120.0)  # the new one is to be replaced, too
    assert (it.taking, it.pick({"/worker": NEW}, 6.0), list(it.goals)) == (True, "", ["a"])


def test_a_restart_of_the_keeper() -> None:
    it = hold()
    it.goal(goal("a", 1.0))
    it.cancel("a", (0, 0))
    # it began a minute after its computer, and goes on 900 s after another's
    back = rules.from_dict(json.loads(json.dumps(it.as_dict(40.0))), 900.0)
    assert (back.action, back.node, back.old_uri, back.until) == ("/work", "/worker", OLD, 920.0)
    held = back.goals["a"]
    assert (held.body, held.stamp, held.arrived, held.cancelled) == (b"a", (1, 0), 861.0, True)
