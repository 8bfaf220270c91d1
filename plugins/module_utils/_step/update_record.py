# SPDX-License-Identifier: GPL-3.0-or-later
"""The record of a robot's updates (ConfigMap `robot-updates`), as far as the keeper has a word in it. Pure.

Runs write it, with the latest step of each app. What a run left open when it went is closed by whoever sees it first:
the keeper, or the next run.
"""

from __future__ import annotations

import json
from typing import Any, Dict, Iterable, Mapping

from .._common.documents import json_of
from .objects import Object, annotations_of, app_of
from .record import Record
from .words import WENT_BACK

NAME, KEY = "robot-updates", "updates.json"
RUNNING, WAITING = "running", "waiting"  # no outcomes yet; a run that waits for a busy robot lets go of its Lease
UPDATED, ROLLED_BACK, FAILED = "updated", "rolled-back", "failed"
NEWS = "news"  # stands in an event that the keeper closed, until a run has told of it
REASON_KEPT = 1000  # a ConfigMap holds 1 MiB, and a metric's label and a log line less
CUT_OFF = "the run that began this step ended without a word"

Event = Dict[str, Any]
Told = Mapping[str, str]  # from, to: revisions; at: RFC 3339; reason; run


def events_of(record: Object) -> list[Event]:
    """One of each app. A record that somebody spoilt is begun anew: history is not worth an update."""
    try:
        found = json_of((record.get("data") or {}).get(KEY) or "{}")
        return [dict(event) for event in found["updates"] if event["app"] and _seconds(event) >= 0]
    except (ArithmeticError, AttributeError, KeyError, TypeError, ValueError):
        return []


def _seconds(event: Mapping[str, Any]) -> float:
    """When it ended, or would have."""
    return float(event["started"]) + sum(float(seconds) for seconds in (event.get("phases") or {}).values())


def data_of(events: Iterable[Event]) -> dict[str, str]:
    """A line a value, so that --diff shows what is new and not the whole of it."""
    return {KEY: json.dumps({"updates": list(events)}, indent=1, sort_keys=True) + "\n"}


def ways_back(deployments: Iterable[Object], records: Mapping[str, Record] | None = None) -> dict[str, Told]:
    """App -> what the keeper said of it when it took it back.

    With `records` only of the step that they are of: `kubectl rollout undo` brings an old note back.
    """
    found = {app_of(item): told for item in deployments if (told := went_back(item))}
    if records is None:
        return found
    return {app: told for app, told in found.items() if app in records and by_run(told, records[app].run)}


def went_back(item: Object) -> Told:
    """What the keeper wrote on a Deployment; empty where it did not, or others wrote there, too."""
    try:
        told = json_of(annotations_of(item).get(WENT_BACK) or "{}")
        return {key: str(told.get(key, "")) for key in ("from", "to", "at", "reason", "run")} if told else {}
    except (ValueError, AttributeError):
        return {}


def by_run(told: Told, run: str) -> bool:
    """Whether it is of this run's step. Keepers before 1.0 did not say of which."""
    return bool(told) and told["run"] in ("", run)


def run_of(started: float) -> str:
    """What a step is called in its records and marks: no two of one robot begin in the same second."""
    return str(int(round(float(started), 3)))


def back_in_words(told: Told) -> str:
    """Why and when the keeper did it."""
    return f"the keeper went back from {told['from']} to {told['to']} at {told['at']}: {told['reason']}"


def closed(event: Event, told: Told | None) -> Event:
    """What became of a step whose run is gone. `told`: how the keeper took the app back, when nobody else did."""
    # one that was found good has failed in its soak
    good = event.get("outcome") == UPDATED
    if told and told["from"] == event.get("to") and (told["run"] == run_of(event["started"]) if good else True):
        return {**closed(event, None), "outcome": ROLLED_BACK, "reason": back_in_words(told)[:REASON_KEPT]}
    if event.get("outcome") not in (RUNNING, WAITING):
        return dict(event)
    return {**event, "outcome": FAILED, "reason": CUT_OFF, "finished": round(_seconds(event), 3)}


def ended(record: Object, deployments: Iterable[Object]) -> Object | None:
    """The record to apply once nobody has the robot's Lease any more; None: it says what is so.

    It is refused if somebody has written it since.
    """
    before, back = events_of(record), ways_back(deployments)
    after = [event if event.get("outcome") == WAITING else closed(event, back.get(event["app"])) for event in before]
    now = [new if new == old else {**new, NEWS: True} for old, new in zip(before, after)]
    if now == before:
        return None
    return anew(record, data_of(now))


def anew(found: Object, data: Mapping[str, str]) -> Object:
    """A ConfigMap to apply with other data; it is refused if somebody has written it since."""
    metadata = {key: found["metadata"].get(key) for key in ("name", "namespace", "labels", "resourceVersion")}
    return {"apiVersion": "v1", "kind": "ConfigMap", "metadata": metadata, "data": dict(data)}
