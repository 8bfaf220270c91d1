# SPDX-License-Identifier: GPL-3.0-or-later
"""What `overrides` may not do: change which object it is, cut it from its pods, or be of another shape."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING
from typing import Any

from ...module_utils._step.objects import Object
from .._model.app import Filled
from .._model.finding import Problem, each, join_path, shown
from .._model.formats import words
from .._model.keys import OPEN, Key, Kind, kind_of
from .._model.merge import deep_merge, merge_key
from .draft import Said
from .schema import value_problems

# The collection finds its objects by these; a Deployment's selector cannot be changed after its creation anyway.
FIXED = (
    ("apiVersion",),
    ("kind",),
    ("metadata", "name"),
    ("metadata", "namespace"),
    ("spec", "selector"),
    ("spec", "template", "metadata", "name"),
)

# The shapes of the fields that overrides are used for most (Kubernetes API reference, PodSpec and Container). The API
# checks the rest; these are checked here because the collection reads them itself, or because they are easily mistaken.


def _list_of(kind: Kind, allowed: str) -> Kind:
    return Kind(tuple, (kind._replace(notes=(*kind.notes, words(allowed))),), (words(allowed),))


_MAPPING = kind_of(Mapping[str, Any])
_ENTRIES = _list_of(_MAPPING, "a list of mappings")
_TEXTS = Key(_list_of(kind_of(str), "a list of texts"))
_CONTEXT = {
    "capabilities": Key(Kind(dict, dict.fromkeys(("add", "drop"), _TEXTS), (OPEN,))),
    "sysctls": Key(_ENTRIES),
    **dict.fromkeys(("appArmorProfile", "seLinuxOptions", "seccompProfile"), Key(_MAPPING)),
}
_VOLUME = {"name": Key(kind_of(Filled), MISSING), "hostPath": Key(_MAPPING)}
_CONTAINER = {
    **dict.fromkeys(("name", "image"), Key(kind_of(Filled), MISSING)),
    **dict.fromkeys(("env", "envFrom", "ports", "volumeMounts", "volumeDevices"), Key(_ENTRIES)),
    **dict.fromkeys(("command", "args"), _TEXTS),
    **dict.fromkeys(("lifecycle", "livenessProbe", "readinessProbe", "startupProbe"), Key(_MAPPING)),
    "resources": Key(_MAPPING),
    "securityContext": Key(Kind(dict, _CONTEXT, (OPEN,))),
}
_CONTAINERS = _list_of(Kind(dict, _CONTAINER, (OPEN,)), "a list of mappings")
_POD = {
    **dict.fromkeys(("tolerations", "imagePullSecrets", "hostAliases"), Key(_ENTRIES)),
    "topologySpreadConstraints": Key(_ENTRIES),
    "volumes": Key(_list_of(Kind(dict, _VOLUME, (OPEN,)), "a list of mappings")),
    **dict.fromkeys(("nodeSelector", "affinity", "dnsConfig"), Key(_MAPPING)),
    "securityContext": Key(Kind(dict, _CONTEXT, (OPEN,))),
    **dict.fromkeys(("containers", "initContainers"), Key(_CONTAINERS)),
}


def override_problems(plain: Object, overrides: Said, container: str, path: str) -> list[Problem]:
    """`plain` is the Deployment that `overrides` are laid over, `container` the one that has to stay."""
    shape = list(_shape_problems(plain, overrides, path))
    if shape or not overrides:  # most have none, and to look through what we made ourselves is half of a validation
        return shape
    merged = deep_merge(plain, overrides)
    problems = [
        Problem(join_path(path, *field), "changes what the collection finds the object by", "leave it out")
        for field in FIXED
        if inside(merged, field) != inside(plain, field)
    ]
    problems += _pod_problems(plain, merged, container, path)
    replicas = inside(merged, ("spec", "replicas"))
    if replicas != 1:
        allowed = "1: a ROS node name cannot run twice, and an app that is not to run is taken out of ros_apps"
        problems.append(Problem(join_path(path, "spec", "replicas"), f"is {shown(replicas)}", allowed))
    return problems


def _pod_problems(plain: Object, merged: Object, container: str, path: str) -> Iterator[Problem]:
    template = ("spec", "template")
    labels = inside(merged, (*template, "metadata", "labels")) or {}
    for key, value in plain["spec"]["selector"]["matchLabels"].items():
        if labels.get(key) != value:
            where = join_path(path, *template, "metadata", "labels", key)
            yield Problem(where, "does not match the selector", f"{value}, or leave it out")
    for field in (template, (*template, "spec"), (*template, "metadata"), ("metadata",), ("spec",)):
        if not isinstance(inside(merged, field), dict):
            yield Problem(join_path(path, *field), "is removed", "a mapping")
            return
    own = [("containers", container)]
    own += [("initContainers", item["name"]) for item in inside(plain, (*template, "spec", "initContainers")) or []]
    for key, name in own:
        listed = inside(merged, (*template, "spec", key))
        if not [item for item in listed or [] if isinstance(item, dict) and item.get("name") == name]:
            where = join_path(path, *template, "spec", key)
            yield Problem(where, f"leaves no container {name}", f"entries with the key name, {name} among them")
    # fields that are of another shape than the API's
    spec, path = inside(merged, (*template, "spec")), join_path(path, *template, "spec")
    yield from value_problems(spec, Kind(dict, _POD, (OPEN,)), path)


def _shape_problems(base: Any, value: Any, path: str, field: str = "") -> Iterator[Problem]:
    """Where the override is of another kind than what it is laid over, or a list of named entries has one without."""
    kind = _kind(base)
    if _kind(value) != kind:
        yield Problem(path, f"is {shown(value)}", f"{kind}, as in the object it changes")
    elif isinstance(value, Mapping):
        for key, item in value.items():
            if item is not None and key in base:
                yield from _shape_problems(base[key], item, join_path(path, key), key)
    elif isinstance(value, list):
        key = merge_key(field, base, value)
        known = {str(item[key]): item for item in base} if key else {}
        named = key is None and base and all(isinstance(item, Mapping) for item in base)
        for where, item in each(path, value):
            if key and str(item[key]) in known:
                yield from _shape_problems(known[str(item[key])], item, where)
            elif named and not (isinstance(item, Mapping) and item.get("name")):
                found = "has no name" if isinstance(item, Mapping) else f"is {shown(item)}"
                yield Problem(where, found, "a mapping with the key that tells the entries apart")


def _kind(value: Any) -> str:
    return "a mapping" if isinstance(value, Mapping) else "a list" if isinstance(value, list) else "a single value"


def inside(value: Any, field: Sequence[str]) -> Any:
    """What is at a path of a document of any shape; None where nothing is."""
    for key in field:
        value = value.get(key) if isinstance(value, Mapping) else None
    return value
