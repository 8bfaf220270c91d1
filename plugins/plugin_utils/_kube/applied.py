# SPDX-License-Identifier: GPL-3.0-or-later
"""What a write did to an object, and what of it may be shown; who set which of its fields. Pure.

Server-side apply keeps the set of fields of every manager in metadata.managedFields (format FieldsV1, described in
Kubernetes' "Server-Side Apply" reference): `f:<name>` is a field, `k:<keys as JSON>` an entry of a list of mappings,
`v:<value as JSON>` a member of a set, `.` the thing itself. Applying exactly that part again changes nothing and owns
nothing that was not owned before, which a copy of the whole object with its defaults would.

Nobody owns what the API server fills in by itself. So what somebody else owns of a spec that is ours alone, and we do
not name, was put there by hand. What we do name is compared by its value, whoever owns it (an autoscaler, for one).
"""

from __future__ import annotations

import json
from base64 import b64decode
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

from ...module_utils._common.documents import Result
from ...module_utils._step.objects import Object
from .._model.secrets import secrets_in, without
from .cache import Ref

# What the API server keeps for itself, and what the cluster answers, are no part of what was asked for.
BOOKKEEPING = ("managedFields", "resourceVersion", "generation", "uid", "creationTimestamp", "selfLink")
Fields = dict[str, Any]  # FieldsV1
# Notes at the pod template, as `kubectl rollout restart` writes one, change nothing that runs.
NOTES: Fields = {"f:spec": {"f:template": {"f:metadata": {"f:annotations": {}}}}}
HIDDEN, HIDDEN_OLD, HIDDEN_NEW = "(hidden)", "(hidden: the old value)", "(hidden: the new value)"


@dataclass(frozen=True)
class Applied:
    """One object that was written. `before` is None if it was not there, `after` is None if it is gone.

    Both are without bookkeeping and status, and with the secrets that are in them, which `diff_of` hides.
    """

    ref: Ref
    before: Object | None
    after: Object | None
    changed: bool


def applied(ref: Ref, before: Object | None, after: Object | None) -> Applied:
    """Compare what the API server said before a write and after it."""
    old, new = content(before), content(after)
    return Applied(ref, old, new, old != new)


def content(obj: Object | None) -> Object | None:
    """The object without bookkeeping and status."""
    if obj is None:
        return None
    metadata = {key: value for key, value in (obj.get("metadata") or {}).items() if key not in BOOKKEEPING}
    return {**{key: value for key, value in obj.items() if key != "status"}, "metadata": metadata}


def diff_of(written: Sequence[Applied]) -> list[Result]:
    """Ansible's `diff` of a task: an entry per object that changed, without the secrets that any of them holds."""
    old = {text for one in written for text in secrets_in(one.before)}
    new = {text for one in written for text in secrets_in(one.after)}
    words = dict.fromkeys(old, HIDDEN_OLD) | dict.fromkeys(new, HIDDEN_NEW) | dict.fromkeys(old & new, HIDDEN)
    words.pop("", None)
    headers = ({"before_header": str(one.ref), "after_header": str(one.ref)} for one in written)
    return [
        {**header, "before": without(_readable(one.before), words), "after": without(_readable(one.after), words)}
        for one, header in zip(written, headers)
        if one.changed
    ]


def _readable(obj: Object | None) -> Any:
    """With bytes by their number and hash."""
    if not obj or not obj.get("binaryData"):
        return obj or ""
    held = {key: b64decode(text) for key, text in obj["binaryData"].items()}
    told = {key: f"{len(data)} bytes, SHA-256 {sha256(data).hexdigest()}" for key, data in held.items()}
    return {**obj, "binaryData": told}


# --- who set which fields ---------------------------------------------------------------------------------------------


def applied_part(obj: Object, manager: str) -> Object | None:
    """The object as `manager` applied it; None if it never did."""
    if (own := _own(obj, manager)) is None:
        return None
    part = dict(_part(obj, own.get("fieldsV1") or {}))
    metadata = {key: obj["metadata"][key] for key in ("name", "namespace") if key in obj["metadata"]}
    part["metadata"] = {**metadata, **part.get("metadata", {})}
    return {"apiVersion": obj["apiVersion"], "kind": obj["kind"], **part}


