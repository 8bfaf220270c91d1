# SPDX-License-Identifier: GPL-3.0-or-later
"""Rates only where they mean something: hundreds of looks at each kind of publisher, all in simulated time."""

from __future__ import annotations

import os
import random
from collections.abc import Callable, Iterator
from functools import partial

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros.arrivals import Arrivals
from ansible_collections.rosops.fleet.plugins.module_utils._ros.gate import rate_window

TOLERANCE = 0.1 + 0.9 * 0.01  # update_rate_tolerance, and what a look lets pass of a least rate
LOOKS, LATER = 200 if os.environ.get("ROSOPS_TEST_ALL") else 80, 5
Source = Callable[[random.Random], Iterator[float]]  # when messages are sent, for ever, from some time on


def beat(hz: float, jitter: float, chance: random.Random) -> Iterator[float]:
    """A timer: messages stray by a share of the period from an even beat."""
    phase, number = chance.random() / hz, 0
    while True:
        yield max(0.0, phase + (number + chance.uniform(-jitter, jitter)) / hz)
        number += 1


def events(hz: float, chance: random.Random) -> Iterator[float]:
    """Whatever happens, as often on average."""
    at = 0.0
    while True:
        at += chance.expovariate(hz)
        yield at


def bursts(messages: int, hz: float, every: float, chance: random.Random) -> Iterator[float]:
    """Some messages one after the other, and then a pause."""
    at = (chance.random() - 1) * every
    while True:
        for number in range(messages):
            if at + number / hz > 0:
                yield at + number / hz
        at += every * chance.uniform(0.7, 1.3)


def stalled(hz: float, stall: float, every: float, chance: random.Random) -> Iterator[float]:
    """A timer on a machine that has too much to do: it stands still now and then, and then sends what it owes."""
    stands, goes = chance.expovariate(1 / every), 0.0
    for due in beat(hz, 0.1, chance):
        while due > stands:
            goes = stands + chance.uniform(0.2, 1) * stall
            stands = goes + chance.expovariate(1 / every)
        yield max(due, goes)


def look(
    sent: Iterator[float], chance: random.Random, seconds: float, latching: bool | None, patient: bool
) -> tuple[Arrivals, float]:
    """What came, and until when. As streams.count_messages reads: some milliseconds after the messages came."""
    found, now = Arrivals(latching), 0.0
    if latching is not False:  # the latched one is there at once
        found.add(0.002)
    due = next(sent)
    while now < seconds or (patient and found.undecided(0.0, now)):
        now += chance.uniform(0.005, 0.01)
        while due <= now:
            found.add(now)
            due = next(sent)
    return found, now


def recorded(
    source: Source, latching: bool | None, after: tuple[Source, bool | None] | None = None, records: int = LOOKS
) -> tuple[int, int, float]:
    """How many records know a rate, how many later looks refused it, and the seconds that a record took.

    `after`: another version that is looked at later.
    """
    chance = random.Random(4711)  # noqa: S311 - the same in every run
    known, refused, took = 0, 0, 0.0
    following, word = after or (source, latching)
    for _look in range(records):
        found, end = look(source(chance), chance, 1.0, latching, patient=True)
        took += end
        hz = found.known(0.0, end)
        if hz is None:
            continue
        known += 1
        for _again in range(LATER):
            later, end = look(following(chance), chance, rate_window(0.9 * hz), word, patient=False)
            refused += later.hz(0.0, end) < hz * (1 - TOLERANCE)
    return known, refused, took / records


STEADY = {
    "1 Hz": (partial(beat, 1.0, 0.01), False),
    "latched and 1 Hz": (partial(beat, 1.0, 0.01), True),
    "5 Hz": (partial(beat, 5.0, 0.05), False),
    "20 Hz that stray by a fifth": (partial(beat, 20.0, 0.2), False),
    "500 Hz": (partial(beat, 500.0, 0.2), False),
}
UNKNOWN = {
    "silent": (partial(beat, 0.001, 0.0), False),
    "latched alone": (partial(beat, 0.001, 0.0), True),
    "0.5 Hz": (partial(beat, 0.5, 0.01), False),
    "perhaps latched and 0.2 Hz": (partial(beat, 0.2, 0.01), None),
    "events, 20 a second": (partial(events, 20.0), False),
    "latched and events": (partial(events, 5.0), True),
    "bursts of 5": (partial(bursts, 5, 20.0, 2.0), False),
    "bursts of 60": (partial(bursts, 60, 500.0, 0.5), False),
}


@pytest.mark.parametrize("name", STEADY)
def test_what_is_recorded_of_a_steady_publisher_is_found_again(name: str) -> None:
    known, refused, took = recorded(*STEADY[name])
    assert (known > 0.95 * LOOKS, refused) == (True, 0)
    assert took < 7.5


