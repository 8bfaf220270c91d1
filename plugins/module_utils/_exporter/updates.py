# SPDX-License-Identifier: GPL-3.0-or-later
"""The record of updates -> metrics, and one line of log for each that is new.

The record is a file that others write (the ConfigMap `robot-updates`): what makes no sense in it is left out.
"""

from __future__ import annotations

import contextlib
import json
from dataclasses import dataclass
from typing import Mapping

from .._common.documents import Document, json_of
from .families import Family, family

FILE = "/etc/rosops-fleet/updates/updates.json"
# A line is repeated after a restart of the exporter only for what happened just before: the record holds the latest
# update of each app for ever.
RECENT = 600.0
MAX_FILE = 1 << 20


SAID = ("id", "app", "handoff", "outcome", "reason", "from", "to", "started", "finished", "phases", "busy_wait")


@dataclass(frozen=True)
class Update:
    """The latest one of an app. Times are in seconds since 1970, None where nobody knows them yet."""

    line: str  # of JSON, which is how an update gets into the logs
    before: str  # revisions
    after: str
    started: float | None
    finished: float | None
    busy_wait: float | None
    phases: Mapping[str, float]  # seconds
    id: str
    app: str
    handoff: str
    outcome: str


def parse(text: str) -> list[Update]:
    """The well-formed entries, one per app."""
    try:
        entries = list(json_of(text)["updates"])
    except (ValueError, KeyError, TypeError):
        return []
    found: dict[str, Update] = {}
    for entry in entries:
        with contextlib.suppress(AttributeError, KeyError, TypeError, ValueError):  # it is none
            found[entry["app"]] = _update(entry)
    return [found[app] for app in sorted(found, key=str)]


def _update(entry: Document) -> Update:
    def time(key: str) -> float | None:
        return None if entry.get(key) is None else float(entry[key])

    texts = {key: str(entry[key]) for key in ("id", "app", "handoff", "outcome")}
    phases = {str(name): float(seconds) for name, seconds in (entry.get("phases") or {}).items()}
    sides = str(entry.get("from") or ""), str(entry.get("to") or "")
    line = json.dumps({"event": "update", **{key: entry.get(key) for key in SAID}}, sort_keys=True)
    return Update(line, *sides, time("started"), time("finished"), time("busy_wait"), phases, **texts)


def families(updates: list[Update]) -> list[Family]:
    def of(key: str) -> dict[str, float]:
        return {one.app: getattr(one, key) for one in updates if getattr(one, key) is not None}

    known = {(one.app, one.id, one.after, one.before, one.handoff, one.outcome): 1 for one in updates}
    phases = {(one.app, phase): took for one in updates for phase, took in one.phases.items()}
    told = "The latest update of an app and its outcome"
    return [
        family("robot_update_info", told, "app id revision previous handoff outcome", known),
        family("robot_update_started_timestamp_seconds", "When it began", "app", of("started")),
        family("robot_update_finished_timestamp_seconds", "When it ended; none while it runs", "app", of("finished")),
        family("robot_update_phase_seconds", "How long a phase of it took", "app phase", phases),
        family("robot_update_busy_wait_seconds", "How long it waited for a busy app", "app", of("busy_wait")),
    ]


class Updates:
    """The file as it was last read, and which of its lines were said."""

    def __init__(self, path: str = FILE) -> None:
        self.path = path
        self.entries: list[Update] = []
        self.said: set[tuple[str, str]] | None = None  # None: nothing was read yet

    def read(self, now: float) -> list[str]:
        """Look at the file; the lines of log for what is new in it."""
        try:
            with open(self.path, encoding="utf-8") as file:  # noqa: PTH123 - pathlib is not worth its memory here
                self.entries = parse(file.read(MAX_FILE))
        except FileNotFoundError:
            self.entries = []
        except (OSError, UnicodeError):
            return []  # being replaced: the next look will do
        if self.said is None:
            new = [one for one in self.entries if abs(now - (one.finished or one.started or 0.0)) < RECENT]
        else:
            new = [one for one in self.entries if (one.id, one.outcome) not in self.said]
        # only the latest: the record does not grow, and neither may this
        self.said = {(one.id, one.outcome) for one in self.entries}
        return [one.line for one in new]
