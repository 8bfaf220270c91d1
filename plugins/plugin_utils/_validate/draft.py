# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What can be looked at of a robot whose variables may be wrong in part."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from .._model.app import App
from .._model.context import Robot
from .._model.finding import Problem, join_path
from .said import Said


@dataclass(frozen=True)
class Draft:
    """A robot made of what the schema accepts, and what its owner declared beside that.

    What is declared wrongly is still there: such a volume is not unknown as well, and such an app has its name.
    `positions` are the places of the robot's apps in ros_apps.
    """

    robot: Robot
    positions: tuple[int, ...]
    declared_apps: tuple[Said, ...]
    declared_volumes: tuple[Any, ...]

    @property
    def path(self) -> str:
        """Where the robot's variables are."""
        return f"hosts.{self.robot.name}"

    def apps(self) -> Iterator[tuple[str, App, Said]]:
        """Each app with its path, as it is completed and as its owner wrote it."""
        for app, position in zip(self.robot.apps, self.positions):
            yield join_path(self.path, "ros_apps", position), app, self.declared_apps[position]


def draft(robot: str, variables: Said, wrong: Sequence[Problem]) -> Draft:
    """The draft of a robot; a malformed app is left out instead of keeping the others from being looked at."""
    bad = {problem.path for problem in wrong}

    def sound(*parts: str | int) -> bool:
        path = join_path("hosts", robot, *parts)
        return not any(item == path or item.startswith((path + ".", path + "[")) for item in bad)

    apps, storage = variables.get("ros_apps"), variables.get("persistent_storage")
    apps = apps if isinstance(apps, list) else []
    volumes = storage.get("volumes") if isinstance(storage, dict) else None
    volumes = volumes if isinstance(volumes, list) else []
    positions = tuple(index for index in range(len(apps)) if sound("ros_apps", index))
    kept = {name: value for name, value in variables.items() if sound(name)}
    kept["ros_apps"] = [apps[index] for index in positions]
    kept["persistent_storage"] = {
        "volumes": [item for index, item in enumerate(volumes) if sound("persistent_storage", "volumes", index)]
    }
    declared = tuple(app if isinstance(app, dict) else {} for app in apps)
    return Draft(
        Robot.from_variables(kept, robot),
        positions,
        declared,
        tuple(item.get("name") for item in volumes if isinstance(item, dict)),
    )
