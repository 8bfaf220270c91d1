# SPDX-License-Identifier: GPL-3.0-or-later
"""Says what a run does where nothing else is said: tools that run playbooks end one that is silent."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from .._update.ledger import Word

LONGEST = 13.0  # seconds, so that with the time between two looks no line is later than 15; AWX may end a job after 20
LOOK = 2.0
HOSTS = 5  # in one line


@dataclass
class Silence:
    """What is under way. `begins` and `heard` come from the run, `look` from beside it, `words` from the tasks."""

    say: Callable[[str], None]
    clock: Callable[[], float]
    words: Callable[[float], list[Word]]
    _what: str = field(default="", init=False)
    _began: float = field(default=0.0, init=False)
    _heard: float = field(default=0.0, init=False)
    _ended: set[str] = field(default_factory=set, init=False)

    def begins(self, what: str) -> None:
        """A play or a task begins, and that was printed."""
        self._what, self._ended = what, set()
        self._began = self._heard = self.clock()

    def heard(self, host: str) -> None:
        """The host's result was printed."""
        self._ended.add(host)
        self._heard = self.clock()

    def look(self) -> None:
        """Say what goes on, where nothing was said for long."""
        now = self.clock()
        if not self._what or now - self._heard < LONGEST:
            return
        words = self.words(self._began)
        self._heard = max(self._heard, *(word.at for word in words if not word.text), self._began)
        if now - self._heard >= LONGEST:
            self._heard = now
            stands = "; ".join(self._stands(words, now))
            self.say(f"{self._what}: goes on for {now - self._began:.0f} s now{': ' if stands else ''}{stands}")

    def _stands(self, words: list[Word], now: float) -> list[str]:
        last = {word.host: word for word in words if word.text and word.host not in self._ended}
        lines = [f"{host}: {word.text}, for {now - word.at:.0f} s" for host, word in sorted(last.items())]
        more = [f"and {len(lines) - HOSTS} others"] if len(lines) > HOSTS else []
        return [*lines[:HOSTS], *more]
