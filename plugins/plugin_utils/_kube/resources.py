# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the API keeps each kind of object. Pure."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Resource:
    """A kind's place: the path of its group and version, its plural name, whether it lives in a namespace."""

    base: str
    plural: str
    namespaced: bool = True

    @property
    def group(self) -> str:
        """Its API group, empty for the core's."""
        return self.base.removeprefix("/apis/").rpartition("/")[0] if self.base.startswith("/apis/") else ""

    def path(self, namespace: str = "", name: str = "") -> str:
        """The path of one object, or without a name of the list; without a namespace of the list everywhere."""
        space = f"/namespaces/{namespace}" if self.namespaced and namespace else ""
        return f"{self.base}{space}/{self.plural}" + (f"/{name}" if name else "")


# The kinds that the collection deals with.
RESOURCES: dict[str, Resource] = {
    "ClusterRole": Resource("/apis/rbac.authorization.k8s.io/v1", "clusterroles", False),
    "ClusterRoleBinding": Resource("/apis/rbac.authorization.k8s.io/v1", "clusterrolebindings", False),
    "ConfigMap": Resource("/api/v1", "configmaps"),
    "ControllerRevision": Resource("/apis/apps/v1", "controllerrevisions"),
    "DaemonSet": Resource("/apis/apps/v1", "daemonsets"),
    "Deployment": Resource("/apis/apps/v1", "deployments"),
    "Event": Resource("/api/v1", "events"),
    "Lease": Resource("/apis/coordination.k8s.io/v1", "leases"),
    "LimitRange": Resource("/api/v1", "limitranges"),
    "Namespace": Resource("/api/v1", "namespaces", False),
    "NetworkPolicy": Resource("/apis/networking.k8s.io/v1", "networkpolicies"),
    "Node": Resource("/api/v1", "nodes", False),
    "PersistentVolume": Resource("/api/v1", "persistentvolumes", False),
    "PersistentVolumeClaim": Resource("/api/v1", "persistentvolumeclaims"),
    "Pod": Resource("/api/v1", "pods"),
    "ReplicaSet": Resource("/apis/apps/v1", "replicasets"),
    "ResourceQuota": Resource("/api/v1", "resourcequotas"),
    "Role": Resource("/apis/rbac.authorization.k8s.io/v1", "roles"),
    "RoleBinding": Resource("/apis/rbac.authorization.k8s.io/v1", "rolebindings"),
    "Secret": Resource("/api/v1", "secrets"),
    "Service": Resource("/api/v1", "services"),
    "ServiceAccount": Resource("/api/v1", "serviceaccounts"),
    "StorageClass": Resource("/apis/storage.k8s.io/v1", "storageclasses", False),
}


@dataclass(frozen=True)
class Target:
    """What one list or stream is of: a kind, in one namespace or ("") everywhere."""

    kind: str
    namespace: str = ""

    def __str__(self) -> str:
        plural = RESOURCES[self.kind].plural
        return f"{plural} in namespace {self.namespace}" if self.namespace else plural

    @property
    def path(self) -> str:
        return RESOURCES[self.kind].path(self.namespace)
