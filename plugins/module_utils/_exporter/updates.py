# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The record of updates -> metrics, and one line of log for each that is new.

The record is a file that others write (the ConfigMap `robot-updates`): what makes no sense in it is left out.
"""

from __future__ import annotations

import json
from typing import Any, Mapping

from .families import GAUGE, Family, Sample

FILE = "/etc/rosops-fleet/updates/updates.json"
TEXTS = ("id", "app", "handoff", "outcome")
OPTIONAL_TEXTS = ("reason", "from", "to")
# A line is repeated after a restart of the exporter only for what happened just before: the record holds the latest
# update of each app for ever.
RECENT = 600.0
MAX_FILE = 1 << 20


def parse(text: str) -> list[dict[str, Any]]:
    """The well-formed entries, one per app."""
    try:
        content = json.loads(text)
    except ValueError:
        return []
    listed = content.get("updates") if isinstance(content, dict) else None
    found: dict[str, dict[str, Any]] = {}
    for entry in listed if isinstance(listed, list) else ():
        if isinstance(entry, dict) and all(isinstance(entry.get(key), str) for key in TEXTS):
            found[entry["app"]] = _clean(entry)
    return [found[app] for app in sorted(found)]


def _clean(entry: Mapping[str, Any]) -> dict[str, Any]:
    phases = entry.get("phases")
    return {
        **{key: entry[key] for key in TEXTS},
        **{key: entry[key] if isinstance(entry.get(key), str) else "" for key in OPTIONAL_TEXTS},
        **{key: _number(entry.get(key)) for key in ("started", "finished", "busy_wait")},
        "phases": {
            str(name): seconds
            for name, seconds in ((name, _number(raw)) for name, raw in phases.items())
            if seconds is not None
        }
        if isinstance(phases, dict)
        else {},
    }


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else None


def families(updates: list[dict[str, Any]]) -> list[Family]:
    """The latest update of each app."""

    def of(key: str) -> list[Sample]:
        return [({"app": entry["app"]}, entry[key]) for entry in updates if entry[key] is not None]

    info = [
        (
            {
                "app": entry["app"],
                "id": entry["id"],
                "revision": entry["to"],
                "previous": entry["from"],
                "handoff": entry["handoff"],
                "outcome": entry["outcome"],
            },
            1.0,
        )
        for entry in updates
    ]
    phases = [
        ({"app": entry["app"], "phase": phase}, seconds)
        for entry in updates
        for phase, seconds in sorted(entry["phases"].items())
    ]
    return [
        Family("robot_update_info", GAUGE, "The latest update of an app and its outcome", info),
        Family("robot_update_started_timestamp_seconds", GAUGE, "When it began", of("started")),
        Family("robot_update_finished_timestamp_seconds", GAUGE, "When it ended; none while it runs", of("finished")),
        Family("robot_update_phase_seconds", GAUGE, "How long a phase of it took", phases),
        Family("robot_update_busy_wait_seconds", GAUGE, "How long it waited for a busy app", of("busy_wait")),
    ]


class Updates:
    """The file as it was last read, and which of its lines were said."""

    def __init__(self, path: str = FILE) -> None:
        self.path = path
        self.entries: list[dict[str, Any]] = []
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
        new = [entry for entry in self.entries if (entry["id"], entry["outcome"]) not in self.said]
        # only the latest: the record does not grow, and neither may this
        self.said = {(entry["id"], entry["outcome"]) for entry in self.entries}
        first, self.began = not self.began, True
        return [line(entry) for entry in new if not first or now - _last(entry) < RECENT]


def _last(entry: Mapping[str, Any]) -> float:
    return float(entry["finished"] or entry["started"] or 0.0)


def line(entry: Mapping[str, Any]) -> str:
    """One line of JSON, which is how an update gets into the logs."""
    return json.dumps({"event": "update", **entry}, sort_keys=True)
