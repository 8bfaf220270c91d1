# SPDX-License-Identifier: GPL-3.0-or-later
"""The soak: for a while after its run has found a version good, its containers must not end, nor its graph get worse.

Pure but for the look at the graph. Time counts only while all can be seen. What cannot be seen says nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Iterable, Mapping

from .._common.documents import Data
from .._ros import contract as ros_contract
from .._ros.backend import Backend
from .._ros.conditions import conditions_from
from .._ros.gate import Look, Silence, look
from .._step.objects import crashes, ends_by_container, error_of, was_out_of_memory
from .._step.words import MASTER
from .way_back import Step

LOOKS = 3  # one after the other that find the graph worse than it was
RATED = 3  # one in so many looks counts messages: streams are opened for that
LISTS = ("nodes", "topics", "services", "actions", "edges")


@dataclass
class Soaking:
    """A step as it is now, and what was seen of it so far."""

    step: Step
    silence: Silence = field(default_factory=Silence)
    seconds: float = 0.0  # for which it could be seen
    looks: int = 0
    bad: int = 0  # looks that found it so, one after the other
    counted: bool = False  # messages were, when they were asked for last, and there were enough
    with_host: dict[str, int] = field(default_factory=dict)  # container -> its ends, when the last one was its host's
    why: str = ""  # it goes back; empty: it does not

    @property
    def good(self) -> bool:
        """Whether it is proven by now: not by a rate that nobody has counted."""
        return self.seconds >= self.step.soak and self.counted and not self.why

    def look(self, passed: float, ros: Backend) -> None:
        for member in self.step.members:
            self.with_host.update(ends_by_container(member.pods, with_host=True))
        self.why = "others of its step went back" if self.step.begun else ended(self.step, self.with_host)
        if self.why or not self.step.rolled_out:
            return
        counts = self.bad > 0 or self.looks % RATED == RATED - 1
        verdict = worse(look(ros, conditions_from(conditions(self.step, counts)), self.silence))
        if verdict is None:
            return
        self.counted = (counts or self.counted) and not verdict
        self.seconds, self.looks = self.seconds + passed, self.looks + 1
        self.bad = self.bad + 1 if verdict else 0
        self.why = verdict if self.bad >= LOOKS else ""


def soaked(known: Mapping[str, Soaking], steps: Iterable[Step], passed: float, ros: Backend) -> dict[str, Soaking]:
    """The steps that soak, by their keys, after a look at each; `known` are those of the look before."""
    found = {step.key: replace(known.get(step.key) or Soaking(step), step=step) for step in steps}
    for one in found.values():
        one.look(passed, ros)
    return found


def conditions(step: Step, rates: bool) -> Data:
    """Options of ros_ready: what the step's apps owe. A master owes nothing: nodes come to it, and go."""
    parts = [
        ros_contract.conditions(part)
        for member in step.members
        if member.name != MASTER
        for part in member.record.contract.parts
    ]
    found: Data = {key: [item for part in parts for item in part[key]] for key in LISTS}
    return found if rates else ros_contract.unstreamed(found)


def ended(step: Step, with_host: Mapping[str, int]) -> str:
    """Which container has ended since the run found it good, by its own fault.

    A host that starts anew begins each container once more, however often. Whatever one did until then is forgiven:
    the keeper would have seen it. `with_host`: container -> how many ends that were.
    """
    for member in step.members:
        faults = (error_of(pod) or ("137 (out of memory)" if was_out_of_memory(pod) else "") for pod in member.pods)
        code, ends = next(filter(None, faults), ""), ends_by_container(member.pods)
        times = sum(ends.values()) - max(member.record.ends, sum(with_host.get(one, 0) for one in ends))
        if times > 0 and (code or times > 1):  # somebody may have ended it once
            often = "once" if times == 1 else f"{times} times"
            return f"{member.name} ended {often}{f' with exit code {code}' if code else ''}"
        if any(map(crashes, member.pods)):
            return f"{member.name} crashes again and again"
    return ""


def worse(seen: Look) -> str | None:
    """What of the graph is not as it was, in words; None: it cannot be seen."""
    # a peer that does not answer says nothing of this version
    unmet = [check for check in seen.unmet if not check.observed.get("silent")]
    # registered, and no answer, neither a refusal: its host may be away
    silent = [one for one in unmet if one.kind == "node" and one.observed and not one.observed.get("refused")]
    if silent or any(check.kind == "master" for check in unmet):
        return None
    return "; ".join(map(str, unmet))
