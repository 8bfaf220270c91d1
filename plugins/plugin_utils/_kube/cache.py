# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is waited for, and what is known of the cluster: references, and objects by kind, namespace and name. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import name_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.pods import Object, controller_of, meta, uid_of

Objects = dict[tuple[str, str], Object]  # by namespace ("" for what has none) and name


@dataclass(frozen=True, order=True)
class Ref:
    """Names one object."""

    kind: str
    name: str
    namespace: str = ""
    api_version: str = ""

    def __str__(self) -> str:
        return f"{self.kind} {self.namespace}/{self.name}" if self.namespace else f"{self.kind} {self.name}"


@dataclass(frozen=True)
class Rollout:
    """A kind that is rolled out: its API group, whether it lives in a namespace, what to watch to judge it."""

    group: str
    namespaced: bool
    watches: tuple[str, ...]


ROLLOUTS: dict[str, Rollout] = {
    "Deployment": Rollout("apps", True, ("Deployment", "ReplicaSet", "Pod")),
    "DaemonSet": Rollout("apps", True, ("DaemonSet", "ControllerRevision", "Pod")),
    "PersistentVolumeClaim": Rollout("", True, ("PersistentVolumeClaim", "StorageClass")),
    "Node": Rollout("", False, ("Node",)),
}
# Kinds that are rolled out, too, and of which nobody here can tell how far that is; with their API groups.
UNJUDGED = {"StatefulSet": "apps", "ReplicaSet": "apps", "Job": "batch", "Pod": "", "ReplicationController": ""}
CLUSTER_WIDE = frozenset({"Node", "StorageClass"})


def owned_by(obj: Mapping[str, Any], owner: Mapping[str, Any]) -> bool:
    """Whether that very object, not an earlier one of its name, is the controller."""
    return bool(controller_of(obj).get("uid") == uid_of(owner))


class View:
    """What is known of the cluster: objects by kind, then by namespace and name."""

    def __init__(self, objects: Iterable[Mapping[str, Any]] = ()) -> None:
        self._kinds: dict[str, Objects] = {}
        self.hidden: set[str] = set()  # kinds that these credentials may not read
        for obj in objects:
            self.put(str(obj.get("kind", "")), obj)

    @staticmethod
    def _key(obj: Mapping[str, Any]) -> tuple[str, str]:
        return str(meta(obj).get("namespace") or ""), name_of(obj)

    def put(self, kind: str, obj: Mapping[str, Any]) -> None:
        self._kinds.setdefault(kind, {})[self._key(obj)] = dict(obj)

    def drop(self, kind: str, obj: Mapping[str, Any]) -> None:
        self._kinds.get(kind, {}).pop(self._key(obj), None)

    def replace(self, kind: str, namespace: str, objects: Iterable[Mapping[str, Any]]) -> None:
        """A fresh listing: what it does not name is gone. No namespace means all of them."""
        kept = {key: obj for key, obj in self._kinds.get(kind, {}).items() if namespace and key[0] != namespace}
        kept.update({self._key(obj): dict(obj) for obj in objects})
        self._kinds[kind] = kept

    def get(self, kind: str, namespace: str, name: str) -> Object | None:
        return self._kinds.get(kind, {}).get((namespace, name))

    def all(self, kind: str, namespace: str | None = None) -> list[Object]:
        items = self._kinds.get(kind, {}).items()
        return [obj for key, obj in items if namespace is None or key[0] == namespace]

    def controlled(self, kind: str, namespace: str, owner_kind: str, owner: str) -> list[Object]:
        """Objects whose controller has that kind and name, whatever its uid: what a deleted namesake left counts."""
        found = []
        for obj in self.all(kind, namespace):
            ref = controller_of(obj)
            if ref.get("kind") == owner_kind and ref.get("name") == owner:
                found.append(obj)
        return found


def has_rollout(ref: Ref) -> bool:
    """Whether there is anything to wait for. A kind of the same name in another API group is not ours."""
    rollout = ROLLOUTS.get(ref.kind)
    return rollout is not None and _in_group(ref, rollout.group)


def _in_group(ref: Ref, group: str) -> bool:
    return not ref.api_version or ref.api_version.rpartition("/")[0] == group


def watched(refs: Iterable[Ref]) -> dict[str, set[str]]:
    """Which kinds to watch, in which namespaces (none for kinds of the whole cluster)."""
    wanted: dict[str, set[str]] = {}
    for ref in refs:
        if not has_rollout(ref):
            continue
        for kind in ROLLOUTS[ref.kind].watches:
            wanted.setdefault(kind, set())
            if kind not in CLUSTER_WIDE:
                wanted[kind].add(ref.namespace)
    return wanted


def parse_refs(objects: Sequence[Mapping[str, Any]]) -> list[Ref]:
    """References or full definitions, duplicates dropped, order kept; all errors at once."""
    refs: dict[Ref, None] = {}
    problems: list[str] = []
    for index, obj in enumerate(objects):
        full = obj["metadata"] if isinstance(obj.get("metadata"), Mapping) else {}
        kind = str(obj.get("kind") or "")
        name = str(obj.get("name") or full.get("name") or "")
        namespace = str(obj.get("namespace") or full.get("namespace") or "")
        api_version = str(obj.get("api_version") or obj.get("apiVersion") or "")
        missing = [key for key, value in (("kind", kind), ("name", name)) if not value]
        ref = Ref(kind, name, namespace, api_version)
        if has_rollout(ref) and not ROLLOUTS[kind].namespaced:
            ref = Ref(kind, name, "", api_version)
        elif has_rollout(ref) and not namespace:
            missing.append("namespace")
        problems += [f"objects[{index}].{key}: missing" for key in missing]
        if kind in UNJUDGED and _in_group(ref, UNJUDGED[kind]):
            allowed = f"{', '.join(ROLLOUTS)}, and kinds that have no rollout"
            problems.append(f"objects[{index}].kind: is {kind}, whose rollout is not judged here; allowed: {allowed}")
        refs[ref] = None
    if problems:
        raise SpecError("; ".join(problems))
    return list(refs)
