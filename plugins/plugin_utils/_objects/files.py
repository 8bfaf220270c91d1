# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""An app's files of the inventory -> the ConfigMap with their content, and the volumes of its pod. Pure.

A ConfigMap is named by what is in it and never changes: other content is another map, so another pod template and
another revision. The version before keeps its own map, for as long as there is a way back to it.
"""

from __future__ import annotations

from collections.abc import Iterable

from ...module_utils._step.objects import Object
from .._model import context, names
from .._model.app import App
from .._model.context import Robot
from .common import canonical_hash, config_map, mount, owner_labels

DIGITS = 8  # of the content's hash


def file_maps(robot: Robot) -> list[Object]:
    """A ConfigMap for each app that has files with a content, in the order of ros_apps."""
    found = []
    for app in robot.apps:
        content = _content(app)
        if content:
            labels = {**owner_labels(None if app.scope == "fleet" else robot.name), names.LABEL_FILES: app.name}
            made = config_map(_map_name(app), context.namespace_of(app, robot), labels, content)
            found.append({**made, "immutable": True})
    return found


def file_volumes(app: App) -> Iterable[tuple[Object, Object]]:
    """Pairs of a pod's volume and the container's mount of it, one for each file."""
    for number, item in enumerate(app.files):
        name = f"file-{number}"
        at = {"items": [{"key": item.key or name, "path": name}], "defaultMode": int(item.mode, 8)}
        source = (
            {"secret": {"secretName": item.secret, **at}}
            if item.secret
            else {"configMap": {"name": _map_name(app), **at}}
        )
        yield {"name": name, **source}, {**mount(name, item.path, read_only=True), "subPath": name}


def _content(app: App) -> dict[str, str]:
    """Key in the ConfigMap -> text."""
    return {f"file-{number}": item.content for number, item in enumerate(app.files) if not item.secret}


def _map_name(app: App) -> str:
    return names.files_name(app.name, canonical_hash(_content(app))[:DIGITS])
