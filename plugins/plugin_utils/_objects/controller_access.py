# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The account of a controller such as AWX: what update, rollback and status ask of a cluster's API, and nothing else.

Robots come with namespaces of their own, so it is a ClusterRole. Nobody may give away what he has not: it has what the
keeper's Role has, too.
"""

from __future__ import annotations

from ...module_utils._step.objects import Object
from .common import made
from .rights import RBAC, Rule, rights

NAME = "rosops-fleet-controller"
NAMESPACE = "kube-system"
READ = ["get", "list", "watch"]
WRITE = [*READ, "create", "patch", "delete"]
RULES: tuple[Rule, ...] = (
    ("", ["namespaces"], [*READ, "create", "patch"]),
    (
        "",
        ["configmaps", "services", "serviceaccounts", "persistentvolumeclaims", "limitranges", "resourcequotas"],
        WRITE,
    ),
    ("", ["secrets"], ["get", "list", "create", "patch"]),  # of registries
    ("", ["nodes", "pods", "pods/log", "events", "persistentvolumes"], READ),
    ("apps", ["deployments"], WRITE),
    ("apps", ["replicasets"], READ),
    ("storage.k8s.io", ["storageclasses"], READ),
    ("coordination.k8s.io", ["leases"], ["get", "list", "create", "update"]),
    (RBAC, ["roles", "rolebindings"], ["get", "list", "create", "patch", "delete"]),
    # what it gives the keepers
    ("", ["pods/eviction", "events"], ["create"]),
)


def controller_access() -> list[Object]:
    """The account, its role, and the Secret that the cluster puts its token into."""
    token = made("v1", "Secret", NAME, NAMESPACE, type="kubernetes.io/service-account-token")
    token["metadata"]["annotations"] = {"kubernetes.io/service-account.name": NAME}
    return [
        made("v1", "ServiceAccount", NAME, NAMESPACE),
        *rights({"name": NAME, "namespace": NAMESPACE}, RULES),
        token,
    ]


def allows(verb: str, group: str, resource: str) -> bool:
    """Whether the role has it."""
    return any(group == of and resource in kinds and verb in verbs for of, kinds, verbs in RULES)
