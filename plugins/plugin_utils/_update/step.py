# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The decisions within one step of an update (see _update_plan): what must hold, what to apply. Pure."""

from __future__ import annotations

import json
from typing import Any, Iterable, Mapping, Sequence

from ansible_collections.rosops.fleet.plugins.module_utils._ros import contract as _contract
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.archive import normal_ref
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.plan import node_images
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.common import object_labels
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.plan import (
    CONTRACT_KEY,
    HISTORY_KEY,
    described,
    revision_of,
)

HISTORY_KEPT = 5
LISTS = ("nodes", "topics", "services", "actions", "absent", "edges")

Object = Mapping[str, Any]


def step_contracts(step: Object, graph: Object, updates: Iterable[Object] = ()) -> dict[str, dict[str, Any]]:
    """App -> its part of the graph, under the names that the new revision will have.

    A step that is taken up again finds the old nodes gone or going, so what was recorded when it began counts. The
    master's part is everything that is registered with it.
    """
    if step["resume"]:
        kept = {str(item["metadata"]["name"]): item.get("data") or {} for item in updates}
        return {app: json.loads(kept.get(names.update_name(app), {}).get(CONTRACT_KEY) or "{}") for app in step["apps"]}
    if step["kind"] == "master":
        return {app: _contract.record(graph, sorted(graph["nodes"]), {}) for app in step["apps"]}
    return {
        app: _contract.record(graph, [old for old in [step["old_nodes"].get(app)] if old], step["renames"])
        for app in step["apps"]
    }


def step_problems(step: Object, graph: Object) -> list[str]:
    """What forbids the step, seen on the graph before anything is touched."""
    problems = []
    for app, node in step["new_nodes"].items():
        there = graph["nodes"].get(node) or {}
        if there.get("reachable") and node != step["old_nodes"].get(app) and not step["resume"]:
            problems.append(
                f"another node is up under the name {node} that the new revision of {app} will have ({there['uri']}); "
                "stop it, or change node_name"
            )
    return problems


def step_warnings(step: Object, graph: Object) -> list[str]:
    """What the step cannot keep from being noticed: connections that their clients keep open and cannot renew."""
    nodes = set(step["old_nodes"].values())
    return [
        f"service {name} of {', '.join(service['providers'])} has {service['connections']} open connections: a "
        "persistent ServiceProxy does not reconnect by itself, its client fails until it is made anew"
        for name, service in sorted(graph["services"].items())
        if nodes & set(service["providers"]) and service.get("connections")
    ]


def actions_to_rest(step: Object, graph: Object) -> list[dict[str, str]]:
    """Options of ros_action_hold: what has to be idle before the step. An action that nobody serves cannot be busy.

    `server` stands where the step replaces it: goals that come meanwhile are for the next one.
    """
    old, found = set(step["old_nodes"].values()), []
    for name in dict.fromkeys([*step["actions"], *step["idle"]]):
        action = graph["actions"].get(name) or {}
        replaced = [server for server in action.get("servers") or [] if server in old and name in step["actions"]]
        if action.get("up"):
            found.append({"name": name, **({"server": replaced[0]} if replaced else {})})
    return found


def step_conditions(
    step: Object, contracts: Mapping[str, Object], tolerance: float, back: bool = False
) -> dict[str, Any]:
    """Options of ros_ready: the contracts are restored, and the new revisions' own readiness holds.

    With `back` the contracts hold under the old names again, whatever the new revision promised. Rates are left out
    there: there is no third version to go to from an old one that is slower than it was.
    """
    old = {new: before for before, new in step["renames"].items()}
    recorded = [contract for contract in contracts.values() if contract]
    if back:
        found = _united([_contract.conditions(_all_renamed(contract, old), tolerance) for contract in recorded])
        found["topics"] = [{key: topic[key] for key in topic if key != "min_rate"} for topic in found["topics"]]
        return found
    gone = sorted(set(step["old_nodes"].values()) - set(step["new_nodes"].values()) - {""})
    parts = [step["conditions"], *(_contract.conditions(contract, tolerance) for contract in recorded)]
    return _united(parts, absent=gone if step["handoff"] == "overlap" else ())


def renamed_graph(graph: Object, steps: Iterable[Object]) -> dict[str, Any]:
    """What was recorded before the first step, under the names that the finished steps have given."""
    renames = {old: new for step in steps for old, new in step["renames"].items()}
    found: dict[str, Any] = _all_renamed(dict(graph), renames) if renames else dict(graph)
    return found


