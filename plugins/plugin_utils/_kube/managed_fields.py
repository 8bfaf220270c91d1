# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Who set which fields of an object: what we applied, and what others put beside it. Pure.

Server-side apply keeps the set of fields of every manager in metadata.managedFields (format FieldsV1, described in
Kubernetes' "Server-Side Apply" reference): `f:<name>` is a field, `k:<keys as JSON>` an entry of a list of mappings,
`v:<value as JSON>` a member of a set, `.` the thing itself. Applying exactly that part again changes nothing and owns
nothing that was not owned before, which a copy of the whole object with its defaults would.

Nobody owns what the API server fills in by itself. So what somebody else owns of a spec that is ours alone, and we do
not name, was put there by hand. What we do name is compared by its value, whoever owns it (an autoscaler, for one).
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from ...module_utils._step.objects import Object

IDENTITY = ("name", "namespace")
Fields = dict[str, Any]  # FieldsV1
# Notes at the pod template, as `kubectl rollout restart` writes one, change nothing that runs.
NOTES = ("f:spec", "f:template", "f:metadata", "f:annotations")


def applied_part(obj: Object, manager: str) -> Object | None:
    """The object as `manager` applied it; None if it never did."""
    for entry in _entries(obj):
        if _is_applied(entry, manager):
            part: Object = _part(obj, entry.get("fieldsV1") or {})
            metadata = {key: obj["metadata"][key] for key in IDENTITY if key in obj["metadata"]}
            part["metadata"] = {**metadata, **part.get("metadata", {})}
            return {"apiVersion": obj["apiVersion"], "kind": obj["kind"], **part}
    return None


def _part(value: Any, fields: Fields) -> Any:
    """The part of a value that the fields name; a field without fields of its own is there as a whole."""
    if isinstance(value, Mapping):
        names = {key[2:]: inner for key, inner in fields.items() if key.startswith("f:")}
        return {
            name: _part(value[name], inner) if set(inner) - {"."} else value[name]
            for name, inner in names.items()
            if name in value
        }
    if isinstance(value, list):
        return [_part(item, inner) if isinstance(item, Mapping) else item for item, inner in _owned(value, fields)]
    return value


def _owned(items: list[Any], fields: Fields) -> list[tuple[Any, Fields]]:
    """The entries of a list that the fields name, in the list's order, each with its own fields."""
    by_keys = [(json.loads(key[2:]), inner) for key, inner in fields.items() if key.startswith("k:")]
    members = [json.loads(key[2:]) for key in fields if key.startswith("v:")]
    found: list[tuple[Any, Fields]] = []
    for item in items:
        if isinstance(item, Mapping):
            found += [(item, inner) for keys, inner in by_keys if all(item.get(k) == v for k, v in keys.items())]
        elif item in members:
            found.append((item, {}))
    return found


def foreign_fields(there: Object, wanted: Object, manager: str) -> Fields:
    """What managers other than `manager` own of the object's spec beside what is `wanted`, or made another one."""
    found: Fields = {}
    for entry in _entries(there):
        spec = (entry.get("fieldsV1") or {}).get("f:spec")
        if spec and entry.get("manager") != manager:
            found = _plus(found, _beside(_minus({"f:spec": spec}, _nested(NOTES)), wanted, there))
    return found


def left_fields(there: Object, wanted: Object, manager: str) -> Fields:
    """What `manager` has of the object's spec beside what is `wanted`: what it took over, and did not apply since."""
    own = next((entry for entry in _entries(there) if _is_applied(entry, manager)), {})
    return _beside({"f:spec": (own.get("fieldsV1") or {}).get("f:spec") or {}}, wanted, wanted)


def taken_over(there: Object, fields: Fields, manager: str) -> list[Object]:
    """The object's managedFields with these fields as if `manager` had applied them, and nobody else.

    What it does not name when it applies the object again, goes away then.
    """
    others = [entry for entry in _entries(there) if not _is_applied(entry, manager)]
    own = next((entry for entry in _entries(there) if _is_applied(entry, manager)), None) or {
        "manager": manager, "operation": "Apply", "apiVersion": there["apiVersion"], "fieldsType": "FieldsV1",
    }  # fmt: skip
    left = [{**entry, "fieldsV1": _minus(entry.get("fieldsV1") or {}, fields)} for entry in others]
    taken = {**own, "fieldsV1": _plus(own.get("fieldsV1") or {}, fields)}
    return [taken, *(entry for entry in left if entry["fieldsV1"])]


def without_fields(value: Any, fields: Fields) -> Any:
    """A copy of the value without the fields, as the API server leaves it, but for the defaults it then fills in."""
    if isinstance(value, Mapping):
        kept = {name: (inner, fields.get(f"f:{name}")) for name, inner in value.items()}
        return {name: _left(inner, under) for name, (inner, under) in kept.items() if not _is_whole(under)}
    if isinstance(value, list):
        owned = [(item, next((inner for key, inner in fields.items() if _names(key, item)), None)) for item in value]
        return [_left(item, under) for item, under in owned if not _is_whole(under)]
    return value


def _left(value: Any, fields: Fields | None) -> Any:
    return value if fields is None else without_fields(value, fields)


def _is_whole(fields: Fields | None) -> bool:
    """Whether the thing itself is meant, and not only some of what is in it."""
    return fields is not None and (not fields or "." in fields)


def _entries(obj: Object) -> list[Object]:
    return (obj.get("metadata") or {}).get("managedFields") or []


def _is_applied(entry: Object, manager: str) -> bool:
    own = entry.get("manager") == manager and entry.get("operation") == "Apply"
    return own and not entry.get("subresource")


def _names(key: str, item: Any) -> bool:
    """Whether this key of FieldsV1 means this entry of a list. Keys that have a default may be missing in ours."""
    if key.startswith("k:") and isinstance(item, Mapping):
        keys = json.loads(key[2:])
        return any(name in item for name in keys) and all(item.get(name, text) == text for name, text in keys.items())
    return key.startswith("v:") and bool(json.loads(key[2:]) == item)


def _beside(fields: Fields, wanted: Any, there: Any) -> Fields:
    """Of the fields those that `wanted` does not name, and mappings that are one field and not the wanted ones."""
    found: Fields = {}
    for key, inner in fields.items():
        if key == ".":
            continue
        ours, now = _at(wanted, key), _at(there, key)
        if ours is None:
            found[key] = inner
        elif not inner:
            found |= {key: inner} if isinstance(ours, Mapping) and ours != now else {}
        elif rest := _beside(inner, ours, now):
            found[key] = rest
    return found


def _at(value: Any, key: str) -> Any:
    """What a key of FieldsV1 means in a value; None for nothing."""
    if key.startswith("f:"):
        return value.get(key[2:]) if isinstance(value, Mapping) else None
    return next((item for item in value if _names(key, item)), None) if isinstance(value, (list, tuple)) else None


def _nested(path: Sequence[str]) -> Fields:
    return {path[0]: _nested(path[1:]) if path[1:] else {}}


def _plus(fields: Fields, more: Fields) -> Fields:
    both = {key: _plus(fields[key], more[key]) for key in fields if key in more}
    return {**fields, **more, **both}


def _minus(fields: Fields, less: Fields) -> Fields:
    """What is left of the fields. What has nothing left below it goes, too."""
    found: Fields = {}
    for key, inner in fields.items():
        if key not in less:
            found[key] = inner
        elif less[key] and (rest := _minus(inner, less[key])):
            found[key] = rest
    return found