@pytest.mark.parametrize("name", UNKNOWN)
def test_what_has_no_rate_has_none_recorded(name: str) -> None:
    known, refused, took = recorded(*UNKNOWN[name])
    assert known <= 0.01 * LOOKS
    assert refused <= LATER
    assert took < 4.0


@pytest.mark.parametrize("source", [partial(beat, 1.0, 0.1), partial(beat, 5.0, 0.1), partial(events, 100.0)])
def test_what_is_neither_steady_nor_wild_is_recorded_only_where_a_later_look_agrees(source: Source) -> None:
    known, refused, _took = recorded(source, False)
    assert refused <= 0.01 * LOOKS * LATER
    assert known < LOOKS


@pytest.mark.parametrize(
    ("stall", "every", "slow"),
    [*((stall, every, 250.0) for stall, every in [(0.05, 0.2), (0.1, 0.2), (0.2, 0.3), (0.2, 1.0), (0.4, 1.0)]),
     (0.6, 1.0, 10.0), (0.8, 1.5, 10.0)],
)  # fmt: skip
def test_a_slower_version_is_found_on_a_busy_machine_too(stall: float, every: float, slow: float) -> None:
    """A second tells too little there, and nothing where it is a stall: a rate that nobody knows lets any version pass.

    Half the rate is found while a second is no stall; beyond that, a version that hardly sends.
    """
    version, slower = (partial(stalled, hz, stall, every) for hz in (500.0, slow))
    known, refused, _took = recorded(version, False, (slower, None), LOOKS // 4)
    assert known >= 0.95 * LOOKS // 4
    assert refused == LATER * known


# ---- one stream at a time


def arrivals(*times: float, latching: bool | None = None) -> Arrivals:
    found = Arrivals(latching)
    for at in times:
        found.add(at)
    return found


@pytest.mark.parametrize(
    ("times", "end", "expected"),
    [
        ([], 1.0, 0.0),
        # it may be latched, so it is no rate
        ([0.5], 2.0, 0.0),
        ([0.1, 0.6], 2.0, 0.5),
        # one per second: an odd phase of the window does not matter
        ([0.9, 1.9, 2.9, 3.9], 4.0, 1.0),
        ([0.01, 1.01, 2.01, 3.01], 4.0, 1.0),
        # a latched message of any age comes first
        ([0.0, 0.3, 1.3, 2.3, 3.3], 4.0, 1.0),
        # 10 Hz that stopped half-way is not 10 Hz
        ([0.1 * i for i in range(1, 11)], 2.0, 8 / 1.8),
        # what it owed all at once, and then nothing any more
        ([0.001 * i for i in range(1, 101)], 1.0, 2 / 0.9),
        # held up for half the window, then twice as fast to catch up
        ([0.5 + 0.001 * i for i in range(1, 500)], 1.0, 500.0),
        # all at once, in one read
        ([0.2, 0.2, 0.2], 0.25, 12.0),
    ],
)
def test_hz(times: list[float], end: float, expected: float) -> None:
    assert arrivals(*times).hz(0.0, end) == pytest.approx(expected)


def test_the_publishers_word_says_whether_the_first_message_counts() -> None:
    times = [0.5, 1.5, 2.5]
    assert [len(arrivals(*times, latching=word).counted) for word in (True, None, False)] == [2, 2, 3]


def test_what_is_sent_all_at_once_is_not_expected_of_anybody() -> None:
    """500 Hz; 125 messages that a stall had kept back come in one burst within the window."""
    burst = [1.35] * 125
    found = arrivals(*sorted([1.0 + 0.002 * i for i in range(1, 500)] + burst))
    assert found.hz(1.0, 2.0) > 600
    assert found.known(1.0, 2.0) == pytest.approx(500, rel=0.01)


def test_what_waited_to_be_read_tells_no_rate() -> None:
    times = [5.0] * 1000 + [5.0 + 0.1 * i for i in range(1, 11)]
    assert arrivals(*times, latching=False).known(5.0, 6.05) == pytest.approx(10.0)
    assert arrivals(*times[:1003], latching=False).known(5.0, 6.05) is None


@pytest.mark.parametrize(
    ("times", "end"),
    [
        ([0.1 * i for i in range(1, 11)], 1.3),  # it is over
        ([1.0 + 0.1 * i for i in range(1, 11)], 2.05),  # it has only begun
        ([0.1 * i for i in range(1, 6)], 0.55),  # too few
        ([0.5] * 20, 0.6),  # all at once
        ([2.0 * i for i in range(1, 11)], 21.0),  # a look would have to last too long
        ([0.002 * i for i in range(1, 100)] + [0.7 + 0.002 * i for i in range(1, 150)], 1.0),  # with a pause
    ],
)
def test_no_rate_is_known(times: list[float], end: float) -> None:
    assert arrivals(*times, latching=False).known(0.0, end) is None
