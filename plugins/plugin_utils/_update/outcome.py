# SPDX-License-Identifier: GPL-3.0-or-later
"""What became of a step and of a robot, and the ConfigMap in which the robot's exporter reads it. Pure.

From the ConfigMap the exporter tells metrics, annotations and logs. It keeps the latest step of every app, so it does
not grow. It is applied together with what a step applies anyway.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Annotated, Any

from ...module_utils._common.errors import printable
from ...module_utils._step import update_record
from ...module_utils._step.update_record import NEWS, REASON_KEPT, RUNNING, closed, data_of, events_of
from .._model import names
from .._model.keys import plain, read
from .._model.outcomes import BUSY, FAILED, OFFLINE, ROLLED_BACK, UNCHANGED, UPDATED
from .._objects.common import config_map, owner_labels

# The word that an operator has to know first stands first.
WAITING = update_record.WAITING  # no outcome yet: the run comes back to this robot
WORST_FIRST = (FAILED, ROLLED_BACK, OFFLINE, BUSY, WAITING, UPDATED, UNCHANGED)
# What a run leaves where it cannot go on, and could not go back.
UNPROVEN = "it runs unproven beside the way back; the next run proves it or takes it back"
EVENTS_NAME = update_record.NAME
ID_LENGTH = 12

Event = Mapping[str, Any]


def step_id(robot: str, apps: Sequence[str], started: float) -> str:
    """Names one step of one robot: the same from its begin to its end, whoever works it out."""
    text = json.dumps([robot, list(apps), f"{float(started):.6f}"])
    return hashlib.sha256(text.encode()).hexdigest()[:ID_LENGTH]


@dataclass(frozen=True)
class StepResult:
    """A step that has ended, or the one at hand: without an outcome, or WAITING. `phases` are seconds by name."""

    id: str = ""
    name: str = ""
    apps: tuple[str, ...] = ()
    handoff: str = ""
    before: Mapping[str, Mapping[str, str]] = field(default_factory=dict)  # app -> image and revision
    after: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    started: Annotated[float, float] = 0.0  # since 1970
    phases: Mapping[str, Annotated[float, float]] = field(default_factory=dict)
    outcome: str = ""
    reason: str = ""

    def as_dict(self) -> dict[str, Any]:
        """As the report and the record of updates have it."""
        told: dict[str, Any] = plain(self)
        sides = {"from": told.pop("before"), "to": told.pop("after")}
        return {**told, **sides, "busy_wait": self.phases.get("wait", 0.0), "reason": printable(self.reason)}

    @classmethod
    def from_dict(cls, told: Mapping[str, Any]) -> StepResult:
        """What `as_dict` made of it; AttributeError, TypeError or ValueError for what is of another shape."""
        return read(cls, {**told, "before": told.get("from"), "after": told.get("to")})

    def told(self) -> str:
        """`temperature lab/apps:1.0 -> lab/apps:1.1 in 6.1 s`."""
        parts = []
        for app in self.apps:
            old, new = self.before.get(app, {}).get("image", "new"), self.after.get(app, {}).get("image", "removed")
            revision = self.after.get(app, {}).get("revision", "")
            parts.append(f"{app} {old} -> {new}" if old != new else f"{app} {new} ({revision})")
        text = f"{', '.join(parts)} in {sum(self.phases.values()):.1f} s"
        return f"{text}; {self.reason}" if self.reason else text


@dataclass(frozen=True)
class RobotOutcome:
    """The word for the robot, why, and its steps."""

    outcome: str
    reason: str = ""
    steps: Sequence[StepResult] = ()

    def as_dict(self) -> dict[str, Any]:
        """As the task returns it and the report reads it."""
        steps = [step.as_dict() for step in self.steps]
        return {"outcome": self.outcome, "reason": printable(self.reason), "steps": steps}

    @classmethod
    def from_dict(cls, told: Mapping[str, Any]) -> RobotOutcome:
        """What `as_dict` made of it; AttributeError, TypeError or ValueError for what is of another shape."""
        steps = tuple(StepResult.from_dict(step) for step in told.get("steps") or ())
        return cls(str(told.get("outcome") or ""), str(told.get("reason") or ""), steps)


def robot_outcome(results: Sequence[StepResult], steps: int) -> RobotOutcome:
    """Of a robot whose plan had so many steps; the first one that does not end well is the last one begun."""
    words = [result.outcome for result in results]
    outcome = next((word for word in WORST_FIRST if word in words), UNCHANGED)
    good = outcome in (UPDATED, UNCHANGED)
    reasons = [
        result.told() if good else f"{result.name}: {result.reason}" for result in results if result.outcome == outcome
    ]
    left = steps - len(results)
    if left > 0:
        reasons.append(f"{left} further step{'s' if left > 1 else ''} not begun")
    return RobotOutcome(outcome, "; ".join(reasons), tuple(results))


# --- the record of a robot's updates --------------------------------------------------------------------------------


def events_map(
    results: Sequence[StepResult],
    robot: str,
    maps: Iterable[dict[str, Any]] = (),
    went_back: Mapping[str, Mapping[str, str]] = MappingProxyType({}),
) -> dict[str, Any]:
    """The ConfigMap to apply.

    `results` are the steps of this run, `maps` are the ConfigMaps of the robot's namespace as they were before the run,
    `went_back` is app -> how the keeper took it back. What an earlier run left as running has failed: that run is gone,
    and an alert on it must not stay for ever.
    """
    events = [closed(event, went_back.get(event["app"])) for event in known_events(maps, robot)]
    # a run tells what is new in it, and only once
    events = [{key: value for key, value in event.items() if key != NEWS} for event in events]
    events += [event for result in results for event in _events(result)]
    # what comes later in the list is later, whatever a clock that was set back says
    latest = sorted({str(event["app"]): event for event in events}.items())
    namespace = names.robot_namespace(robot)
    return config_map(EVENTS_NAME, namespace, owner_labels(robot), data_of([event for _app, event in latest]))


def known_events(maps: Iterable[dict[str, Any]], robot: str) -> list[dict[str, Any]]:
    """What the robot's ConfigMap says."""
    wanted = EVENTS_NAME, names.robot_namespace(robot)
    there = (item for item in maps if (item["metadata"]["name"], item["metadata"].get("namespace")) == wanted)
    return next((events_of(item) for item in there), [])


def _events(result: StepResult) -> list[dict[str, Any]]:
    """A step's result as one event per app."""
    told = result.as_dict()
    # not the time at which this is worked out: the same step gives the same bytes in every later apply
    finished = round(result.started + sum(result.phases.values()), 3)
    whole = {key: told[key] for key in ("id", "handoff", "phases", "busy_wait")}
    whole |= {"step": result.name, "outcome": result.outcome or RUNNING, "reason": told["reason"][:REASON_KEPT]}
    whole |= {"started": round(result.started, 3)}
    whole |= {"finished": None if result.outcome in ("", WAITING) else finished}
    return [
        {**whole, "app": app, **_version("from", app, result.before), **_version("to", app, result.after)}
        for app in result.apps
    ]


def _version(side: str, app: str, versions: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """Empty for what was not there before."""
    found = versions.get(app, {})
    return {side: found.get("revision", ""), f"{side}_image": found.get("image", "")}
