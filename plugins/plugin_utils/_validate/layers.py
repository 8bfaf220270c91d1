# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot's apps in layers: those of the fleet, what its model has of its own, and what it has itself. Pure.

Ansible takes a variable from one place only, so each layer has a name of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TypeGuard

from .._model.finding import Problem, join_path
from .._model.merge import PATCH, deep_merge
from .said import Said

APPS = "ros_apps"
LAYERS = ("ros_apps_model", "ros_apps_robot")  # the later one counts


def layered(variables: Said, path: str, problems: list[Problem]) -> Said:
    """The host's variables with all its apps in `ros_apps`. A layer of another shape stays: its schema says so."""
    merged = dict(variables)
    for layer in LAYERS:
        apps, more = merged.get(APPS, []), merged.get(layer)
        if _named(apps) and _named(more):
            problems += _missing(apps, more, join_path(path, layer))
            merged[APPS] = deep_merge({APPS: apps}, {APPS: more})[APPS]
            del merged[layer]
    return merged


def _named(apps: object) -> TypeGuard[list[Said]]:
    return isinstance(apps, list) and all(isinstance(app, Mapping) and isinstance(app.get("name"), str) for app in apps)


def _missing(apps: list[Said], more: list[Said], path: str) -> Iterator[Problem]:
    there = [app["name"] for app in apps]
    for index, app in enumerate(more):
        if app.get(PATCH) == "delete" and app["name"] not in there:
            found = f"takes away {app['name']}, which no layer before has"
            yield Problem(join_path(path, index), found, f"one of {', '.join(there)}" if there else "nothing")