def _part(value: Any, fields: Fields) -> Any:
    """The part of a value that the fields name; a field without fields of its own is there as a whole."""
    return _with_each(
        value, fields, lambda item, under: [] if under is None else [_part(item, under) if set(under) - {"."} else item]
    )


def without_fields(value: Any, fields: Fields) -> Any:
    """A copy of the value without the fields, as the API server leaves it, but for the defaults it then fills in."""

    def rest(item: Any, under: Fields | None) -> list[Any]:
        if under is None:
            return [item]
        return [without_fields(item, under)] if under and "." not in under else []  # else the thing itself is meant

    return _with_each(value, fields, rest)


def _with_each(value: Any, fields: Fields, each: Callable[[Any, Fields | None], list[Any]]) -> Any:
    """The value with what `each` makes of each entry (or no entry), from what the fields say of it, if anything."""
    if isinstance(value, dict):
        return {name: new for name, item in value.items() for new in each(item, fields.get(f"f:{name}"))}
    if isinstance(value, list):
        owned = [(item, next((inner for key, inner in fields.items() if _names(key, item)), None)) for item in value]
        return [new for item, under in owned for new in each(item, under)]
    return value


def foreign_fields(there: Object, wanted: Object, manager: str) -> Fields:
    """What managers other than `manager` own of the object's spec beside what is `wanted`, or made another one."""
    found: Fields = {}
    for entry in _entries(there):
        spec = (entry.get("fieldsV1") or {}).get("f:spec")
        if spec and entry.get("manager") != manager:
            found = _plus(found, _beside(_minus({"f:spec": spec}, NOTES), wanted, there))
    return found


def left_fields(there: Object, wanted: Object, manager: str) -> Fields:
    """What `manager` has of the object's spec beside what is `wanted`: what it took over, and did not apply since."""
    own = (_own(there, manager) or {}).get("fieldsV1") or {}
    return _beside({"f:spec": own.get("f:spec") or {}}, wanted, wanted)


def taken_over(there: Object, fields: Fields, manager: str) -> list[Object]:
    """The object's managedFields with these fields as if `manager` had applied them, and nobody else.

    What it does not name when it applies the object again, goes away then.
    """
    own = _own(there, manager) or {
        "manager": manager, "operation": "Apply", "apiVersion": there["apiVersion"], "fieldsType": "FieldsV1",
    }  # fmt: skip
    others = [entry for entry in _entries(there) if entry is not own]
    left = [{**entry, "fieldsV1": _minus(entry.get("fieldsV1") or {}, fields)} for entry in others]
    taken = {**own, "fieldsV1": _plus(own.get("fieldsV1") or {}, fields)}
    return [taken, *(entry for entry in left if entry["fieldsV1"])]


def _entries(obj: Object) -> list[Object]:
    return (obj.get("metadata") or {}).get("managedFields") or []


def _own(obj: Object, manager: str) -> Object | None:
    """What `manager` has applied."""
    asked = {"manager": manager, "operation": "Apply", "subresource": ""}
    return next((one for one in _entries(obj) if {key: one.get(key, "") for key in asked} == asked), None)


def _names(key: str, item: Any) -> bool:
    """Whether this key of FieldsV1 means this entry of a list. Keys that have a default may be missing in ours."""
    if key.startswith("k:") and isinstance(item, dict):
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
        if ours is None or (not inner and isinstance(ours, dict) and ours != now):
            found[key] = inner
        elif rest := _beside(inner, ours, now):
            found[key] = rest
    return found


def _at(value: Any, key: str) -> Any:
    """What a key of FieldsV1 means in a value; None for nothing."""
    if key.startswith("f:"):
        return value.get(key[2:]) if isinstance(value, dict) else None
    return next((item for item in value if _names(key, item)), None) if isinstance(value, (list, tuple)) else None


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
