# SPDX-License-Identifier: GPL-3.0-or-later
"""What the keeper remembers and what follows from a look, at times that are told to it."""

from __future__ import annotations

import json
import xmlrpc.client
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._robot.memory import (
    MEMORY,
    KeptFiles,
    Memory,
    absent_parameters,
    from_dict,
    parameters_of,
    parameters_text,
)
from ansible_collections.rosops.fleet.plugins.module_utils._ros.registrations import (
    ALIVE,
    DEAD,
    UNKNOWN,
    Entry,
    Liveness,
)

URI, OTHER = "http://10.0.0.1:1/", "http://10.0.0.1:2/"
ENTRY = Entry(URI, None, {"/a": "x/A"}, {"/b": "x/B"}, {"/s": "rosrpc://10.0.0.1:3"})
YES = Liveness(ALIVE, "", 7, frozenset({"/a"}), frozenset({"/b"}), frozenset({"/s"}))
GONE, LATE = Liveness(DEAD, "refused"), Liveness(UNKNOWN, "late")


def memory(**nodes: Entry) -> Memory:
    it = Memory(("pid",))
    it.learn({f"/{name}": entry for name, entry in nodes.items()}, {f"/{name}": 7 for name in nodes})
    return it


def test_without_a_restart_it_takes_two_looks() -> None:
    """A node that is leaving takes its registrations back a moment before it is gone."""
    it = memory(n=ENTRY)
    assert it.lost({}, 1.0) == {}
    assert set(it.lost({}, 2.0)) == {"/n"}
    assert it.lost({}, 3.0) == {}  # asked a moment ago
    assert set(it.lost({}, 7.5)) == {"/n"}


@pytest.mark.parametrize(
    ("answer", "restarted", "left", "removed"),
    [
        (GONE, 0.0, set(), set()),  # it left
        (GONE, 9.0, set(), {"/n"}),  # it was away when the master came back
        (LATE, 9.0, {"/n"}, set()),
        (Liveness(ALIVE, "", 7, frozenset(), frozenset(), frozenset()), 0.0, set(), set()),  # it gave all of it up
        (Liveness(ALIVE, "", 7, frozenset({"/a"}), frozenset(), frozenset()), 0.0, {"/n"}, set()),
    ],
)
def test_what_is_not_restored(answer: Liveness, restarted: float, left: set[str], removed: set[str]) -> None:
    it = memory(n=ENTRY)
    it.settle({"/n": it.nodes["/n"]}, {}, {"/n": answer}, restarted)
    assert (set(it.nodes), set(it.removed)) == (left, removed)


def test_the_earlier_provider_of_a_service_is_remembered() -> None:
    it = memory(old=ENTRY)
    taken = {"/old": Entry(URI, None, {"/a": "x/A"}, {"/b": "x/B"}), "/new": Entry(OTHER, None, {}, {}, {"/s": "y"})}
    it.learn(taken, {"/new": 8})
    assert it.lost(taken, 1.0) == {}
    it.forget("/new")
    left = {"/old": taken["/old"]}
    it.lost(left, 2.0)
    due = it.lost(left, 3.0)
    calls = it.settle(due, left, {"/old": YES})
    assert [call.request[0] for call in calls] == ["registerService"]
    assert it.nodes["/old"].publications == ENTRY.publications  # that was never lost


def test_a_newer_process_takes_the_name() -> None:
    it = memory(n=ENTRY)
    it.bury("/n", 1.0)
    it.learn({"/n": Entry(OTHER, None, {"/c": "x/C"})}, {"/n": 9})
    assert (it.nodes["/n"], it.removed) == (Entry(OTHER, 9, {"/c": "x/C"}), {})
    it.learn({"/n": Entry(URI, None, {"/a": "x/A"})}, {"/n": 10})
    assert it.nodes["/n"] == Entry(URI, 10, {"/a": "x/A"})


def looks(it: Memory, *answers: tuple[float, Liveness]) -> tuple[list[str], list[str]]:
    result: tuple[list[str], list[str]] = ([], [])
    for now, answer in answers:
        due = it.due({"/n": ENTRY}, now)
        result = it.judge(due, dict.fromkeys(due, answer), now)
    return result


@pytest.mark.parametrize(
    ("answers", "seconds"),
    [
        ([(0.0, LATE)], 0.0),
        ([(0.0, YES), (10.0, LATE), (20.0, LATE), (40.0, LATE)], 30.0),
        ([(0.0, LATE), (10.0, LATE), (20.0, YES)], None),
        ([(0.0, LATE), (10.0, GONE)], None),
        ([(0.0, LATE), (10.0, YES), (20.0, LATE)], 0.0),
    ],
)
def test_how_long_a_node_has_not_answered(answers: list[tuple[float, Liveness]], seconds: float | None) -> None:
    """From look to look: time without a look, as while the master is away, says nothing."""
    it = memory(n=ENTRY)
    looks(it, *answers)
    assert it.silence().silent == ({} if seconds is None else {"/n": (URI, seconds)})
    it.forget("/n")
    assert it.silence().silent == {}


