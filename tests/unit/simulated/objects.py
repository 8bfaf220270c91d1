# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot's objects as the API shows them, for the tests of the update."""

from __future__ import annotations

import copy
import json
from collections.abc import Collection
from dataclasses import replace
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._step import words
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import revision_of
from ansible_collections.rosops.fleet.plugins.module_utils._step.record import Mark
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.master import master_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.plan import (
    Plan,
    Request,
    placed,
    rendered,
    update_plan,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.revisions import Key, kept
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Live, Object
from ansible_collections.rosops.fleet.tests.unit.robots import robot

ADDRESSES = {names.MASTER_NAME: "10.43.0.17", names.KEEPER_NAME: "10.43.0.18"}


def addressed(made: Robot) -> Robot:
    """A robot whose master's Services are there."""
    return made if made.master.mode == "external" else replace(made, master=replace(made.master, addresses=ADDRESSES))


def app(name: str, image: str = "example.org/app:1.0", **more: Any) -> dict[str, Any]:
    return {"name": name, "image": image, "command": ["run"], "pattern": "pubsub", **more}


def versions(*apps: dict[str, Any], **more: Any) -> list[Robot]:
    """A robot with the first version of these apps, and with the next one; `more` is the robot's own."""
    return [robot(*({**one, "image": f"x.org/a:{number}"} for one in apps), **more) for number in (1, 2)]


def planned(wanted: Robot, live: Live, request: Request | None = None, drifted: Collection[Key] = ()) -> Plan:
    made = placed(wanted, live, unlabelled=False)
    return update_plan(made, rendered(made), live, request or Request(), drifted)


def applied(context: Robot, *maps: dict[str, Any]) -> Live:
    """The Deployments of a robot as the API shows them after they were applied, and its ConfigMaps."""
    found: list[dict[str, Any]] = []
    for item in [*master_objects(context), *app_objects(context)]:
        if item["kind"] == "Deployment":
            there = copy.deepcopy(item)
            there["metadata"] |= {"managedFields": [field_set(item)], "uid": "1"}
            there["metadata"]["annotations"]["deployment.kubernetes.io/revision"] = "1"
            there["spec"]["template"]["spec"]["dnsPolicy"] = "ClusterFirst"  # a default of the API server
            there["status"] = {"replicas": 1}
            found.append(there)
    return Live(found, maps)


def field_set(item: Object) -> dict[str, Any]:
    """What we own of an object that we applied."""
    return {"manager": names.MANAGER, "operation": "Apply", "fieldsV1": owned(dict(item))}


def owned(item: dict[str, Any]) -> dict[str, Any]:
    """FieldsV1 of an applied object, without its identity, lists as atomic ones but for containers."""
    fields: dict[str, Any] = {}
    for key, value in item.items():
        if key in ("apiVersion", "kind"):
            continue
        if isinstance(value, dict) and value:
            fields[f"f:{key}"] = owned(value)
        elif key == "containers":
            inner = {f"k:{json.dumps({'name': entry['name']})}": {".": {}, **owned(entry)} for entry in value}
            fields[f"f:{key}"] = inner
        else:
            fields[f"f:{key}"] = {}
    fields.pop("f:name", None) if "namespace" in item else None
    return fields


def update_map(name: str, history: list[dict[str, Any]], **contract: Any) -> dict[str, Any]:
    labels = {names.LABEL_APP: name}
    data = {"contract.json": json.dumps(contract), "history.json": json.dumps(history)}
    return {"metadata": {"name": f"{name}-update", "labels": labels}, "data": data}


def entry(context: Robot, name: str) -> dict[str, Any]:
    item = next(item for item in applied(context).deployments if item["metadata"]["name"] == name)
    revision = item["spec"]["template"]["metadata"]["labels"][names.LABEL_REVISION]
    return {"revision": revision, "image": "?", "deployment": kept(item)}


def marked(live: Live, *apps: str) -> Live:
    """With the mark of a version that is not proven yet on these apps, and the record of its step."""
    maps = {item["metadata"]["name"]: item for item in live.maps}
    for item in live.deployments:
        name = item["metadata"]["name"]
        if name in apps:
            item["metadata"]["annotations"][words.UPDATING] = str(Mark("123", revision_of(item)))
            before = maps.get(f"{name}-update") or update_map(name, [])
            said = {"revision": revision_of(item), "run": "123", **json.loads(before["data"]["contract.json"])}
            maps[f"{name}-update"] = update_map(name, json.loads(before["data"]["history.json"]), **said)
    return replace(live, maps=[*maps.values()])
