# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What was heard of a topic, and what a condition on its messages makes of that. Pure: time is told to it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Mapping

from .._common.documents import Data, Document
from .._common.errors import RosError
from .._common.poll import FAIL, PASS, WAIT
from .checks import Check, listed
from .conditions import ValueCondition
from .graph import Graph, names_of
from .messages import numbers, value_at

CLOSE = 1e-6  # of a number that a message has with 32 bits, to the one that is written in a condition


@dataclass
class Heard:
    """Of one condition's topic, since somebody listens. Times are by a clock that nobody sets."""

    condition: ValueCondition
    since: float
    value: Any = None  # of the condition's field, or the whole message
    came: float | None = None  # when the last message did
    stirred: float | None = None  # when the last one did that is not all zeros,
    stir: Any = None  # and what it was
    wrong: str = ""  # what its publisher itself says against the condition
    unheard: Mapping[str, str] = field(default_factory=dict)  # publisher -> why it cannot be heard

    def take(self, message: Document, now: float, wrong: str = "") -> None:
        """A message came; or one that cannot be read, and why."""
        self.came, self.wrong, self.value = now, wrong, message
        if self.condition.field and not wrong:
            try:
                self.value = value_at(message, self.condition.field)
            except RosError as error:
                self.wrong = str(error)
        if self.condition.seconds and (self.wrong or not self._zero()):
            self.stirred, self.stir = now, self.value

    def _zero(self) -> bool:
        """NaN is none."""
        return all(abs(number) <= self.condition.tolerance for number in numbers(self.value))

    def forget(self) -> None:
        """Whoever said it is gone: what it said last may not be so any more."""
        self.value, self.came, self.wrong = None, None, ""


def check_value(graph: Graph, heard: Heard, now: float) -> Check:
    """Who cannot be heard may say anything: that is waited for."""
    wanted = heard.condition
    publishers = names_of(graph.topic(wanted.topic).publishers)
    observed: Data = {"publishers": publishers}
    if heard.unheard:
        told = listed(f"{node} ({why})" for node, why in heard.unheard.items())
        verdict, reason = WAIT, f"not known, as publishers cannot be heard: {told}"
    elif heard.wrong:
        verdict, reason = FAIL, heard.wrong
    elif wanted.seconds:
        verdict, reason = _span(heard, now)
    elif heard.came is None:
        verdict, reason = WAIT, f"no message in {now - heard.since:.1f} s" if publishers else "nobody publishes it"
    else:
        observed["value"] = heard.value if isinstance(heard.value, (int, float)) else _short(heard.value)
        good = _is_within(wanted, heard.value)
        verdict, reason = PASS if good else WAIT, f"is {_short(heard.value)}{'' if good else f', not {wanted.bounds}'}"
    return Check("value", str(wanted), verdict, reason, observed)


def _span(heard: Heard, now: float) -> tuple[str, str]:
    wanted = heard.condition
    seconds = wanted.seconds
    calm = now - (heard.since if heard.stirred is None else heard.stirred)
    silent = heard.came is None or now - heard.came > seconds
    if calm < seconds:
        since = "since it is listened to" if heard.stirred is None else f"since {_short(heard.stir)} came"
        return WAIT, f"{calm:.1f} s of {seconds:g} s {since}"
    if wanted.still and silent:
        return WAIT, f"not known: no message in {seconds:g} s"
    return PASS, f"{'nothing' if silent else 'nothing but zeros'} in {calm:.1f} s"


def _is_within(wanted: ValueCondition, value: Any) -> bool:
    if wanted.equals is not None:
        return _equal(value, wanted.equals)
    if not isinstance(value, (int, float)):
        return False
    return (wanted.above is None or value > wanted.above) and (wanted.below is None or value < wanted.below)


def _equal(value: Any, wanted: Any) -> bool:
    if isinstance(value, (int, float)) and isinstance(wanted, (int, float)):
        return math.isclose(value, wanted, rel_tol=CLOSE)
    return bool(value == wanted)


def _short(value: Any) -> str:
    text = f"{value:g}" if isinstance(value, float) else repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