def _all_renamed(value: Any, renames: Mapping[str, str]) -> Any:
    """Every graph name in a contract after the nodes' renaming."""
    if isinstance(value, str):
        return _contract.renamed(value, renames)
    if isinstance(value, list):
        return [_all_renamed(item, renames) for item in value]
    if isinstance(value, dict):
        return {_all_renamed(key, renames): _all_renamed(item, renames) for key, item in value.items()}
    return value


def _united(parts: Sequence[Mapping[str, Any]], absent: Sequence[str] = ()) -> dict[str, Any]:
    found: dict[str, Any] = {key: [] for key in LISTS}
    for part in parts:
        for key in LISTS:
            found[key] += [item for item in part.get(key) or [] if item not in found[key]]
    found["absent"] += [node for node in absent if node not in found["absent"]]
    return found


def update_objects(  # noqa: PLR0913 - the settings of one run, each with its own meaning
    step: Object,
    contracts: Mapping[str, Object],
    tolerance: float,
    now: float,
    seconds: float,
    run: str,
) -> list[dict[str, Any]]:
    """What to apply: the contracts and the way back first, then the new versions.

    `now` is the time in seconds since 1970; the pods hold to the contract for `seconds` from then. `run` marks the
    Deployments until the version is proven.
    """
    objects = [
        _update_map(app, step, contracts.get(app) or {}, {"tolerance": tolerance, "until": int(now + seconds)}, now)
        for app in step["apps"]
    ]
    return [*objects, *marked(step["objects"], run)]


def _update_map(
    app: str, step: Object, contract: Mapping[str, Any], bounds: Mapping[str, Any], now: float
) -> dict[str, Any]:
    deployment = next(item for item in step["objects"] if _is_app(item, app))
    metadata = deployment["metadata"]
    content = {**contract, **bounds, "revision": revision_of(deployment)} if contract else {}
    labels = object_labels(app, metadata["labels"].get(names.LABEL_ROBOT))
    return {
        "apiVersion": "v1",
        "kind": "ConfigMap",
        "metadata": {"name": names.update_name(app), "namespace": metadata["namespace"], "labels": labels},
        "data": {
            CONTRACT_KEY: json.dumps(content, sort_keys=True),
            HISTORY_KEY: json.dumps(_history(app, step, now), sort_keys=True),
        },
    }


def _history(app: str, step: Object, now: float) -> list[dict[str, Any]]:
    """Earlier versions, the last proven one first, each once."""
    before = step["previous"].get(app)
    if before is None:
        return list(step["histories"].get(app, []))
    first = {"revision": revision_of(before), **described(before), "replaced": int(now), "deployment": before}
    rest = [entry for entry in step["histories"].get(app, []) if entry["revision"] != first["revision"]]
    return [first, *rest][:HISTORY_KEPT]


def marked(objects: Iterable[Object], run: str) -> list[dict[str, Any]]:
    """The objects with the mark of an unproven version on the Deployments."""
    found = []
    for item in objects:
        if item["kind"] == "Deployment":
            annotations = {**(item["metadata"].get("annotations") or {}), names.ANNOTATION_UPDATING: run}
            found.append({**item, "metadata": {**item["metadata"], "annotations": annotations}})
        else:
            found.append(dict(item))
    return found


def images_missing(step: Object, listings: Mapping[str, str]) -> list[str]:
    """Images of remote pods that an edge host lacks; `listings` is edge host -> what `crictl images -o json` says.

    A remote pod may be placed on any of them. What is on the robot the role images has seen to.
    """
    present = {host: node_images(listing) for host, listing in listings.items()}
    problems = []
    for item in step["objects"]:
        pod = item["spec"]["template"]["spec"] if item["kind"] == "Deployment" else {}
        if names.LABEL_PLACEMENT in (pod.get("nodeSelector") or {}):
            for container in [*(pod.get("initContainers") or []), *pod["containers"]]:
                lacking = [host for host, images in present.items() if normal_ref(container["image"]) not in images]
                if lacking:
                    problems.append(f"the image {container['image']} is not on {', '.join(lacking)}")
    return list(dict.fromkeys(problems))


def step_gate(
    step: Object, graph: Object, updates: Iterable[Object] = (), images: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """What is known before a step: `{contracts, problems, warnings, actions}`."""
    return {
        "contracts": step_contracts(step, graph, updates),
        "problems": [*step_problems(step, graph), *images_missing(step, images or {})],
        "warnings": step_warnings(step, graph),
        "actions": actions_to_rest(step, graph),
    }


def _is_app(item: Object, app: str) -> bool:
    return bool(item["kind"] == "Deployment" and item["metadata"]["labels"].get(names.LABEL_APP) == app)
