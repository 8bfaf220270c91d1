# SPDX-License-Identifier: GPL-3.0-or-later
"""When a robot goes back without a control node, and to what. Pure: time is told to it, and what the API shows.

The rules are in docs/updates.md, "Two runs, and a run that ends early". No clock is compared with another one's, and
time counts only while the API shows what happens.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Iterable, Mapping, Sequence

from .._step.objects import (
    Object,
    annotations_of,
    app_of,
    crashes,
    duration_of,
    error_of,
    hash_of,
    holder_of,
    is_in,
    name_of,
    node_of,
    revision_of,
    revision_of_pod,
    rolled_out,
    suffix_of,
    version_of,
)
from .._step.record import PROVEN, UNPROVEN, Record, answer, mark_of
from .._step.update_record import by_run, went_back
from .._step.words import KEEPER, SOAKING, UPDATING, WENT_BACK

FORGIVEN = 600.0  # after so long without a crash the kubelet, too, counts a container's crashes anew


@dataclass(frozen=True)
class Member:
    """A marked Deployment, its record, what its version is, and its pods: of just this version, and of others."""

    deployment: Object
    record: Record
    state: str  # an answer of `_step/record.py`
    pods: Sequence[Object] = ()
    others: Sequence[Object] = ()

    @property
    def name(self) -> str:
        return name_of(self.deployment)

    @property
    def apps(self) -> tuple[str, ...]:
        """The apps of its step, in the step's order."""
        return self.record.apps or (self.name,)

    @property
    def before(self) -> Object | None:
        """The Deployment to go back to; None: the step made it."""
        found = self.record.before
        return found if found is not None and name_of(found) == self.name else None

    @property
    def proven(self) -> bool:
        """Its step has proven it: only its mark has to come off."""
        return self.state == PROVEN and self.record.revision == revision_of(self.deployment)

    @property
    def actions(self) -> frozenset[str]:
        """Those of its own node, and those of the others that a launch file starts."""
        return frozenset(name for part in self.record.contract.parts for name in part.actions)

    @property
    def nodes_before(self) -> set[str]:
        """Those of the version to go back to; of a launch file's the contract tells what it calls them."""
        if self.before is None:
            return set()
        if node_of(self.before):
            return {node_of(self.before)}
        new, old = suffix_of(self.deployment), suffix_of(self.before)
        named = self.record.contract.all_nodes
        return {(node[: -len(new)] if new and node.endswith(new) else node) + old for node in named}

    @property
    def differs(self) -> bool:
        """Whether going back would change something. What somebody changed by hand still has our hash."""
        if self.before is None:
            return False
        same = hash_of(self.before) == hash_of(self.deployment)
        return not (same and is_in(self.before["spec"], self.deployment["spec"]))


def member_of(deployment: Object, records: Mapping[str, Record], pods: Iterable[Object] = ()) -> Member:
    """`records`: app -> what its step left, those of all apps of the step among them; `pods` are its namespace's."""
    of_app = [pod for pod in pods if app_of(pod) == name_of(deployment)]
    own = [pod for pod in of_app if revision_of_pod(pod) == revision_of(deployment)]
    others = [pod for pod in of_app if pod not in own]
    record = records.get(name_of(deployment), Record())
    return Member(deployment, record, answer(deployment, records), own, others)


@dataclass(frozen=True)
class Step:
    """The marked Deployments that one step changed together. `begun`: others of them are back already."""

    members: tuple[Member, ...]
    begun: bool = False

    @property
    def name(self) -> str:
        return ", ".join(member.name for member in self.members)

    @property
    def key(self) -> str:
        """Other for every other version: its time begins anew."""
        found = [one.deployment["metadata"] for one in self.members]
        return " ".join(f"{one['name']}/{one.get('uid', '')}/{one.get('generation', 0)}" for one in found)

    @property
    def ready_timeout(self) -> float:
        return max(member.record.ready_timeout for member in self.members)

    @property
    def soak(self) -> float:
        return max(member.record.soak for member in self.members)

    @property
    def rolled_out(self) -> bool:
        return all(rolled_out(member.deployment) for member in self.members)

    def failing(self, came_up: bool) -> bool:
        """Whether it is to go back."""
        if not self.going_back or any(member.proven for member in self.members):
            return False
        bad = (any(map(crashes, one.pods)) if came_up else not rolled_out(one.deployment) for one in self.members)
        return self.begun or any(is_bad and one.differs for is_bad, one in zip(bad, self.members))

    @property
    def error(self) -> str:
        """Of a version that has not come up."""
        pods = [pod for one in self.members if not rolled_out(one.deployment) for pod in one.pods]
        return next(filter(None, map(error_of, pods)), "")

    @property
    def going_back(self) -> list[Member]:
        """All of it together, but what the step made, and what nobody has written down: to which could that go back?"""
        return [member for member in self.members if member.before is not None and member.state in UNPROVEN]


