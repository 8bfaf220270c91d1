# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The steps of a robot's update -> the ConfigMap from which the exporter tells metrics, annotations and logs. Pure.

It keeps the latest step of every app, so it does not grow. It is applied together with what a step applies anyway.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from ...module_utils._step import update_record
from ...module_utils._step.update_record import NEWS, REASON_KEPT, RUNNING, closed, data_of, events_of
from .._model import names
from .outcome import StepResult

EVENTS_NAME = update_record.NAME
ID_LENGTH = 12

Event = Mapping[str, Any]


def step_id(robot: str, apps: Sequence[str], started: float) -> str:
    """Names one step of one robot: the same from its begin to its end, whoever works it out."""
    text = json.dumps([robot, list(apps), f"{float(started):.6f}"])
    return hashlib.sha256(text.encode()).hexdigest()[:ID_LENGTH]


def events_map(
    results: Sequence[StepResult],
    robot: str,
    maps: Iterable[dict[str, Any]] = (),
    running: StepResult | None = None,
    went_back: Mapping[str, Mapping[str, str]] = MappingProxyType({}),
) -> dict[str, Any]:
    """The ConfigMap to apply. `went_back`: app -> how the keeper took it back, when nobody else did.

    `results` are the steps of this run that have ended, `running` is the one at hand (no outcome, or that it waits for
    the robot), `maps` are the
    ConfigMaps of the robot's namespace as they were before the run. What an earlier run left as running has failed:
    that run is gone, and an alert on it must not stay for ever.
    """
    known = [_told(closed(event, went_back.get(event["app"]))) for event in known_events(maps, robot)]
    now = [event for result in results for event in _events(result)]
    now += [{**event, "finished": None} for event in (_events(running) if running else [])]
    return {
        "apiVersion": "v1",
        "kind": "ConfigMap",
        "metadata": {
            "name": EVENTS_NAME,
            "namespace": names.robot_namespace(robot),
            "labels": {"app.kubernetes.io/managed-by": names.MANAGER, names.LABEL_ROBOT: robot},
        },
        "data": data_of(_latest([*known, *now])),
    }


def known_events(maps: Iterable[dict[str, Any]], robot: str) -> list[dict[str, Any]]:
    """What the robot's ConfigMap says."""
    for item in maps:
        metadata = item.get("metadata") or {}
        if metadata.get("name") == EVENTS_NAME and metadata.get("namespace") == names.robot_namespace(robot):
            return events_of(item)
    return []


def _told(event: Event) -> dict[str, Any]:
    """A run tells what is new in it, and only once."""
    return {key: value for key, value in event.items() if key != NEWS}


def _events(result: StepResult) -> list[dict[str, Any]]:
    """A step's result as one event per app."""
    # not the time at which this is worked out: the same step gives the same bytes in every later apply
    finished = round(result.started + sum(result.phases.values()), 3)
    return [
        {
            "id": result.id,
            "app": app,
            "step": result.name,
            "handoff": result.handoff,
            "outcome": result.outcome or RUNNING,
            "reason": result.reason[:REASON_KEPT],
            # empty for what was not there before
            "from": result.before.get(app, {}).get("revision", ""),
            "to": result.after.get(app, {}).get("revision", ""),
            "from_image": result.before.get(app, {}).get("image", ""),
            "to_image": result.after.get(app, {}).get("image", ""),
            "started": round(result.started, 3),
            "finished": finished,
            "phases": dict(result.phases),
            "busy_wait": result.phases.get("wait", 0.0),
        }
        for app in result.apps
    ]


def _latest(events: Iterable[Event]) -> list[dict[str, Any]]:
    """The last one of each app; what comes later in the list is later, whatever a clock that was set back says."""
    return [dict(event) for _app, event in sorted({str(event["app"]): event for event in events}.items())]
