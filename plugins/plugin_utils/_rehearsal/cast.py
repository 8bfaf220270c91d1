# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Who plays in a rehearsal: `ros_apps` before and after the change, stand-ins for all that stays. Pure."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.module_utils._pod import stand_in
from ansible_collections.rosops.fleet.plugins.module_utils._ros.recording import Recording
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.merge import deep_merge
from ansible_collections.rosops.fleet.plugins.plugin_utils._rehearsal.stand_ins import Node, Plan, plan

Item = dict[str, Any]  # of ros_apps

OTHERS = "rehearsal-others"  # plays the nodes that are no app's
DIRECTORY = "/opt/rosops-rehearsal"
PROGRAM, PLAN = f"{DIRECTORY}/stand_in.py", f"{DIRECTORY}/plan.json"


@dataclass(frozen=True)
class Stage:
    """What stand-ins need: an image with rospy, and what sets ROS' environment in it."""

    image: str
    command: tuple[str, ...] = ("/ros_entrypoint.sh",)


@dataclass(frozen=True)
class Cast:
    """`ros_apps` before and after."""

    before: tuple[Item, ...]
    after: tuple[Item, ...]


def cast(recording: Recording, items: Sequence[Mapping[str, Any]], changes: Mapping[str, Any], stage: Stage) -> Cast:
    """The changed apps are the inventory's own, all others of the recording are stand-ins."""
    own = {str(item.get("name")): item for item in items}
    unknown = sorted(set(changes) - set(own))
    if not changes or unknown:
        found = f"names {', '.join(unknown)}" if unknown else "is empty"
        allowed = ", ".join(sorted(own)) or "none"
        raise SpecError(f"rehearse_change {found}; it says what changes of which of this inventory's apps: {allowed}")
    parts = {name: app.nodes for name, app in recording.apps.items() if name not in changes}
    placements = {name: app.placement for name, app in recording.apps.items()}
    if recording.others:
        parts[OTHERS] = recording.others
    changed = {node for name in changes if name in recording.apps for node in recording.apps[name].nodes}
    asks = [name for name, service in recording.services.items() if service.provider in changed]
    extras: list[Item] = []
    for name, nodes in parts.items():
        part = plan(recording, nodes, () if extras else asks)
        extras.append(_stand_in(name, part, placements.get(name, "local"), stage))
    for item in extras[:1]:
        item.update(_parameters(recording))
    before = [dict(item) for name, item in own.items() if name in changes]
    after = [deep_merge(item, changes[str(item["name"])]) for item in before]
    return Cast((*extras, *before), (*extras, *after))


def _parameters(recording: Recording) -> Item:
    """Those whose values were recorded, set for all."""
    return {"params": dict(recording.values)} if recording.values else {}


def _stand_in(name: str, part: Plan, placement: str, stage: Stage) -> Item:
    text = json.dumps(part.as_dict(), indent=1, sort_keys=True)
    return {
        "name": name,
        "image": stage.image,
        "command": list(stage.command),
        "args": ["python3", PROGRAM, PLAN],
        "placement": placement,
        "handoff": "replace",
        "files": [{"path": PROGRAM, "content": program()}, {"path": PLAN, "content": text}],
        "readiness": _readiness(part.nodes),
    }


def program() -> str:
    """What stand-ins run."""
    return Path(stand_in.__file__).read_text("utf-8")


def _readiness(nodes: Sequence[Node]) -> Item:
    """All of it is there: nodes have the names that were recorded, not the app's."""
    published = {topic.name for node in nodes for topic in node.publishes}
    subscribed = {topic.name for node in nodes for topic in node.subscribes}
    topics = [
        {
            "name": name,
            **({"publishers": 1} if name in published else {}),
            **({"subscribers": 1} if name in subscribed else {}),
        }
        for name in sorted(published | subscribed)
    ]
    return {"nodes": False, "topics": topics, "services": [one.name for node in nodes for one in node.services]}
