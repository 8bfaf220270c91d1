# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the inventory wants and what the cluster has -> the steps of one robot's update, in order. Pure.

A step changes one app, or the apps of one group together, or the ROS master. It carries all that its tasks need: what
to apply, what was there before, the ROS nodes' old and new names, and what has to be idle first.
"""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any, Iterable, Mapping, Sequence

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.names import resolve
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.managed_fields import applied_part
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import context, names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import App, Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.conditions import graph_conditions
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.master import master_objects

MASTER = names.MASTER_NAME
HISTORY_KEY = "history.json"
CONTRACT_KEY = "contract.json"
# When apps of one step hand over in different ways, the one that asks for more care names the step.
HANDOFFS = ("overlap", "replace", "drain")

Object = Mapping[str, Any]
Key = tuple[str, str]


def update_plan(
    robot: Robot,
    deployments: Sequence[Object],
    updates: Sequence[Object] = (),
    only: Sequence[str] = (),
    shared: bool = True,
) -> dict[str, Any]:
    """`{steps, unchanged, orphans}` of a robot.

    `deployments` are those of the robot's namespace (and of `fleet`) as the API shows them, `updates` the ConfigMaps
    `<app>-update` of unfinished or earlier steps. `only` limits the plan to these apps (`ros-master` is the master);
    `shared` says whether this robot's run is the one that changes what belongs to the whole fleet.
    """
    live = {_key(item): item for item in deployments}
    desired = _desired(robot)
    unknown = sorted(set(only) - set(desired))
    if unknown:
        raise SpecError(f"{robot.name} has no app {', '.join(unknown)}; it has {', '.join(desired) or 'none'}")
    changed: list[str] = []
    unchanged: list[str] = []
    for app, objects in desired.items():
        if (not only or app in only) and (shared or not _is_shared(objects)):
            (changed if any(_differs(item, live) for item in _deployments(objects)) else unchanged).append(app)
    histories = read_histories(updates)
    return {
        "steps": [_step(robot, members, desired, live, histories) for members in ordered(robot.apps, changed)],
        "unchanged": unchanged,
        "orphans": sorted(key[1] for key in live if key not in _all_keys(desired)),
    }


def rollback_plan(  # noqa: PLR0913 - the same five inputs as update_plan, and where to
    robot: Robot,
    deployments: Sequence[Object],
    updates: Sequence[Object],
    only: Sequence[str] = (),
    shared: bool = True,
    to: str = "previous",
) -> dict[str, Any]:
    """The same for a way back: every app (or those of `only`) to its previous, or to the named revision.

    Apps without a history are `unchanged`, unless they were named, or a revision was: then it is an error that lists
    what there is.
    """
    live = {_key(item): item for item in deployments}
    histories = read_histories(updates)
    desired = _desired(robot)
    unknown = sorted(set(only) - set(desired))
    if unknown:
        raise SpecError(f"{robot.name} has no app {', '.join(unknown)}; it has {', '.join(desired) or 'none'}")
    target: dict[str, list[Any]] = {}
    for app in only or desired:
        if app == MASTER and app not in only:
            continue  # its own history goes back only when it is named: apps outlive their master's version
        if not shared and _is_shared(desired[app]):
            continue
        found = _earlier(histories.get(app, []), live, desired[app], to)
        if found is not None:
            target[app] = [found]
        elif app in only or to != "previous":
            raise SpecError(_no_history(app, robot.name, histories.get(app, []), to))
    changed = [app for app in target if any(_differs(item, live) for item in target[app])]
    steps = [_step(robot, members, target, live, histories, back=True) for members in ordered(robot.apps, changed)]
    return {"steps": steps, "unchanged": [app for app in desired if app not in changed], "orphans": []}


def _earlier(history: Sequence[Object], live: Mapping[Key, Object], objects: Sequence[Object], to: str) -> Any:
    """The Deployment of the history that is meant; the one that runs is no way back."""
    key = next(_key(item) for item in _deployments(objects))
    running = _hash(live[key]) if key in live else ""
    for entry in history:
        if _hash(entry["deployment"]) != running and to in ("previous", entry["revision"]):
            return entry["deployment"]
    return None


def _no_history(app: str, robot: str, history: Sequence[Object], to: str) -> str:
    known = ", ".join(f"{entry['revision']} ({entry.get('image', '?')})" for entry in history) or "none"
    wanted = "previous revision" if to == "previous" else f"revision {to}"
    return f"{robot}: app {app} has no {wanted} to go back to; kept: {known}"


def read_histories(updates: Iterable[Object]) -> dict[str, list[dict[str, Any]]]:
    """App -> what its ConfigMap `<app>-update` keeps, the last one first."""
    return {
        str(item["metadata"]["labels"][names.LABEL_APP]): json.loads((item.get("data") or {}).get(HISTORY_KEY) or "[]")
        for item in updates
        if names.LABEL_APP in (item["metadata"].get("labels") or {})
    }


def ordered(apps: Sequence[App], changed: Sequence[str]) -> list[list[str]]:
    """The changed apps as steps: the master first, apps of one group together, providers before their users.

    Within what the dependencies leave open the inventory's order counts. Validation has refused cycles.
    """
    unit = {app.name: app.update.group or f"app {app.name}" for app in apps}
    needs = {name: set[str]() for name in unit.values()}
    for app in apps:
        mine = unit[app.name]
        needs[mine] |= {unit[other] for other in app.depends_on if other in unit} - {mine}
    steps = [[MASTER]] if MASTER in changed else []
    done: set[str] = set()
    while len(done) < len(needs):
        ready = next((name for name in needs if name not in done and needs[name] <= done), None)
        if ready is None:
            raise SpecError(f"the apps depend on each other in a circle: {', '.join(sorted(set(needs) - done))}")
        done.add(ready)
        members = _by_dependency([app for app in apps if unit[app.name] == ready and app.name in changed])
        steps += [members] if members else []
    return steps


def _by_dependency(apps: Sequence[App]) -> list[str]:
    """The members of one group, providers first."""
    left = [app.name for app in apps]
    needs = {app.name: set(app.depends_on) & set(left) for app in apps}
    found: list[str] = []
    while left:
        ready = next((name for name in left if needs[name] <= set(found)), left[0])
        found.append(ready)
        left.remove(ready)
    return found


def _desired(robot: Robot) -> dict[str, list[dict[str, Any]]]:
    """App -> its objects, the master as the app `ros-master`."""
    found: dict[str, list[dict[str, Any]]] = {}
    master = master_objects(robot)
    if master:
        found[MASTER] = master
    for item in app_objects(robot):
        if item["kind"] == "Deployment":
            found.setdefault(item["metadata"]["name"], []).append(item)
    return found


def _step(  # noqa: PLR0913 - what is wanted, what is there, what was there: they have no common home
    robot: Robot,
    members: Sequence[str],
    desired: Mapping[str, Sequence[Object]],
    live: Mapping[Key, Object],
    histories: Mapping[str, list[dict[str, Any]]],
    back: bool = False,
) -> dict[str, Any]:
    objects = [item for app in members for item in desired[app]]
    apps = {app.name: app for app in robot.apps if app.name in members}
    handoffs = [app.handoff for app in apps.values()] or ["replace"]
    unfinished = any(_updating(live.get(_key(item))) for item in _deployments(objects))
    previous = _previous(members, objects, live, histories)
    new_nodes = {app: _node(item) for app in apps for item in _deployments(desired[app])}
    running = {
        app: _node(live[_key(item)]) for app in apps for item in _deployments(desired[app]) if _key(item) in live
    }
    old_nodes = {app: _node(previous[app]) for app in apps if app in previous} if unfinished else running
    return {
        "name": members[0] if len(members) == 1 else next(iter(apps.values())).update.group,
        "kind": "master" if members == [MASTER] else "app",
        "apps": list(members),
        "handoff": max(handoffs, key=HANDOFFS.index),
        "objects": objects,
        "previous": previous,
        "created": _created(members, objects, previous),
        "resume": unfinished and all(not _differs(item, live, resume=True) for item in _deployments(objects)),
        "new_nodes": new_nodes,
        "old_nodes": old_nodes,
        "renames": {old_nodes[app]: new for app, new in new_nodes.items() if old_nodes.get(app) and new},
        "actions": _actions(robot, list(apps.values()), "own"),
        "idle": _actions(robot, list(apps.values()), "idle"),
        "on_busy": next((app.update.on_busy for app in apps.values() if app.update.on_busy), None),
        "conditions": {} if back else graph_conditions(replace(robot, apps=tuple(apps.values()))),
        "from": {app: described(item) for app, item in previous.items()},
        "to": {app: described(item) for app in members for item in _deployments(desired[app])[:1]},
        "histories": {app: histories.get(app, []) for app in members},
    }


def _previous(
    members: Sequence[str],
    objects: Sequence[Object],
    live: Mapping[Key, Object],
    histories: Mapping[str, list[dict[str, Any]]],
) -> dict[str, Any]:
    """What to go back to, by app. A step that was cut off left an unproven version: then the history's last counts."""
    found: dict[str, Any] = {}
    for item in _deployments(objects):
        app, there = item["metadata"]["labels"][names.LABEL_APP], live.get(_key(item))
        if there is None or app not in members:
            continue
        if _updating(there):
            if histories.get(app):
                found[app] = histories[app][0]["deployment"]
        else:
            found.setdefault(app, kept(there))
    return found


