# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks of the order in which a robot's apps are updated: who depends on whom, and which apps go together."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from .._model.app import App
from .._model.finding import Problem, join_path
from .._model.order import circle
from .draft import Draft
from .explain import did_you_mean


def dependency_problems(draft: Draft) -> Iterator[Problem]:
    """Dependencies on oneself, on apps that are not there, and circles."""
    declared = [raw["name"] for raw in draft.declared_apps if isinstance(raw.get("name"), str)]
    apps = {app.name: (path, app) for path, app, _raw in draft.apps()}
    for path, app, _raw in draft.apps():
        for index, other in enumerate(app.depends_on):
            where = join_path(path, "depends_on", index)
            if other == app.name:
                yield Problem(where, "is the app itself", "other apps of this robot")
            elif other not in declared:
                found = f"is '{other}', an unknown app{did_you_mean(other, declared)}"
                yield Problem(where, found, f"an app of this robot: {', '.join(declared)}")
    yield from _circles(apps)


def _circles(apps: Mapping[str, tuple[str, App]]) -> Iterator[Problem]:
    """Apps of one group change in one step, so between groups an order is needed, and inside one as well."""
    unit = {name: f"group {app.update.group}" if app.update.group else name for name, (_path, app) in apps.items()}
    inside: dict[str, list[str]] = {name: [] for name in apps}
    between: dict[str, list[str]] = {name: [] for name in unit.values()}
    for name, (_path, app) in apps.items():
        for other in app.depends_on:
            if other in apps and other != name:
                (inside[name].append(other) if unit[other] == unit[name] else between[unit[name]].append(unit[other]))
    for needs in (inside, between):
        if members := circle(needs):
            member, *_others = [name for name in apps if members[0] in (name, unit[name])]
            found = f"makes a circle: {' needs '.join([*members, members[0]])}"
            yield Problem(f"{apps[member][0]}.depends_on", found, "an order in which the apps can be updated")
