# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The images that a robot's workloads run. Pure."""

from __future__ import annotations

from .._model import names
from .._model.context import Robot
from .app import app_objects
from .master import master_objects


def images(robot: Robot, placement: str | None = None) -> list[str]:
    """The images of the robot's master and apps, sorted; with `placement` those of local or of remote pods only."""
    found: set[str] = set()
    for item in [*master_objects(robot), *app_objects(robot)]:
        pod = item["spec"]["template"]["spec"] if item["kind"] == "Deployment" else {}
        where = "local" if names.LABEL_ROBOT in (pod.get("nodeSelector") or {}) else "remote"
        if placement in (None, where):
            containers = [*(pod.get("initContainers") or []), *(pod.get("containers") or [])]
            found.update(container["image"] for container in containers if container.get("image"))
    return sorted(found)
