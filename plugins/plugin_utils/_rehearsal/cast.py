# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Who plays in a rehearsal: the apps that change are the inventory's own, all others are stand-ins. Pure."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ...module_utils._common.errors import SpecError
from ...module_utils._rehearsal import stand_in
from .recording import Part

Item = Mapping[str, Any]  # of ros_apps

DIRECTORY = "/opt/rosops-rehearsal"
PROGRAM, PLAN = f"{DIRECTORY}/stand_in.py", f"{DIRECTORY}/plan.json"


def changed(now: Sequence[Item], then: Sequence[Item]) -> list[str]:
    """The apps that differ between two lists."""
    before, after = ({str(item["name"]): item for item in items} for items in (now, then))
    found = [name for name in {**before, **after} if before.get(name) != after.get(name)]
    if not found:
        told = "what is next changes none of this inventory's apps; a variable that is given with -e stays as it is"
        raise SpecError(f"{told}: {', '.join(before) or 'none'}")
    return found


def cast(parts: Mapping[str, Part], items: Sequence[Item], real: Sequence[str], image: str) -> list[Item]:
    """`ros_apps`: those of these items that are real, and stand-ins, in `image`, for all other parts."""
    extras = [_stand_in(name, part, image) for name, part in parts.items() if name not in real]
    return [*extras, *(item for item in items if item["name"] in real)]


def _stand_in(name: str, part: Part, image: str) -> Item:
    plan = json.dumps({"nodes": [asdict(node) for node in part.nodes]}, indent=1, sort_keys=True)
    program = Path(stand_in.__file__).read_text("utf-8")
    return {
        "name": name,
        "image": image,
        "command": ["/ros_entrypoint.sh"],
        "args": ["python3", PROGRAM, PLAN],
        "placement": part.placement,
        "handoff": "replace",
        "files": [{"path": PROGRAM, "content": program}, {"path": PLAN, "content": plan}],
        "readiness": _readiness(part),
    }


def _readiness(part: Part) -> Item:
    """All of it is there: nodes have the names that were recorded, not the app's."""
    topics: dict[str, dict[str, str | int]] = {}
    for node in part.nodes:
        for kind, found in (("publishers", node.publishes), ("subscribers", node.subscribes)):
            for topic in found:
                topics.setdefault(topic.name, {"name": topic.name})[kind] = 1
    services = [one.name for node in part.nodes for one in node.services]
    return {"nodes": False, "topics": list(topics.values()), "services": services}
