# SPDX-License-Identifier: GPL-3.0-or-later
"""The fleet arm's inventory: the cases' apps as a user of the collection writes them. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from .scenario import ENTRY, PROBE, PROGRAMS, REQUESTED, TEMPERATURE, App

LEAST_RATE = 0.95  # of what it sends, as the demo asks for


def variables(apps: Iterable[App]) -> dict[str, Any]:
    """Group variables of `robots`."""
    master = {"name": "ros-master-container", "resources": {"requests": dict(REQUESTED)}}
    return {
        "ros_apps": [item(app) for app in apps],
        "ros_master_overrides": {"spec": {"template": {"spec": {"containers": [master]}}}},
        "persistent_storage": {"volumes": [{"name": name, "size": "1Gi"} for name in ("robot-logs", "edge-logs")]},
    }


def item(app: App) -> dict[str, Any]:
    """One item of ros_apps."""
    found: dict[str, Any] = {
        "name": app.name,
        "image": app.image,
        "command": [ENTRY, f"{PROGRAMS}/{app.program}"],
        "env": {"LOG_DIR": app.log_dir, **app.env},
        "placement": app.placement,
        "volumes": [{"name": app.volume, "shared": True}],  # a file of its own for each process
        "resources": {"requests": dict(REQUESTED)},
        "readiness": readiness(app),
    }
    if app.remaps:
        found["args"] = list(app.remaps)
    if app.pattern:
        found["pattern"] = app.pattern
    if app.group:
        found["update"] = {"group": app.group}
    return found


def readiness(app: App) -> Mapping[str, Any]:
    """What the app promises."""
    promised: dict[str, Any] = {"command": PROBE, "timeout": 120}
    if app.topic and app.publishes:
        least = LEAST_RATE * float(app.env["RATE_HZ"])
        promised["topics"] = [{"name": app.topic, "type": TEMPERATURE, "publishers": 1, "min_rate": least}]
    elif app.topic:
        promised["topics"] = [{"name": app.topic, "subscribers": 1, "connected": True}]
    if app.service:
        promised["services"] = [app.service]
    if app.action:
        promised["actions"] = [app.action]
    return promised
