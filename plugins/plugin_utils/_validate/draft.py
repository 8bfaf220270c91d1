# SPDX-License-Identifier: GPL-3.0-or-later
"""What an operator has written, and what can be looked at of a robot whose variables may be wrong in part."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from .._model.app import App
from .._model.context import Robot
from .._model.finding import join_path
from .._model.topology import Groups, members

Said = Mapping[str, Any]  # a mapping of the inventory: a host's variables, an app, an archive
Hosts = Mapping[str, Said]  # variables by host


class Inventory(NamedTuple):
    """Groups, hosts with their variables, where one of these is malformed, and the modes of the robots."""

    groups: Groups
    hosts: Hosts
    bad: Mapping[str, Collection[str]]
    modes: Mapping[str, str]

    def variable(self, host: str, name: str) -> Any:
        """What is said of a host; None where nothing is."""
        return self.hosts.get(host, {}).get(name)

    @property
    def edge_cluster(self) -> list[str]:
        """The hosts of the shared cluster, servers and agents."""
        return [*members(self.groups, "edge"), *(robot for robot, mode in self.modes.items() if mode == "agent")]

    def sound(self, host: str, *parts: str | int) -> bool:
        """Whether nothing is malformed at and below a path of a host's variables."""
        path = join_path("hosts", host, *parts)
        return not any(item == path or item.startswith((path + ".", path + "[")) for item in self.bad.get(host, ()))

    def draft(self, robot: str) -> Draft:
        """The draft of a robot; a malformed app is left out instead of keeping the others from being looked at."""
        variables, storage = self.hosts.get(robot, {}), self.variable(robot, "persistent_storage")
        apps, volumes = _listed(variables, "ros_apps"), _listed(storage, "volumes")
        sound = [at for at in range(len(apps)) if self.sound(robot, "ros_apps", at)]
        whole = [item for at, item in enumerate(volumes) if self.sound(robot, "persistent_storage", "volumes", at)]
        kept = {name: value for name, value in variables.items() if self.sound(robot, name)}
        kept |= {"ros_apps": [apps[at] for at in sound], "persistent_storage": {"volumes": whole}}
        made = Robot.from_variables(kept, robot)
        return Draft(
            made,
            tuple((f"hosts.{robot}.ros_apps[{at}]", app, apps[at]) for at, app in zip(sound, made.apps, strict=True)),
            tuple(app if isinstance(app, dict) else {} for app in apps),
            tuple(item.get("name") for item in volumes if isinstance(item, dict)),
        )


def _listed(said: Any, key: str) -> list[Any]:
    """What should be a list; empty where it is none."""
    found = said.get(key) if isinstance(said, dict) else None
    return found if isinstance(found, list) else []


@dataclass(frozen=True)
class Draft:
    """A robot made of what the schema accepts, and what its owner declared beside that.

    What is declared wrongly is still there: such a volume is not unknown as well, and such an app has its name.
    `apps`: each with its path, as it is completed, and as its owner wrote it.
    """

    robot: Robot
    apps: tuple[tuple[str, App, Said], ...]
    declared_apps: tuple[Said, ...]
    declared_volumes: tuple[Any, ...]

    @property
    def path(self) -> str:
        """Where the robot's variables are."""
        return f"hosts.{self.robot.name}"
