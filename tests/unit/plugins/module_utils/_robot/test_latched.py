# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What becomes of a latched message whose node was stopped, by what the graph shows."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._robot.latched import (
    DROP,
    EXPIRES,
    OFFER,
    SETTLE,
    WAIT,
    Value,
    as_kept,
    from_kept,
    stem,
    worth_keeping,
)

OLD, NEW, OTHER = "http://old:1/", "http://new:1/", "http://other:1/"
HEADER = {"type": "std_msgs/String", "md5sum": "992c", "message_definition": "string data\n"}


def value(node: str = "/dock", publishers: dict[str, str] | None = None, **had: str) -> Value:
    """Placed in a graph in which these publish the topic beside the node."""
    made = Value("/docked", node, OLD, HEADER, "1", 20, {f"/{name}": "" for name in had})
    made.place({node: OLD, **(publishers or {})}, {f"/{name}": uri for name, uri in had.items()})
    return made


@pytest.mark.parametrize(
    ("published", "subscribed", "kept"),
    [
        (["/map", "/rosout"], [], ["/map"]),
        (["/cam/parameter_descriptions", "/cam/parameter_updates", "/cam/info"], [], ["/cam/info"]),
        (["/go/status", "/go/feedback", "/go/result", "/go/plan"], ["/go/goal", "/go/cancel"], ["/go/plan"]),
        (["/battery/status"], ["/goal"], ["/battery/status"]),  # no action
        (["/move_base_simple/goal"], [], ["/move_base_simple/goal"]),
    ],
)
def test_what_is_worth_keeping(published: list[str], subscribed: list[str], kept: list[str]) -> None:
    assert worth_keeping(published, subscribed) == kept


@pytest.mark.parametrize(
    ("node", "name"),
    [("/ns/dock_0123abcd", "/ns/dock"), ("/dock", "/dock"), ("/dock_0123abc", "/dock_0123abc"), ("/a_0123abcd/b",) * 2],
)
def test_a_node_is_known_without_its_revision(node: str, name: str) -> None:
    assert stem(node) == name


def test_it_is_offered_once_the_next_publisher_had_time_to_latch_by_itself() -> None:
    kept = value()
    assert kept.step({"/dock": OLD}, (), 0.0) == WAIT  # the node is still there
    assert kept.step({}, (), 1.0) == WAIT
    assert kept.step({"/dock": NEW}, (), 5.0) == WAIT
    assert kept.step({"/dock": NEW}, (), 5.0 + SETTLE) == OFFER
    assert kept.step({"/dock": NEW}, (), 1e6) == OFFER  # however long nothing happens
    assert kept.step({}, (), 1e6 + 1) == WAIT  # nobody who could say it is there
    assert kept.step({"/dock": NEW}, (), 1e6 + 2) == WAIT
    assert kept.step({"/dock": NEW}, (), 1e6 + 2 + SETTLE) == OFFER


def test_under_overlap_the_next_version_is_there_already() -> None:
    kept = value("/dock_0000000a", {"/dock_0000000b": NEW})
    assert kept.beside == []
    assert kept.step({"/dock_0000000a": OLD, "/dock_0000000b": NEW}, (), 0.0) == WAIT
    assert kept.step({"/dock_0000000b": NEW}, (), 1.0) == WAIT
    assert kept.step({"/dock_0000000b": NEW}, (), 1.0 + SETTLE) == OFFER
    assert kept.is_over(NEW, True, 0)


def test_what_nobody_comes_for_is_let_go() -> None:
    """The app may be gone for good."""
    kept = value(publishers={"/other": OTHER})
    assert kept.step({"/other": OTHER}, (), 10.0) == WAIT  # who was beside it does not come in its place
    assert kept.step({"/other": OTHER}, (), 9.9 + EXPIRES) == WAIT
    assert kept.step({"/other": OTHER}, (), 10.0 + EXPIRES) == DROP


def test_a_next_one_that_comes_and_goes_begins_the_time_anew() -> None:
    kept = value()
    assert kept.step({}, (), 0.0) == WAIT
    assert kept.step({"/dock": NEW}, (), EXPIRES - 1) == WAIT
    assert kept.step({}, (), EXPIRES + 1) == WAIT
    assert kept.step({}, (), 2 * EXPIRES + 1) == DROP


def test_whatever_the_next_publisher_says_takes_its_place() -> None:
    kept = value()
    assert not kept.is_over(NEW, False, 0)
    assert kept.is_over(NEW, True, 0)
    assert not kept.is_over(OLD, True, 5)


def test_what_others_had_latched_beside_it_does_not_take_its_place_but_news_of_them_do() -> None:
    """As of the many publishers of /tf_static."""
    kept = value(publishers={"/other": OTHER})
    assert not kept.is_over(OTHER, True, 0)
    assert kept.is_over(OTHER, True, 1)
    unplaced = Value("/docked", "/dock", OLD, HEADER, "1", 20, {})
    assert not unplaced.is_over(OTHER, True, 1)  # nobody knows yet whether it was beside it


def test_who_had_it_does_not_get_it_again_as_long_as_it_is_the_same_subscription() -> None:
    kept = value(early="http://early:1/", gone="http://gone:1/")
    assert not kept.is_due("/early", "http://early:1/")
    assert not kept.is_due("/early", "")  # nobody knows: a goal that comes twice is worse than one that is not shown
    assert kept.is_due("/early", "http://early:2/")  # another process of this name
    assert kept.is_due("/late", "http://late:1/")
    assert kept.is_due("/late", "")
    kept.step({}, (), 0.0)
    assert not kept.is_due("/gone", "http://gone:1/")  # a master that was restarted knows of nobody
    kept.step({"/dock": NEW}, ("/early",), 1.0)
    assert kept.is_due("/gone", "http://gone:1/")
    assert not kept.is_due("/early", "http://early:1/")


def test_only_the_first_look_says_who_was_there() -> None:
    kept = value(early="http://early:1/")
    kept.place({"/late": NEW}, {})
    assert (kept.beside, kept.had) == ([], {"/early": "http://early:1/"})


def test_a_newer_version_of_the_node_takes_the_older_ones_place() -> None:
    assert value("/dock_0000000a").key == value("/dock_0000000b").key == ("/docked", "/dock")


def test_the_record_is_what_was_kept() -> None:
    kept = [value(early="http://early:1/", publishers={"/other": OTHER})]
    kept[0].offered, kept[0].alone = True, 5.0
    again = from_kept(as_kept(kept, "boot 1"))
    assert again == kept
    assert (again[0].offered, again[0].alone) == (False, None)  # by a clock that begins anew


@pytest.mark.parametrize("data", [None, [], {}, {"boot": "x"}, {"boot": "x", "values": [{}]}, {"values": []}])
def test_what_is_no_record_has_nothing(data: Any) -> None:
    assert from_kept(data) == []