def test_who_answered_when_another_one_did_not() -> None:
    there = {"/n": ENTRY, "/m": Entry(OTHER, None, {"/x": "x/X"})}
    it = memory(n=ENTRY, m=there["/m"])
    it.judge(there, {"/n": LATE, "/m": YES}, 0.0)
    assert it.silence().answering == {OTHER}
    it.judge({"/n": ENTRY}, {"/n": LATE}, 20.0)
    assert it.silence().answering == {OTHER}
    it.judge({"/n": ENTRY}, {"/n": LATE}, 21.0)  # that was too long ago to say anything
    assert it.silence().answering == frozenset()
    it.judge(there, {"/n": LATE, "/m": GONE}, 30.0)
    assert it.silence().answering == frozenset()


@pytest.mark.parametrize(
    ("answers", "gone"),
    [
        ([(0.0, GONE)], False),
        ([(0.0, GONE), (4.0, GONE)], False),  # too soon to be looked at again
        ([(0.0, GONE), (5.0, GONE)], True),
        ([(0.0, GONE), (5.0, LATE)], False),
        ([(0.0, GONE), (5.0, YES), (15.0, GONE)], False),  # it starts from the beginning
        ([(0.0, LATE), (10.0, LATE), (20.0, LATE), (30.0, LATE)], False),
        ([(0.0, Liveness(ALIVE, "", 8)), (5.0, Liveness(ALIVE, "", 8))], True),  # another process
    ],
)
def test_who_is_gone(answers: list[tuple[float, Liveness]], gone: bool) -> None:
    assert looks(memory(n=ENTRY), *answers) == (["/n"] if gone else [], [])


def test_the_very_same_process_comes_back() -> None:
    it = memory(n=ENTRY)
    it.bury("/n", 0.0)
    assert it.due({}, 5.0) == {}
    assert looks(it, (10.0, Liveness(ALIVE, "", 8))) == ([], [])  # somebody else at that address
    assert looks(it, (20.0, Liveness(ALIVE, "", 7))) == ([], ["/n"])
    assert it.revive("/n") == it.nodes["/n"]
    it.bury("/n", 0.0)
    it.judge({"/left": ENTRY}, {"/left": YES}, 60.0)  # while it was asked
    assert it.due({}, MEMORY + 1) == {}
    assert not it.seen  # nothing is left of tools that come and go for years
    assert it.removed == {}


def test_the_record(tmp_path: Path) -> None:
    it = memory(n=ENTRY, m=Entry(OTHER, None, {"/a": "x/A"}))
    it.bury("/m", 3.0)
    said: list[str] = []
    record = KeptFiles(str(tmp_path / "record"), said.append)
    assert from_dict(record.load("registrations"), 50.0) == Memory()
    record.save("registrations", it.as_dict())
    back = from_dict(record.load("registrations"), 50.0)
    removed, _at = it.removed["/m"]
    assert (back.master, back.nodes, back.removed) == (it.master, it.nodes, {"/m": (removed, 50.0)})
    (record.directory / "registrations.json").write_text('{"nodes":')
    assert from_dict(record.load("registrations"), 50.0) == Memory()
    assert json.loads(json.dumps(it.as_dict())) == it.as_dict()
    (record.directory / ".goals.new").mkdir()  # as a disk that is full
    assert [record.save("goals", number) for number in range(2)] == [False, False]
    (record.directory / ".goals.new").rmdir()
    assert [record.save("goals", number) for number in range(2)] == [True, True]
    assert [line.partition(" record")[0] for line in said] == ["goals: not on", "goals: on"]


# ---- parameters


def test_parameters_that_are_absent() -> None:
    tree = {
        "robot": {"name": "r1", "wheels": 4, "map": {"x": 1.5}},
        "run_id": "old",
        "data": xmlrpc.client.Binary(b"\0"),
    }
    wanted = parameters_of(parameters_text(tree))
    assert "run_id" not in wanted
    present = {"robot": {"name": "since", "map": {}}, "run_id": "new"}
    assert dict(absent_parameters(wanted, present)) == {
        "/data": xmlrpc.client.Binary(b"\0"),
        "/robot/map/x": 1.5,
        "/robot/wheels": 4,
    }
    assert list(absent_parameters(wanted, tree)) == []
    assert parameters_of("") == {}
    # roslaunch says once where it is: without its address what it started is seen no more
    uris = {"host_10_42_0_7__40001": "http://10.42.0.7:40001/"}
    wanted = parameters_of(parameters_text({"roslaunch": {"uris": uris}}))
    assert list(absent_parameters(wanted, {})) == [("/roslaunch", {"uris": uris})]
    # a value in the place of a tree is left as it is
    assert list(absent_parameters({"a": {"b": 1}}, {"a": 2})) == []
