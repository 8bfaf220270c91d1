# SPDX-License-Identifier: GPL-3.0-or-later
"""Look again and again until something passes, fails, or the time is over.

The clock and the sleep are handed in, so tests neither wait nor hope.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, Callable

# verdicts
PASS = "pass"  # noqa: S105 - no password: it is as it should be
FAIL = "fail"  # waiting cannot mend it; the poll ends at once
WAIT = "wait"  # not yet


@dataclass(frozen=True)
class Seen:
    """What one look brought: a verdict, and what was observed."""

    verdict: str
    observed: Any = None


@dataclass(frozen=True)
class Polled:
    """How a poll ended: `wait` means that the time ran out. `last` is the last look's observation in every case."""

    verdict: str
    last: Any
    elapsed: float
    looks: int
    passes: int  # how many of the last looks passed in a row
    held: float = 0.0  # seconds from the end of the first of these to the end of the last

    @property
    def timed_out(self) -> bool:
        return self.verdict == WAIT


def overall(verdicts: list[str]) -> str:
    """One verdict of many: a failure outweighs a wait, a wait outweighs a pass; nothing to judge is a pass."""
    if FAIL in verdicts:
        return FAIL
    return WAIT if WAIT in verdicts else PASS


def poll(  # noqa: PLR0913 - the clock and the sleep are the price of tests that never wait
    probe: Callable[[], Seen],
    timeout: float,
    interval: float,
    consecutive: int = 1,
    now: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
    stable: float = 0.0,
) -> Polled:
    """Call `probe` until it passed `consecutive` times in a row, failed once, or `timeout` seconds are over.

    With `stable` it also has to pass in every look for that many seconds, counted from the start of the first look that
    passed to the end of the last one; one that does not starts the count over. The time-out includes them.

    Looks start `interval` seconds apart, counted from start to start, and at once if a look took longer than that.
    So what becomes true is reported at most `interval` plus the length of one look later (with `consecutive` = 1).
    The last look starts when the time is over, not before: a timeout of 0 is exactly one look. A look that is under
    way is never cut off; keeping it short is the probe's own duty.
    """
    start = now()
    deadline = start + timeout
    looks = passes = 0
    since = start
    while True:
        began = now()
        seen = probe()
        looks += 1
        passes = passes + 1 if seen.verdict == PASS else 0
        ended = now()
        since = began if passes <= 1 else since
        held = ended - since if passes else 0.0
        if seen.verdict == FAIL or (passes >= consecutive and held >= stable):
            return Polled(seen.verdict, seen.observed, ended - start, looks, passes, held)
        if began >= deadline:
            return Polled(WAIT, seen.observed, ended - start, looks, passes, held)
        pause = min(began + interval, deadline) - ended
        if passes >= consecutive:  # then only the time is lacking: the last look is due at its end
            pause = min(pause, since + stable - ended)
        if pause > 0:
            sleep(pause)
