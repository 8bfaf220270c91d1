# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where an app's image can be looked at before any node has it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.contents import Contents, Find
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import App
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.topology import members

Inside = Callable[[App], Contents | None]


def inside(robot: str, groups: Mapping[str, Any], hosts: Mapping[str, Mapping[str, Any]], find: Find) -> Inside:
    """What an app of the robot finds in its image: by the archives of the hosts on which it may run."""

    def look(app: App) -> Contents | None:
        places = [robot] if app.placement == "local" else members(groups, "edge")
        return find([path for host in places for path in _archives(hosts.get(host, {}))], app.image)

    return look


def _archives(variables: Mapping[str, Any]) -> list[str]:
    """The paths in `images_archives`, which may be wrong in part."""
    given = variables.get("images_archives")
    items = given if isinstance(given, list) else []
    return [item["path"] for item in items if isinstance(item, Mapping) and isinstance(item.get("path"), str)]
