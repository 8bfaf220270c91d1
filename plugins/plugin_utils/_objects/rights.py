# SPDX-License-Identifier: GPL-3.0-or-later
"""Accounts and what they may do in a cluster: a keeper's, and that of a controller such as AWX. Pure.

Beside them what is the cluster's, the same bytes from every robot: what bounds all keepers, and their PriorityClass.

A keeper takes back what nobody proved, begins a pod anew that hangs, and says so. That of one robot works in the
robot's own namespace. That of a shared master works in those of all robots, which each bring it their Role, and tell it
of themselves by a ConfigMap in the namespace `fleet`: neither may it look for namespaces, nor does its pod change with
every robot that is added.

A controller has what update, rollback and status ask of a cluster's API, and nothing else. Robots come with namespaces
of their own, so it is a ClusterRole. Nobody may give away what he has not: it has what the keeper's Role has, too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ...module_utils._step.objects import Object
from .._model import context, names
from .._model.context import Robot
from .admission import API, admission_objects
from .common import PRIORITY, config_map, made, owner_labels

RBAC, LEASES, SCHEDULING = "rbac.authorization.k8s.io", "coordination.k8s.io", "scheduling.k8s.io"
FIRST = 1_000_000  # apps have 0, Kubernetes' own pods 2,000,000,000
Rule = tuple[str, Sequence[str], Sequence[str]]  # an API group, kinds of it, and what may be done with them

KEEPER: tuple[Rule, ...] = (
    ("apps", ["deployments"], ["get", "list", "patch"]),
    ("", ["pods"], ["list", "watch"]),
    ("", ["pods/status"], ["patch"]),  # readiness gates: `admission.py` says how much of it
    ("", ["configmaps"], ["get", "patch"]),  # records: what became of a step, and that a version is proven
    (LEASES, ["leases"], ["get", "create", "update"]),
    ("", ["pods/eviction"], ["create"]),  # of what hangs
    ("", ["events"], ["create"]),
)
LIST_LEASES: Rule = (LEASES, ["leases"], ["list"])  # of all robots at once: where something may be due
FIND_ROBOTS: Rule = ("", ["configmaps"], ["list"])

CONTROLLER, NAMESPACE = "rosops-fleet-controller", "kube-system"
READ = ["get", "list", "watch"]
WRITE = [*READ, "create", "patch", "delete"]
OWNED = ["configmaps", "services", "serviceaccounts", "persistentvolumeclaims", "limitranges", "resourcequotas"]
CONTROLLERS: tuple[Rule, ...] = (
    ("", ["namespaces"], [*READ, "create", "patch"]),
    ("", OWNED, WRITE),
    ("", ["secrets"], ["get", "list", "create", "patch"]),  # of registries
    ("", ["nodes", "pods", "pods/log", "events", "persistentvolumes"], READ),
    ("apps", ["deployments"], WRITE),
    ("apps", ["replicasets"], READ),
    ("storage.k8s.io", ["storageclasses"], READ),
    (LEASES, ["leases"], ["get", "list", "create", "update"]),
    (RBAC, ["roles", "rolebindings"], ["get", "list", "create", "patch", "delete"]),
    # what it gives the keepers
    ("", ["pods/eviction", "events"], ["create"]),
    ("", ["pods/status"], ["patch"]),
    # what is the cluster's, and made by whoever administers it
    (API.rpartition("/")[0], ["validatingadmissionpolicies", "validatingadmissionpolicybindings"], ["get"]),
    (RBAC, ["clusterroles", "clusterrolebindings"], ["get"]),
    (SCHEDULING, ["priorityclasses"], ["get"]),
)


def cluster_objects() -> list[Object]:
    """What is the whole cluster's. No pod of an app is ended so that one with the class finds room."""
    about = "What a robot's work hangs on: its ROS master, and the keeper beside it"
    body: Object = {"value": FIRST, "globalDefault": False, "preemptionPolicy": "Never", "description": about}
    priority = made(f"{SCHEDULING}/v1", "PriorityClass", PRIORITY, labels=owner_labels(None), **body)
    return [priority, *admission_objects()]


def keeper_access(robot: Robot) -> list[Object]:
    """The account of the robot's keeper, its Role in the robot's namespace, and before it what is the cluster's.

    Nothing for an external master.
    """
    if robot.master.mode == "external":
        return []
    home, labels = context.master_namespace(robot), owner_labels(context.master_owner(robot))
    account = {"name": names.KEEPER_NAME, "namespace": home}
    objects = [
        *cluster_objects(),
        made("v1", "ServiceAccount", names.KEEPER_NAME, home, labels),
        *_rights(account, KEEPER, robot.namespace, owner_labels(robot.name)),
    ]
    if home == names.FLEET_NAMESPACE:
        objects += _rights(account, (*KEEPER, FIND_ROBOTS), home, labels)
        objects += _rights(account, (LIST_LEASES,), "", labels)
        kept = {**owner_labels(robot.name), names.LABEL_KEPT: "true"}
        objects.append(config_map(robot.namespace, home, kept, {}))
    return objects


def controller_access() -> list[Object]:
    """The controller's account, its role, and the Secret that the cluster puts its token into."""
    token = made("v1", "Secret", CONTROLLER, NAMESPACE, type="kubernetes.io/service-account-token")
    token["metadata"]["annotations"] = {"kubernetes.io/service-account.name": CONTROLLER}
    account = {"name": CONTROLLER, "namespace": NAMESPACE}
    return [made("v1", "ServiceAccount", CONTROLLER, NAMESPACE), *_rights(account, CONTROLLERS), token]


def _rights(
    account: Mapping[str, str], rules: Sequence[Rule], namespace: str = "", labels: Mapping[str, str] | None = None
) -> list[Object]:
    """A role of the account's name in a namespace, or without one in the whole cluster, given to the account.

    `account` is `{name, namespace}`.
    """
    kind, name = "Role" if namespace else "ClusterRole", account["name"]
    allowed = [{"apiGroups": [group], "resources": [*kinds], "verbs": [*verbs]} for group, kinds, verbs in rules]
    role = {"apiGroup": RBAC, "kind": kind, "name": name}
    subjects = [{"kind": "ServiceAccount", **account}]
    return [
        made(f"{RBAC}/v1", kind, name, namespace, labels, rules=allowed),
        made(f"{RBAC}/v1", f"{kind}Binding", name, namespace, labels, roleRef=role, subjects=subjects),
    ]
