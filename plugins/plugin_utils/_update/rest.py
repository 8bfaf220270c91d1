# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot at rest: its actions are idle, and new goals are held back for as long as something is changed."""

from __future__ import annotations

from ...module_utils._common.errors import FleetError
from ...module_utils._common.poll import PASS, WAIT
from .hands import Hands
from .world import Calm, Object, Seen

MARGIN = 2.0  # seconds beyond those for which something has to be quiet, to see that
LOOK_SECONDS, LOOKS = 8.0, 50  # of one look at a robot that works, at least; about as many looks as that, at most
HOLD_SECONDS = 60.0  # the keeper lets held goals go then by itself, if the change never comes to its end


class BusyError(FleetError):
    """The robot works, and the run does not wait any longer."""


class Rest:
    """Of one robot, for one change of it.

    It has `seconds` to come to rest, from when an earlier look began to wait (`since`, by the clock's `now`), or from
    the first call.
    """

    def __init__(self, hands: Hands, seconds: float, since: float | None = None) -> None:
        self._hands, self._seconds = hands, seconds
        self.since = since
        self.held: dict[str, Object] = {}  # by name, actions whose new goals are, or may be, held back

    @property
    def patient(self) -> bool:
        """Whether it has begun to wait, and has time left."""
        return self.since is not None and self._hands.clock.now() < self.since + self._seconds

    def idle(
        self,
        calm: Calm,
        what: str,
        look: float | None = None,
        hold: bool = True,
        seconds: float | None = None,
    ) -> Seen:
        """Wait until it is, and hold new goals, so that none comes before the change.

        `what` says who waits for what, `look` how many seconds may pass in this call; None: all that are left. Or
        `seconds`, whatever is left. Without `hold`, and in check mode, nothing is held: the robot is only looked at.
        """
        hands, now = self._hands, self._hands.clock.now()
        self.since = now if self.since is None else self.since
        left, keeper = max(self.since + self._seconds - now, 0.0), "" if hands.check else hands.keeper
        before, named = self.held, {action["name"]: action for action in calm.actions if hold and not hands.check}
        heard = calm.seconds + MARGIN if calm.when else 0.0  # in fewer it cannot be seen
        left = max(left if seconds is None else seconds, heard)
        if seconds is None and look is not None and self._seconds:
            left = min(left, max(look, heard) if look else 0.0)
        # as long as nobody knows better: an answer may be lost
        self.held = {**before, **named}
        seen = hands.until(
            lambda slice_: self._look(calm, keeper, HOLD_SECONDS if hold else 0.0, slice_),
            left,
            what,
            least=heard,
            since=self.since,
        )
        # all of them, and not only those of the answer: a keeper that answers too late holds, too
        self.held = {**before, **(named if seen.verdict == PASS else {})}
        return seen

    def _look(self, calm: Calm, keeper: str, hold: float, seconds: float) -> Seen:
        """Before its window opens the robot is left alone."""
        hands, wall = self._hands, self._hands.clock.wall()
        opens = calm.windows.opens_at(wall)
        if opens > wall:
            hands.clock.sleep(min(opens - wall, seconds))
            return Seen(WAIT, f"it may be changed from {calm.windows.told(opens)} on")
        return hands.host.hold(hands.master, keeper, calm, hold, seconds)

    def let_go(self) -> None:
        """Let the goals go that are held: their clients wait. FleetError; they may be held still."""
        if self.held:
            self._hands.host.release(self._hands.master, self._hands.keeper, [*self.held.values()])
            self.held = {}

    def release(self) -> None:
        """The same at the end of all. If nobody can, the keeper does it by itself."""
        try:
            self.let_go()
        except FleetError as error:
            self._hands.say(f"goals of {', '.join(self.held)} may be held for another {HOLD_SECONDS:.0f} s: {error}")
            self.held = {}


def look_seconds(busy_timeout: float, again: bool) -> float:
    """Of one look, where a run comes back to robots that work. The first takes no time: those at rest come first."""
    return max(LOOK_SECONDS, busy_timeout / LOOKS) if again else 0.0