def steps_of(found: Iterable[Member], deployments: Iterable[Object]) -> list[Step]:
    """The steps that the marked ones belong to; `deployments` are all there are."""
    back = {name_of(item): went_back(item) for item in deployments if mark_of(item) is None}
    groups: dict[tuple[str, ...], list[Member]] = {}
    for member in found:
        if member.name != KEEPER:  # it takes back everything but itself
            groups.setdefault(member.apps, []).append(member)
    return [
        Step(
            tuple(sorted(members, key=lambda one: (*apps, one.name).index(one.name))),  # providers before their users
            any(by_run(back.get(app, {}), members[0].record.run) for app in apps),
        )
        for apps, members in groups.items()
    ]


# ---- since when


@dataclass
class Observed:
    """What was seen of one namespace, and for how long: its Lease, and the steps that are failing."""

    came_up: frozenset[str] = frozenset()  # keys of steps that were seen rolled out, by an earlier keeper, too
    version: str = ""  # the Lease's
    free: bool = False
    over: bool = False  # whoever has it has left it for its whole time
    # the Lease's version at which nothing was marked, and the record of updates said what became of the steps
    nothing: str | None = None
    waited: dict[str, float] = field(default_factory=dict)  # step -> how long it was failing,
    rested: dict[str, float] = field(default_factory=dict)  # and since then was not
    passed: float = 0.0  # since the look before
    _unchanged: float = 0.0
    _last: float | None = None

    def away(self) -> None:
        """The API did not answer: what happens until the next look does not count."""
        self._last = None

    def lease(self, lease: Object | None, now: float) -> None:
        """A look begins: whether somebody takes steps here. It is free where it has no holder, or stood still."""
        self.passed = 0.0 if self._last is None else now - self._last
        self._last = now
        version = version_of(lease)
        self._unchanged = self._unchanged + self.passed if version == self.version else 0.0
        self.version = version
        self.over = self._unchanged >= duration_of(lease)
        self.free = holder_of(lease) in ("", KEEPER) or self.over
        if not self.free:
            self.waited, self.nothing = {}, None

    def due(self, steps: Sequence[Step]) -> list[Step]:
        """The steps whose time is over, of all that there are."""
        before, self.came_up = self.came_up, frozenset(one.key for one in steps if one.rolled_out or self.up(one))
        failing = [step for step in steps if step.failing(self.up(step))]
        known = {key: seconds for key, seconds in self.waited.items() if key in before or key not in self.came_up}
        self.rested = {
            one.key: self.rested.get(one.key, 0.0) + self.passed
            for one in steps
            if one.key in known and one not in failing
        }
        resting = {key: known[key] for key, seconds in self.rested.items() if seconds < FORGIVEN}
        waiting = {one.key: known[one.key] + self.passed if one.key in known else 0.0 for one in failing}
        self.waited = {**resting, **waiting}
        late = {step.key for step in failing if self.waited[step.key] >= step.ready_timeout}
        return [step for step in failing if step.begun or self._died(step) or step.key in late]

    def _died(self, step: Step) -> str:
        return "" if self.up(step) else step.error

    def up(self, step: Step) -> bool:
        """Whether all of it was rolled out at some time."""
        return step.key in self.came_up

    def why(self, step: Step) -> str:
        code = self._died(step)
        if code:
            return f"ended with exit code {code}"
        return f"{'crashed again and again' if self.up(step) else 'not ready'} {self.waited[step.key]:.0f} s"


# ---- what is written


def restored(member: Member, reason: str, time: str) -> Object:
    """What to apply: the version before as it was applied, without the mark, and how it came back."""
    before = member.before or {}
    notes = {key: value for key, value in annotations_of(before).items() if key not in (UPDATING, SOAKING)}
    told = {"from": revision_of(member.deployment), "to": revision_of(before), "at": time, "reason": reason}
    notes[WENT_BACK] = json.dumps({**told, "run": member.record.run}, sort_keys=True)
    metadata = {**before["metadata"], "annotations": notes}
    there = member.deployment["metadata"].get("resourceVersion")  # refused if somebody has written it since
    return {**before, "metadata": {**metadata, **({"resourceVersion": there} if there else {})}}
