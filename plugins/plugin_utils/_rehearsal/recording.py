# SPDX-License-Identifier: GPL-3.0-or-later
"""What record.yml has kept of a robot -> what the stand-in of each of its apps plays (`_rehearsal/stand_in.py`). Pure.

The apps that change in a rehearsal are the inventory's own, all others are stand-ins.

Left out is what the contract of an update leaves out, too: tools that somebody has open, the keeper, /rosout, the
services of loggers, and nodes that do not answer. Names are those that hold for every version.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...module_utils._common.errors import SpecError
from ...module_utils._pod.launch import stable
from ...module_utils._rehearsal import stand_in
from ...module_utils._ros.contract import LOGGERS, known
from ...module_utils._ros.graph import Graph, Topic, host_of, names_of
from ...module_utils._ros.graph_json import graph_from
from ...module_utils._ros.names import is_tool

KIND, VERSION = "rosops.fleet/recording", 1
OTHERS = "rehearsal-others"  # plays the nodes that are no app's
LOG_NODE, LOG_TOPICS = "/rosout", ("/rosout", "/rosout_agg")
Recorded = Mapping[str, Any]  # an app, or the graph, as the file has it
Item = Mapping[str, Any]  # of ros_apps
Node = Mapping[str, Any]  # as the stand-in reads it: name, publishes, subscribes and services
DIRECTORY = "/opt/rosops-rehearsal"
PROGRAM, PLAN = f"{DIRECTORY}/stand_in.py", f"{DIRECTORY}/plan.json"
# Of an action, in Hz, whoever listens. A goal of zeros would begin work in a server, and nobody asked for it.
RATES = {"goal": 0.0, "cancel": 0.0, "status": 5.0}


@dataclass(frozen=True)
class Part:
    """What one stand-in plays, and where."""

    placement: str
    nodes: tuple[Node, ...]


def parts(data: Any, where: str) -> dict[str, Part]:
    """App -> its part, `OTHERS` for the nodes of no app; SpecError, in which `where` says what was read."""
    if not isinstance(data, Mapping) or data.get("kind") != KIND:
        raise SpecError(f"{where} is no recording of a robot's graph: rosops.fleet.record makes one")
    if data.get("version") != VERSION:
        raise SpecError(f"{where} is of version {data.get('version')}, not {VERSION}: record the robot again")
    try:
        graph = {part: data["graph"][part] for part in ("nodes", "topics", "services", "actions")}
        return _parts(data["apps"], graph_from(graph))
    except (ArithmeticError, AttributeError, KeyError, TypeError, ValueError) as error:
        told = f"{type(error).__name__}: {error}"
        raise SpecError(f"{where} is damaged ({told}): record the robot again") from error


def _parts(apps: list[Recorded], graph: Graph) -> dict[str, Part]:
    at: dict[str, list[str]] = {}
    for app in apps:
        for address in app["addresses"]:
            at.setdefault(address, []).append(app["name"])
    nodes: dict[str, dict[str, Node]] = {}
    for name in graph.names:
        node = graph.node(name)
        if node.reachable and name != LOG_NODE and not is_tool(name):
            owners = at.get(host_of(node.uri), [])  # several share the address of a host, which tells nothing
            own = nodes.setdefault(owners[0] if len(owners) == 1 else OTHERS, {})
            own[stable(name)] = _node(graph, name)
    placements = {app["name"]: str(app["placement"]) for app in apps}
    return {app: Part(placements.get(app, "local"), tuple(own.values())) for app, own in sorted(nodes.items())}


def _node(graph: Graph, node: str) -> Node:
    topics = {name: topic for name, topic in sorted(graph.topics.items()) if name not in LOG_TOPICS}
    subscribes = [
        {"name": stable(name), "type": known(one.type), "md5sum": known(one.md5sum)}
        for name, one in topics.items()
        if node in names_of(one.subscribers)
    ]
    services = [
        {"name": stable(name), "type": known(one.said.type), "md5sum": known(one.said.md5sum)}
        for name, one in sorted(graph.services.items())
        if one.up and one.said.provider == node and not name.endswith(LOGGERS)
    ]
    publishes = [*_published(graph, topics, node)]
    return {"name": stable(node), "publishes": publishes, "subscribes": subscribes, "services": services}


def _published(graph: Graph, topics: Mapping[str, Topic], node: str) -> Iterator[dict[str, object]]:
    """A topic's publishers have an even share of its rate: messages per second, 0 sends none, or, where it is latched,
    one. One whose type nobody told cannot be played."""
    fixed = {f"{action}/{word}": hz for action in graph.actions for word, hz in RATES.items()}
    for name, topic in topics.items():
        if node in names_of(topic.publishers) and known(topic.type) and known(topic.md5sum):
            rate = fixed.get(name, float(topic.rate or 0) / len(topic.publishers))
            told = {"name": stable(name), "type": topic.type, "definition": str(topic.definition)}
            yield {**told, "latched": bool(topic.latched), "rate": rate}


# ---- the cast


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
    plan = json.dumps({"nodes": part.nodes}, indent=1, sort_keys=True)
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
        for kind, key in (("publishers", "publishes"), ("subscribers", "subscribes")):
            for topic in node[key]:
                topics.setdefault(topic["name"], {"name": topic["name"]})[kind] = 1
    services = [one["name"] for node in part.nodes for one in node["services"]]
    return {"nodes": False, "topics": list(topics.values()), "services": services}
