# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of objects and where the API keeps them; references to objects; and what is known of a cluster. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from ...module_utils._common.errors import SpecError
from ...module_utils._step.objects import Object, name_of
from .pods import controller_of, space_of, uid_of

# The kinds that the collection deals with, by the path of their API.
KINDS = {
    "/apis/admissionregistration.k8s.io/v1": ("ValidatingAdmissionPolicy", "ValidatingAdmissionPolicyBinding"),
    "/api/v1": (
        "ConfigMap", "Event", "LimitRange", "Namespace", "Node", "PersistentVolume", "PersistentVolumeClaim", "Pod",
        "ResourceQuota", "Secret", "Service", "ServiceAccount",
    ),
    "/apis/apps/v1": ("ControllerRevision", "DaemonSet", "Deployment", "ReplicaSet"),
    "/apis/coordination.k8s.io/v1": ("Lease",),
    "/apis/networking.k8s.io/v1": ("NetworkPolicy",),
    "/apis/rbac.authorization.k8s.io/v1": ("ClusterRole", "ClusterRoleBinding", "Role", "RoleBinding"),
    "/apis/scheduling.k8s.io/v1": ("PriorityClass",),
    "/apis/storage.k8s.io/v1": ("StorageClass",),
}  # fmt: skip
POLICIES = KINDS["/apis/admissionregistration.k8s.io/v1"]
OF_CLUSTER = (*POLICIES, "PriorityClass", "ClusterRole", "ClusterRoleBinding")  # found there by who may not write
IN_NO_NAMESPACE = (*OF_CLUSTER, "Namespace", "Node", "PersistentVolume", "StorageClass")
ENDINGS = {"s": "ses", "y": "ies"}  # as Kubernetes guesses a kind's plural, too (meta.UnsafeGuessKindToResource)
# Kind -> the path of its group and version, and its plural name.
PLACES = {
    kind: (base, kind[:-1].lower() + ENDINGS.get(kind[-1], f"{kind[-1]}s"))
    for base, kinds in KINDS.items()
    for kind in kinds
}


@dataclass(frozen=True, order=True)
class Ref:
    """Names one object; without a name all of a kind, in one namespace or ("") everywhere."""

    kind: str
    name: str
    namespace: str = ""
    api_version: str = ""
    uid: str = field(default="", compare=False)  # where just that very object is meant, and none of its name

    def __str__(self) -> str:
        return f"{self.kind} {self.namespace}/{self.name}" if self.namespace else f"{self.kind} {self.name}"

    @property
    def path(self) -> str:
        base, plural = PLACES[self.kind]
        space = f"/namespaces/{self.namespace}" if self.namespace and self.kind not in IN_NO_NAMESPACE else ""
        return f"{base}{space}/{plural}" + (f"/{self.name}" if self.name else "")

    def as_dict(self) -> dict[str, str]:
        return {"kind": self.kind, "name": self.name, "namespace": self.namespace}


# What to watch to judge the kinds that are rolled out: those of the groups `apps` and "", the core's.
WATCHED: dict[str, tuple[str, ...]] = {
    "Deployment": ("Deployment", "ReplicaSet", "Pod"),
    "DaemonSet": ("DaemonSet", "ControllerRevision", "Pod"),
    "PersistentVolumeClaim": ("PersistentVolumeClaim", "StorageClass"),
    "Node": ("Node",),
}
# Kinds that are rolled out, too, and of which nobody here can tell how far that is; with their API groups.
UNJUDGED = {"StatefulSet": "apps", "ReplicaSet": "apps", "Job": "batch", "Pod": "", "ReplicationController": ""}


def owned_by(obj: Object, owner: Object) -> bool:
    """Whether that very object, not an earlier one of its name, is the controller."""
    return bool(controller_of(obj).get("uid") == uid_of(owner))


class View:
    """What is known of the cluster: objects by kind, then by namespace and name."""

    def __init__(self, objects: Iterable[Object] = ()) -> None:
        self._objects: dict[tuple[str, str, str], Object] = {}
        self.hidden: set[str] = set()  # kinds that these credentials may not read
        for obj in objects:
            self.put(str(obj.get("kind", "")), obj)

    @staticmethod
    def _key(kind: str, obj: Object) -> tuple[str, str, str]:
        return kind, space_of(obj), name_of(obj)

    def put(self, kind: str, obj: Object) -> None:
        self._objects[self._key(kind, obj)] = obj

    def drop(self, kind: str, obj: Object) -> None:
        self._objects.pop(self._key(kind, obj), None)

    def replace(self, kind: str, namespace: str, objects: Iterable[Object]) -> None:
        """A fresh listing: what it does not name is gone. No namespace means all of them."""
        for obj in self.all(kind, namespace or None):
            self.drop(kind, obj)
        for obj in objects:
            self.put(kind, obj)

    def get(self, kind: str, namespace: str, name: str) -> Object | None:
        return self._objects.get((kind, namespace, name))

    def all(self, kind: str, namespace: str | None = None) -> list[Object]:
        """Of a kind, in one namespace or (None) everywhere."""
        return [obj for (of, space, _name), obj in self._objects.items() if of == kind and namespace in (None, space)]


def has_rollout(ref: Ref) -> bool:
    """Whether there is anything to wait for. A kind of the same name in another API group is not ours."""
    return ref.kind in WATCHED and _in_group(ref, "apps" if ref.kind in KINDS["/apis/apps/v1"] else "")


def _in_group(ref: Ref, group: str) -> bool:
    return not ref.api_version or ref.api_version.rpartition("/")[0] == group


def targets_for(refs: Iterable[Ref]) -> list[Ref]:
    """What is listed and watched for these: all of each kind that tells of them, in each of their namespaces."""
    kinds = {(kind, ref.namespace) for ref in refs if has_rollout(ref) for kind in WATCHED[ref.kind]}
    return sorted({Ref(kind, "", "" if kind in IN_NO_NAMESPACE else space) for kind, space in kinds})


def parse_refs(objects: Sequence[Object]) -> list[Ref]:
    """References or full definitions, duplicates dropped, order kept; all errors at once."""
    refs: dict[Ref, None] = {}
    problems: list[str] = []
    for index, obj in enumerate(objects):
        full = obj["metadata"] if isinstance(obj.get("metadata"), Mapping) else {}
        kind, name, namespace = (str(obj.get(key) or full.get(key) or "") for key in ("kind", "name", "namespace"))
        ref = Ref(kind, name, namespace, str(obj.get("api_version") or obj.get("apiVersion") or ""))
        needed = ["kind", "name"]
        if has_rollout(ref) and kind not in IN_NO_NAMESPACE:
            needed.append("namespace")
        elif has_rollout(ref):
            ref = replace(ref, namespace="")
        missing = [key for key in needed if not getattr(ref, key)]
        problems += [f"objects[{index}].{key}: missing" for key in missing]
        if kind in UNJUDGED and _in_group(ref, UNJUDGED[kind]):
            allowed = f"{', '.join(WATCHED)}, and kinds that have no rollout"
            problems.append(f"objects[{index}].kind: is {kind}, whose rollout is not judged here; allowed: {allowed}")
        refs[ref] = None
    if problems:
        raise SpecError("; ".join(problems))
    return list(refs)
