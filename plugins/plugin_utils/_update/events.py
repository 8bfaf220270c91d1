# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The steps of a robot's update -> the ConfigMap from which the exporter tells metrics, annotations and logs. Pure.

It keeps the latest step of every app, so it does not grow. It is applied together with what a step applies anyway.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.outcomes import FAILED, ROLLED_BACK, UPDATED
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import StepResult

EVENTS_NAME = "robot-updates"
EVENTS_KEY = "updates.json"
RUNNING = "running"
ID_LENGTH = 12
REASON_KEPT = 1000  # a ConfigMap holds 1 MiB, and a metric's label and a log line less
CUT_OFF = "the run that began this step ended without a word"

Event = Mapping[str, Any]


def step_id(robot: str, apps: Sequence[str], started: float) -> str:
    """Names one step of one robot: the same from its begin to its end, whoever works it out."""
    text = json.dumps([robot, list(apps), f"{float(started):.6f}"])
    return hashlib.sha256(text.encode()).hexdigest()[:ID_LENGTH]


def events_map(
    results: Sequence[StepResult],
    robot: str,
    maps: Iterable[Mapping[str, Any]] = (),
    running: StepResult | None = None,
    went_back: Mapping[str, Mapping[str, str]] = MappingProxyType({}),
) -> dict[str, Any]:
    """The ConfigMap to apply. `went_back`: app -> how the keeper took it back, when nobody else did.

    `results` are the steps of this run that have ended, `running` is the one at hand (without outcome), `maps` are the
    ConfigMaps of the robot's namespace as they were before the run. What an earlier run left as running has failed:
    that run is gone, and an alert on it must not stay for ever.
    """
    known = [_closed(event, went_back.get(event["app"])) for event in known_events(maps, robot)]
    now = [event for result in results for event in _events(result)]
    now += [{**event, "outcome": RUNNING, "finished": None} for event in (_events(running) if running else [])]
    return {
        "apiVersion": "v1",
        "kind": "ConfigMap",
        "metadata": {
            "name": EVENTS_NAME,
            "namespace": names.robot_namespace(robot),
            "labels": {"app.kubernetes.io/managed-by": names.MANAGER, names.LABEL_ROBOT: robot},
        },
        # a line a value, so that --diff shows what is new and not the whole of it
        "data": {EVENTS_KEY: json.dumps({"updates": _latest([*known, *now])}, indent=1, sort_keys=True) + "\n"},
    }


def known_events(maps: Iterable[Mapping[str, Any]], robot: str) -> list[dict[str, Any]]:
    """What the robot's ConfigMap says. One that somebody spoilt is begun anew: history is not worth an update."""
    for item in maps:
        metadata = item.get("metadata") or {}
        if metadata.get("name") == EVENTS_NAME and metadata.get("namespace") == names.robot_namespace(robot):
            try:
                found = json.loads((item.get("data") or {}).get(EVENTS_KEY) or "{}")
                return [dict(event) for event in found["updates"] if event["app"] and float(event["started"]) >= 0]
            except (ValueError, KeyError, TypeError):
                return []
    return []


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


def ways_back(deployments: Iterable[Mapping[str, Any]]) -> dict[str, dict[str, str]]:
    """App -> `{from, to, at, reason}` of what the keeper took back, revisions and RFC 3339."""
    found = {}
    for item in deployments:
        text = (item["metadata"].get("annotations") or {}).get(names.ANNOTATION_WENT_BACK)
        with contextlib.suppress(ValueError, TypeError, AttributeError):  # others may write there, too
            told = json.loads(text) if text else {}
            if told:
                app = item["metadata"]["labels"][names.LABEL_APP]
                found[app] = {key: str(told.get(key, "")) for key in ("from", "to", "at", "reason")}
    return found


def back_in_words(told: Mapping[str, str]) -> str:
    """Why and when the keeper did it."""
    return f"the keeper went back from {told['from']} to {told['to']} at {told['at']}: {told['reason']}"


def _closed(event: Event, told: Mapping[str, str] | None) -> dict[str, Any]:
    if told and told["from"] == event.get("to") and event.get("outcome") != UPDATED:
        return {**_closed(event, None), "outcome": ROLLED_BACK, "reason": back_in_words(told)[:REASON_KEPT]}
    if event.get("outcome") != RUNNING:
        return dict(event)
    spent = sum(float(seconds) for seconds in (event.get("phases") or {}).values())
    return {**event, "outcome": FAILED, "reason": CUT_OFF, "finished": round(float(event["started"]) + spent, 3)}


def _latest(events: Iterable[Event]) -> list[dict[str, Any]]:
    """The last one of each app; what comes later in the list is later, whatever a clock that was set back says."""
    return [dict(event) for _app, event in sorted({str(event["app"]): event for event in events}.items())]
