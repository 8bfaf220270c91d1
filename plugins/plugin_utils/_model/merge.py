# SPDX-License-Identifier: GPL-3.0-or-later
"""The dissertation's `deep_merge` (its algorithm 1), extended so that lists of named entries merge by name.

That one replaced every list, so that an override of one variable of one container had to repeat the whole container.
Kubernetes' own strategic merge is the model for the keys: API reference, "patch merge key".
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any, TypeGuard

from ...module_utils._common.documents import Variables
from ...module_utils._step.objects import Object
from .finding import Problem, join_path

# Fields whose entries are told apart by something other than `name`; the first key that all entries have wins.
MERGE_KEYS: dict[str, tuple[str, ...]] = {
    "volumeMounts": ("mountPath",),
    "volumeDevices": ("devicePath",),
    "ports": ("name", "containerPort"),
    "hostAliases": ("ip",),
    "files": ("path",),  # of an app
}
PATCH = "$patch"
# A robot's apps: those of the fleet, what its model has of its own, and what it has itself; the later layer counts.
# Ansible takes a variable from one place only, so each layer has a name of its own.
APPS = "ros_apps"
LAYERS = ("ros_apps_model", "ros_apps_robot")


def deep_merge(base: Variables, overrides: Variables) -> Object:
    """`overrides` laid over `base`, as a document of its own.

    Mappings merge key by key, null removes a key, lists of named entries merge by name in the base's order with new
    entries at the end (`$patch: delete` in an entry removes it), everything else is replaced.
    """
    return _laid_over(_copied(dict(base)), overrides)


def _copied(document: Any) -> Any:
    """`copy.deepcopy` of a document. It takes a fraction of the time, and each object of a robot is one."""
    if document is None or isinstance(document, (str, int, float)):  # most are: to ask for a Mapping costs most of it
        return document
    if isinstance(document, (dict, Mapping)):
        return {key: _copied(value) for key, value in document.items()}
    return [_copied(item) for item in document] if isinstance(document, list) else document


def _laid_over(merged: Object, overrides: Variables) -> Object:
    for key, value in overrides.items():
        if value is None:
            merged.pop(key, None)
        else:
            merged[key] = _merged_value(key, merged.get(key), value)
    return merged


def _merged_value(field: str, base: Any, value: Any) -> Any:
    if isinstance(value, Mapping):
        return _laid_over(base if isinstance(base, dict) else {}, value)
    if isinstance(value, list):
        base_list = base if isinstance(base, list) else []
        key = merge_key(field, base_list, value)
        if key is not None:
            return _merged_entries(key, base_list, value)
        return [_laid_over({}, item) if isinstance(item, Mapping) else _copied(item) for item in value]
    return _copied(value)


def merge_key(field: str, base: list[Any], value: list[Any]) -> str | None:
    """The key that tells the entries of both lists apart; None for lists that are replaced as a whole."""
    for key in MERGE_KEYS.get(field, ("name",)):
        if all(isinstance(item, Mapping) and key in item for item in [*base, *value]):
            return key
    return None


def _merged_entries(key: str, base: list[Any], value: list[Any]) -> list[Any]:
    entries: dict[str, Object] = {str(item[key]): item for item in base}
    for item in value:
        name = str(item[key])
        if item.get(PATCH) == "delete":
            entries.pop(name, None)
        else:
            entries[name] = _laid_over(entries.get(name, {}), item)
    return list(entries.values())


def layered(variables: Variables, path: str, problems: list[Problem]) -> Variables:
    """The host's variables with all its apps in `ros_apps`. A layer of another shape stays: its schema says so."""
    merged = dict(variables)
    for layer in LAYERS:
        apps, more = merged.get(APPS, []), merged.get(layer)
        if _named(apps) and _named(more):
            problems += _missing(apps, more, join_path(path, layer))
            for name, items in ((APPS, apps), (layer, more)):  # by name they are one, and the first would be lost
                said = Counter(item["name"] for item in items if item.get(PATCH) != "delete")
                twice = (f"has '{one}' twice" for one, times in said.items() if times > 1)
                problems += (Problem(join_path(path, name), found, "names of their own") for found in twice)
            merged[APPS] = deep_merge({APPS: apps}, {APPS: more})[APPS]
            del merged[layer]
    return merged


def _named(apps: object) -> TypeGuard[list[Variables]]:
    return isinstance(apps, list) and all(isinstance(app, Mapping) and isinstance(app.get("name"), str) for app in apps)


def _missing(apps: list[Variables], more: list[Variables], path: str) -> Iterator[Problem]:
    there = [app["name"] for app in apps]
    for index, app in enumerate(more):
        if app.get(PATCH) == "delete" and app["name"] not in there:
            found = f"takes away {app['name']}, which no layer before has"
            yield Problem(join_path(path, index), found, f"one of {', '.join(there)}" if there else "nothing")
