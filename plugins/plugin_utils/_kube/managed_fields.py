# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What one field manager once applied, out of an object as the API server shows it.

Server-side apply keeps the set of fields of every manager in metadata.managedFields (format FieldsV1, described in
Kubernetes' "Server-Side Apply" reference): `f:<name>` is a field, `k:<keys as JSON>` an entry of a list of mappings,
`v:<value as JSON>` a member of a set, `.` the thing itself. Applying exactly that part again changes nothing and owns
nothing that was not owned before, which a copy of the whole object with its defaults would.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

IDENTITY = ("name", "namespace")


def applied_part(obj: Mapping[str, Any], manager: str) -> dict[str, Any] | None:
    """The object as `manager` applied it; None if it never did."""
    for entry in (obj.get("metadata") or {}).get("managedFields") or []:
        if entry.get("manager") == manager and entry.get("operation") == "Apply" and not entry.get("subresource"):
            part: dict[str, Any] = _part(obj, entry.get("fieldsV1") or {})
            metadata = {key: obj["metadata"][key] for key in IDENTITY if key in obj["metadata"]}
            part["metadata"] = {**metadata, **part.get("metadata", {})}
            return {"apiVersion": obj["apiVersion"], "kind": obj["kind"], **part}
    return None


def _part(value: Any, fields: Mapping[str, Any]) -> Any:
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


def _owned(items: list[Any], fields: Mapping[str, Any]) -> list[tuple[Any, Mapping[str, Any]]]:
    """The entries of a list that the fields name, in the list's order, each with its own fields."""
    by_keys = [(json.loads(key[2:]), inner) for key, inner in fields.items() if key.startswith("k:")]
    members = [json.loads(key[2:]) for key in fields if key.startswith("v:")]
    found: list[tuple[Any, Mapping[str, Any]]] = []
    for item in items:
        if isinstance(item, Mapping):
            found += [(item, inner) for keys, inner in by_keys if all(item.get(k) == v for k, v in keys.items())]
        elif item in members:
            found.append((item, {}))
    return found
