# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Says what a run does where nothing else is said: tools that run playbooks end one that is silent."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

LONGEST = 15.0  # seconds; AWX's idle time-out may be as short as 20
LOOK = 2.0
# These say themselves what they wait for, every ten seconds.
SPEAK = tuple(f"rosops.fleet.{name}" for name in ("robot_update", "_guarded", "_k3s_change"))


@dataclass
class Silence:
    """What is under way. `begins` and `heard` come from the run, `look` from beside it."""

    say: Callable[[str], None]
    clock: Callable[[], float]
    _task: str = field(default="", init=False)
    _began: float = field(default=0.0, init=False)
    _heard: float = field(default=0.0, init=False)

    def begins(self, task: str, action: str) -> None:
        """A task begins."""
        self._task = "" if action in SPEAK else task
        self._began = self._heard = self.clock()

    def heard(self) -> None:
        """A result was printed."""
        self._heard = self.clock()

    def look(self) -> None:
        """Say what goes on, where nothing was said for long."""
        task, now = self._task, self.clock()
        if task and now - self._heard >= LONGEST:
            self._heard = now
            self.say(f"{task}: goes on for {now - self._began:.0f} s now")
