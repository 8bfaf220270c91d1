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


def test_a_newer_version_s_value_takes_the_older_one_s_place() -> None:
    assert value("/ns/dock_0123abcd_4").key == value("/ns/dock_99999999").key == ("/docked", "/ns/dock")


OF_OLD, NEXT, BESIDE = {"/dock": OLD}, {"/dock": NEW}, {"/other": OTHER}
OVERLAP, BOTH = {"/dock_0000000b": NEW}, {"/dock_0000000a": OLD, "/dock_0000000b": NEW}


@pytest.mark.parametrize(
    ("kept", "looks"),
    [
        # offered once the next publisher had time to latch by itself, and however long nothing happens then
        (value(), [(OF_OLD, 0, WAIT), ({}, 1, WAIT), (NEXT, 5, WAIT), (NEXT, 5 + SETTLE, OFFER), (NEXT, 1e6, OFFER)]),
        # nobody who could say it is there
        (value(), [(NEXT, 0, WAIT), (NEXT, SETTLE, OFFER), ({}, 5, WAIT), (NEXT, 6, WAIT), (NEXT, 6 + SETTLE, OFFER)]),
        # under overlap the next version is there already
        (value("/dock_0000000a", OVERLAP), [(BOTH, 0, WAIT), (NEXT, 1, WAIT), (NEXT, 1 + SETTLE, OFFER)]),
        # the app may be gone for good; who was beside it does not come in its place
        (value("/dock", BESIDE), [(BESIDE, 10, WAIT), (BESIDE, 9.9 + EXPIRES, WAIT), (BESIDE, 10 + EXPIRES, DROP)]),
        # one that comes and goes begins the time anew
        (value(), [({}, 0, WAIT), (NEXT, EXPIRES - 1, WAIT), ({}, EXPIRES + 1, WAIT), ({}, 2 * EXPIRES + 1, DROP)]),
    ],
)
def test_when_it_is_offered_and_when_let_go(kept: Value, looks: list[tuple[dict[str, str], float, str]]) -> None:
    assert [kept.step(publishers, (), at) for publishers, at, _order in looks] == [order for *_look, order in looks]


@pytest.mark.parametrize(
    ("kept", "uri", "heard", "news", "over"),
    [
        (value(), NEW, False, 0, False),
        (value(), NEW, True, 0, True),  # whatever the next publisher says
        (value("/dock_0000000a", OVERLAP), NEW, True, 0, True),
        (value(), OLD, True, 5, False),
        # others had latched something beside it, as the many publishers of /tf_static: news of them count
        (value(publishers=BESIDE), OTHER, True, 0, False),
        (value(publishers=BESIDE), OTHER, True, 1, True),
        (Value("/docked", "/dock", OLD, HEADER, "1", 20, {}), OTHER, True, 1, False),  # who was beside it is not known
    ],
)
def test_what_takes_its_place(kept: Value, uri: str, heard: bool, news: int, over: bool) -> None:
    assert kept.is_over(uri, heard, news) is over


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


def test_the_record_is_what_was_kept() -> None:
    kept = [value(early="http://early:1/", publishers={"/other": OTHER})]
    kept[0].offered, kept[0].alone = True, 5.0
    again = from_kept(as_kept(kept, "boot 1"))
    assert again == kept
    assert (again[0].offered, again[0].alone) == (False, None)  # by a clock that begins anew


@pytest.mark.parametrize("data", [None, [], {}, {"boot": "x"}, {"boot": "x", "values": [{}]}, {"values": []}])
def test_what_is_no_record_has_nothing(data: Any) -> None:
    assert from_kept(data) == []