def _created(members: Sequence[str], objects: Sequence[Object], previous: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The Deployments that the step makes anew: the way back deletes them."""
    return [
        {"apiVersion": item["apiVersion"], "kind": item["kind"],
         "metadata": {key: item["metadata"][key] for key in ("name", "namespace")}}
        for item in _deployments(objects)
        for app in [item["metadata"]["labels"][names.LABEL_APP]]
        if app in members and app not in previous
    ]  # fmt: skip


def kept(deployment: Object) -> dict[str, Any]:
    """A live Deployment in the form in which it can be applied again."""
    part = applied_part(deployment, names.MANAGER)
    if part is not None:
        return part
    # somebody else applied it: without what the API server keeps for itself it is what it was
    own = {"name", "namespace", "labels", "annotations"}
    metadata = {key: value for key, value in deployment["metadata"].items() if key in own}
    return {"apiVersion": "apps/v1", "kind": "Deployment", "metadata": metadata, "spec": deployment["spec"]}


def described(deployment: Object) -> dict[str, str]:
    """What an operator wants to read of a version."""
    template = deployment["spec"]["template"]
    images = [container.get("image", "") for container in template["spec"]["containers"]]
    return {"image": images[0] if images else "", "revision": revision_of(deployment)}


def revision_of(deployment: Object) -> str:
    """The first digits of the pod template's hash."""
    metadata = deployment["spec"]["template"]["metadata"]
    label = (metadata.get("labels") or {}).get(names.LABEL_REVISION)
    return str(label or (metadata.get("annotations") or {}).get(names.ANNOTATION_HASH, "")[:8])


def _actions(robot: Robot, apps: Sequence[App], which: str) -> list[str]:
    """Full names of the actions that the apps serve (`own`), or that have to rest while they change (`idle`)."""
    found: list[str] = []
    for app in apps:
        if which == "idle":
            given = list(app.update.idle)
        else:
            given = [item["name"] for item in app.readiness.actions] if app.handoff == "drain" else []
        namespace, node = context.graph_namespace(app, robot), context.graph_node(app, robot)
        found += [resolve(name, namespace, node) for name in given]
    return list(dict.fromkeys(found))


def _deployments(objects: Iterable[Object]) -> list[Any]:
    return [item for item in objects if item["kind"] == "Deployment"]


def _key(item: Object) -> Key:
    return str(item["metadata"]["namespace"]), str(item["metadata"]["name"])


def _all_keys(desired: Mapping[str, Sequence[Object]]) -> set[Key]:
    return {_key(item) for objects in desired.values() for item in _deployments(objects)}


def _is_shared(objects: Sequence[Object]) -> bool:
    return any(item["metadata"]["namespace"] == names.FLEET_NAMESPACE for item in objects)


def _annotations(item: Object | None) -> Mapping[str, str]:
    return ((item or {}).get("metadata") or {}).get("annotations") or {}


def _hash(item: Object | None) -> str:
    return _annotations(item).get(names.ANNOTATION_HASH, "")


def _updating(item: Object | None) -> bool:
    return names.ANNOTATION_UPDATING in _annotations(item)


def _differs(item: Object, live: Mapping[Key, Object], resume: bool = False) -> bool:
    """Whether it has to be changed, or (but for `resume`) a step on it was cut off."""
    there = live.get(_key(item))
    return there is None or _hash(there) != _hash(item) or (not resume and _updating(there))


def _node(deployment: Object) -> str:
    """The app's ROS node in the graph; empty where it has none that can be known."""
    return str((deployment["spec"]["template"]["metadata"].get("annotations") or {}).get(names.ANNOTATION_NODE, ""))
