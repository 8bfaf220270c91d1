# SPDX-License-Identifier: GPL-3.0-or-later
"""The record of updates -> metrics, and one line of log for each that is new.

The record is a file that others write (the ConfigMap `robot-updates`): what makes no sense in it is left out.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields
from typing import Any, Mapping

from .._common.documents import Data, Document
from .families import Family, family

FILE = "/etc/rosops-fleet/updates/updates.json"
# A line is repeated after a restart of the exporter only for what happened just before: the record holds the latest
# update of each app for ever.
RECENT = 600.0
MAX_FILE = 1 << 20


@dataclass(frozen=True)
class Update:
    """The latest one of an app. Times are in seconds since 1970, None where nobody knows them yet."""

    id: str
    app: str
    handoff: str
    outcome: str
    reason: str
    before: str  # revisions
    after: str
    started: float | None
    finished: float | None
    busy_wait: float | None
    phases: Mapping[str, float]  # seconds

    @property
    def last(self) -> float:
        return self.finished or self.started or 0.0

    def line(self) -> str:
        """One line of JSON, which is how an update gets into the logs."""
        told = {_WORDS.get(key, key): value for key, value in asdict(self).items()}
        return json.dumps({"event": "update", **told}, sort_keys=True)


_WORDS = {"before": "from", "after": "to"}  # as the record has it
_NEEDED, _TIMES = ("id", "app", "handoff", "outcome"), ("started", "finished", "busy_wait")


def parse(text: str) -> list[Update]:
    """The well-formed entries, one per app."""
    try:
        content = json.loads(text)
    except ValueError:
        return []
    listed = content.get("updates") if isinstance(content, dict) else None
    entries = [entry for entry in (listed if isinstance(listed, list) else ()) if isinstance(entry, dict)]
    good = [entry for entry in entries if all(isinstance(entry.get(key), str) for key in _NEEDED)]
    found = {entry["app"]: _update(entry) for entry in good}
    return [found[app] for app in sorted(found)]


def _update(entry: Document) -> Update:
    said = {one.name: entry.get(_WORDS.get(one.name, one.name)) for one in fields(Update)}
    phases = said.pop("phases")
    read = {str(name): _number(raw) for name, raw in phases.items()} if isinstance(phases, dict) else {}
    known: Data = {
        key: _number(value) if key in _TIMES else value if isinstance(value, str) else "" for key, value in said.items()
    }
    return Update(**known, phases={name: seconds for name, seconds in read.items() if seconds is not None})


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else None


def families(updates: list[Update]) -> list[Family]:
    """The latest update of each app."""

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
        self.said: set[tuple[str, str]] = set()
        self.began = False

    def read(self, now: float) -> list[str]:
        """Look at the file; the lines of log for what is new in it."""
        try:
            with open(self.path, encoding="utf-8") as file:  # noqa: PTH123 - pathlib is not worth its memory here
                self.entries = parse(file.read(MAX_FILE))
        except FileNotFoundError:
            self.entries = []
        except (OSError, UnicodeError):
            return []  # being replaced: the next look will do
        new = [entry for entry in self.entries if (entry.id, entry.outcome) not in self.said]
        # only the latest: the record does not grow, and neither may this
        self.said = {(entry.id, entry.outcome) for entry in self.entries}
        first, self.began = not self.began, True
        return [entry.line() for entry in new if not first or now - entry.last < RECENT]
