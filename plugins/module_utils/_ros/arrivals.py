# SPDX-License-Identifier: GPL-3.0-or-later
"""When the messages of one publisher came -> how many a second, and whether the next version can be held to that. Pure.

Two questions, with two answers. `hz` is what came, for whoever waits until a promised rate is there. `known` is what
may be expected of the publisher from now on, and of the next version: only of a stream with an even beat, over enough
messages. What is sent when something happens (a goal, a detection, a joystick) has none, however much of it there was.
"""

from __future__ import annotations

from bisect import bisect_right

LEAST_INTERVALS = 5  # of so many that are alike by chance, one in some hundred streams without a beat
PATIENCE = 1.25  # seconds to wait for the next message while no rate is known yet: whoever is slower has none, ever
# How much of a rate two looks may tell differently. Less than what an update lets a topic become slower by (0.1), so
# that a publisher that goes on as it did is found to.
EVEN = 0.08
LOOK = 1.0  # seconds that a later look counts for, at least; and as long as
LOOK_INTERVALS = 2  # takes it to see this many intervals (gate.rate_window)
# A publisher that was held up sends at once what it owes. Where a tenth of a second holds this many messages, those
# tenths that are not out of the ordinary still tell its rate.
TENTH_MESSAGES, TENTHS = 20, 8
DENSE = 10.0 * TENTH_MESSAGES  # messages per second
# On a machine with too much to do no tenth is like another. So many messages still come at a rate that a longer look
# tells: the next version can be held to the least of its seconds, or where a stall left one nearly empty of its pairs
# of seconds, unless that is too little to mean anything.
LONG_LOOK, LEAST_SHARE = 4.0, 0.5
SPANS = (LOOK, 2 * LOOK)


class Arrivals:
    """The arrival times of one publisher's messages, in seconds of a monotonic clock, in order.

    `latching` is what the publisher said as the stream was opened: its first message then was sent who knows when. One
    that did not say (None) may be latching, too.
    """

    def __init__(self, latching: bool | None = None) -> None:
        self.latching = latching
        self.times: list[float] = []

    def add(self, at: float, messages: int = 1) -> None:
        self.times += [at] * messages

    @property
    def counted(self) -> list[float]:
        """Without a first message that may be of any age."""
        return self.times if self.latching is False else self.times[1:]

    def hz(self, start: float, end: float) -> float:
        """Messages per second between `start` and `end`.

        Taken between arrivals, which is exact where a window holds only a few messages. A silence at the end counts: it
        is no part of a steady stream, and one as long as all before it is its end. One at the beginning, after which a
        publisher that was held up sends all at once what it owes, does not make it faster: it is never more than what
        the whole window holds.
        """
        counted = self.counted
        if len(counted) < LOOK_INTERVALS:
            return len(counted) / (end - start) if end > start else 0.0
        intervals, most = len(counted) - 1, (len(self.times) + 1) / (end - start)
        first, last = counted[0], counted[-1]
        if 2 * (end - last) > end - start:
            most = min(most, LOOK_INTERVALS / (end - last))
        if end - last > 2 * (last - first) / intervals + 0.05:
            return min(most, intervals / (end - first))
        if last <= first:
            return len(self.times) / (end - start)
        return min(most, intervals / (last - first))

    def undecided(self, start: float, now: float) -> bool:
        """A little more time may show a rate: messages come, but have not been enough, or too unevenly."""
        last = self.times[-1] if self.times else start
        if now - last >= PATIENCE:
            return False
        if len(self.counted) <= LEAST_INTERVALS:
            return True
        dense = len(self.counted) >= DENSE * (now - start)
        return dense and now - start < LONG_LOOK and self.known(start, start + LOOK) is None

    def known(self, start: float, end: float) -> float | None:
        """Messages per second that every later look will see, too; None where nobody knows.

        What came before `start` had waited to be read: its time is not when it was sent.
        """
        beat = [at for at in self.times if at > start] if self.times and self.times[0] <= start else self.counted
        beat = beat[: bisect_right(beat, end)]
        intervals = len(beat) - 1
        if intervals < LEAST_INTERVALS or beat[-1] <= beat[0]:
            return None
        mean = (beat[-1] - beat[0]) / intervals
        if mean > PATIENCE:
            return None  # some seconds hold too few of them, however long the record was
        if max(beat[0] - start - mean, end - beat[-1]) > 1.5 * mean + 0.05:
            return _least_second(beat, start, end)  # else it has only begun, or it is over
        stray = max(abs(at - beat[0] - number * mean) for number, at in enumerate(beat)) / mean
        later = max(LOOK_INTERVALS, int(LOOK / mean) - 1)
        if stray * (1 / intervals + 1 / later) <= EVEN:
            return 1 / mean
        usual = _usual_tenths(beat, start, end)
        return _least_second(beat, start, end) if usual is None else min(usual, self.hz(start, end))


def _usual_tenths(beat: list[float], start: float, end: float) -> float | None:
    """Messages per second in the middle half of the tenths of a second, if these are alike.

    A burst, and the stall before it, are in the others.
    """
    counts = dict.fromkeys(range(int(start * 10) + 1, int(end * 10)), 0)
    if len(counts) < TENTHS:
        return None
    for at in beat:
        tenth = int(at * 10)
        if tenth in counts:
            counts[tenth] += 1
    ranked = sorted(counts.values())
    cut = len(ranked) // 4
    middle = ranked[cut : len(ranked) - cut]
    mean = sum(middle) / len(middle)
    alike = middle[-1] - middle[0] <= 0.1 * mean + 1
    return 10 * mean if alike and mean >= TENTH_MESSAGES else None


def _least_second(beat: list[float], start: float, end: float) -> float | None:
    """Messages per second in the second, or in the two, that had the fewest, of a long look at very many."""
    if end - start < LONG_LOOK or len(beat) < DENSE * (end - start):
        return None
    until = [bisect_right(beat, start + number / 10) for number in range(int((end - start) * 10) + 1)]
    for seconds in SPANS:
        tenths = int(seconds * 10)
        least = min(after - before for before, after in zip(until, until[tenths:])) / seconds
        if least >= LEAST_SHARE * len(beat) / (end - start):
            return least
    return None
