# SPDX-License-Identifier: GPL-3.0-or-later
"""Robots for tests, from what an inventory would say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.fleet import Fleet
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.topology import fleet_topology


def robot(
    *apps: Mapping[str, Any],
    name: str = "robot1",
    mode: str | None = None,
    volumes: Sequence[Mapping[str, Any]] = (),
    master: Mapping[str, Any] | None = None,
    **more: Any,
) -> Robot:
    """A robot with these items of ros_apps; `master` is ros_master_*.

    What else is given is robot_namespace_*, but for `observability`, and for update_* where it begins so.
    """
    variables = {
        "robot_mode": mode,
        "ros_apps": list(apps),
        "persistent_storage": {"volumes": list(volumes)},
        **{f"ros_master_{key}": value for key, value in (master or {}).items()},
        **{
            key if key.startswith(("update_", "observability")) else f"robot_namespace_{key}": value
            for key, value in more.items()
        },
    }
    return Robot.from_variables(variables, name)


def fleet(groups: Mapping[str, Sequence[str]], hostvars: Mapping[str, Mapping[str, Any]]) -> Fleet:
    """The fleet of an inventory's groups and variables."""
    robots = {name: Robot.from_variables(hostvars[name], name) for name in groups["robots"]}
    modes = {name: one.mode for name, one in robots.items()}
    return Fleet(robots, fleet_topology(groups, modes), tuple(groups["edge"]))


def fleet_of(*robots: Robot) -> dict[str, Any]:
    """The variables that an action plugin finds once the fleet `production` of these robots was validated."""
    made = {one.name: one for one in robots}
    hosts = fleet_topology({"edge": ["edge1"], "robots": list(made)}, {name: one.mode for name, one in made.items()})
    return {"fleet": Fleet(made, hosts, ("edge1",), "production").as_dict()}
