# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks of the order in which a robot's apps are updated: who depends on whom, and which apps go together."""

from __future__ import annotations

from typing import Any, Iterator, Mapping

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.finding import Problem, join_path
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.explain import nearest_name


def dependency_problems(ctx: Mapping[str, Any], apps: list[tuple[str, Any]]) -> Iterator[Problem]:
    """Dependencies on oneself, on apps that are not there, and circles; `apps` are pairs of a path and an app."""
    declared = [raw["name"] for raw in ctx["declared_apps"] if isinstance(raw.get("name"), str)]
    for path, app in apps:
        for index, other in enumerate(app["depends_on"]):
            where = join_path(path, "depends_on", index)
            if other == app["name"]:
                yield Problem(where, "is the app itself", "other apps of this robot")
            elif other not in declared:
                nearest = nearest_name(other, declared)
                hint = f"; did you mean {nearest}?" if nearest else ""
                yield Problem(
                    where, f"is '{other}', an unknown app{hint}", f"an app of this robot: {', '.join(declared)}"
                )
    yield from _circles(apps)


def _circles(apps: list[tuple[str, Any]]) -> Iterator[Problem]:
    """Apps of one group change in one step, so between groups an order is needed, and inside one as well."""
    by_name = {app["name"]: (path, app) for path, app in apps}
    groups = {name: app["update"]["group"] for name, (_path, app) in by_name.items()}
    unit = {name: f"group {group}" if group else name for name, group in groups.items()}
    inside: dict[str, list[str]] = {name: [] for name in by_name}
    between: dict[str, list[str]] = {name: [] for name in unit.values()}
    for name, (_path, app) in by_name.items():
        for other in app["depends_on"]:
            if other in by_name and other != name:
                (inside[name].append(other) if unit[other] == unit[name] else between[unit[name]].append(unit[other]))
    for needs in (inside, between):
        circle = _circle(needs)
        if circle:
            (member, *_others) = [name for name in by_name if circle[0] in (name, unit[name])]
            found = f"makes a circle: {' needs '.join([*circle, circle[0]])}"
            yield Problem(f"{by_name[member][0]}.depends_on", found, "an order in which the apps can be updated")


def _circle(needs: Mapping[str, list[str]]) -> list[str]:
    """The members of one circle, beginning with the first in the order of `needs`; empty if there is none."""
    left = {name: [other for other in others if other in needs] for name, others in needs.items()}
    while True:
        free = [name for name, others in left.items() if not any(other in left for other in others)]
        if not free:
            break
        for name in free:
            del left[name]
    if not left:
        return []
    # everybody who is left needs somebody who is left: following them must come back
    way = [next(iter(left))]
    while True:
        following = next(other for other in left[way[-1]] if other in left)
        if following in way:
            circle = way[way.index(following) :]
            first = min(circle, key=list(needs).index)
            return [*circle[circle.index(first) :], *circle[: circle.index(first)]]
        way.append(following)
