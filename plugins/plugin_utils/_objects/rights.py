# SPDX-License-Identifier: GPL-3.0-or-later
"""Accounts and what they may do in a cluster: a keeper's, and that of a controller such as AWX. Pure.

A keeper takes back what nobody proved, begins a pod anew that hangs, and says so. That of one robot works in the
robot's own namespace. That of a shared master works in those of all robots, which each bring it their Role, and tell it
of themselves by a ConfigMap in the namespace `fleet`: neither may it look for namespaces, nor does its pod change with
every robot that is added.

A controller has what update, rollback and status ask of a cluster's API: they write in the namespaces of robots, and
see what is anywhere. Nobody may give away what he has not, so there it has what the keeper's Role has, too.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain

from ...module_utils._step.objects import Object
from ...module_utils._step.update_record import NAME as UPDATES
from .._model import context, names
from .._model.context import Robot
from .admission import API, admission_objects
from .common import PRIORITY, config_map, made, owner_labels
from .placement import pod_policy

RBAC, LEASES, SCHEDULING = "rbac.authorization.k8s.io", "coordination.k8s.io", "scheduling.k8s.io"
NETWORK = "networking.k8s.io"


def _rule(group: str, kinds: Sequence[str], verbs: Sequence[str], *names: str) -> Object:
    """Kinds of an API group, and what may be done with them: with all, or with those of these names."""
    allowed = {"apiGroups": [group], "resources": [*kinds], "verbs": [*verbs]}
    return {**allowed, "resourceNames": [*names]} if names else allowed


KEEPER = (
    _rule("apps", ["deployments"], ["get", "list", "patch"]),
    _rule("", ["pods"], ["list", "watch"]),
    _rule("", ["pods/status"], ["patch"]),  # readiness gates: `admission.py` says how much of it
    _rule("", ["configmaps"], ["get", "patch"]),  # records: what became of a step, and that a version is proven
    _rule(LEASES, ["leases"], ["get", "create", "update"]),
    _rule("", ["pods/eviction"], ["create"]),  # of what hangs
    _rule("", ["events"], ["create"]),
)

CONTROLLER, HOME = "rosops-fleet-controller", "kube-system"
READ = ["get", "list", "watch"]
WRITE = [*READ, "create", "patch", "delete"]
OWNED = ["configmaps", "services", "serviceaccounts", "persistentvolumeclaims", "limitranges", "resourcequotas"]
IN_NAMESPACES = (
    *KEEPER,
    _rule("", ["namespaces"], ["get", "patch"]),  # its own one
    _rule("", OWNED, WRITE),
    _rule("", ["secrets"], ["get", "list", "create", "patch"]),  # of registries
    _rule("", ["pods", "pods/log", "events"], READ),
    _rule("", ["services/proxy"], ["get", "create"], f"{names.KEEPER_NAME}:{names.KEEPER_PORT}"),  # the keeper's door
    _rule("apps", ["deployments"], WRITE),
    _rule("apps", ["replicasets"], READ),
    _rule(RBAC, ["roles", "rolebindings"], WRITE),
    _rule(NETWORK, ["networkpolicies"], WRITE),
)
# It writes nothing there. A status shows what is anywhere; a claim's class and a node are in no namespace.
IN_CLUSTER = (
    _rule("", ["nodes"], READ),
    _rule("storage.k8s.io", ["storageclasses"], READ),
    _rule("", ["pods", "services", "persistentvolumeclaims"], ["list"]),
    _rule("apps", ["deployments"], ["list"]),
    _rule("", ["configmaps"], ["list"], UPDATES),
    # made by whoever administers the cluster
    _rule(API.rpartition("/")[0], ["validatingadmissionpolicies", "validatingadmissionpolicybindings"], ["get"]),
    _rule(RBAC, ["clusterroles", "clusterrolebindings"], ["get"]),
    _rule(SCHEDULING, ["priorityclasses"], ["get"]),
)
# Namespaces of others, and there: whose the cluster is and what became of hosts; whether a kubelet is heard of.
ELSEWHERE = {
    HOME: (
        _rule("", ["configmaps"], ["get"], names.IDENTITY),
        _rule("", ["configmaps"], ["get", "list", "patch"], names.OUTCOMES),
    ),
    "kube-node-lease": (_rule(LEASES, ["leases"], ["get"]),),
}


def cluster_objects() -> list[Object]:
    """What is the whole cluster's. No pod of an app, whose priority is 0, is ended so that one of ours finds room."""
    about = "What a robot's work hangs on: its ROS master, and the keeper beside it"
    body: Object = {"value": 1_000_000, "globalDefault": False, "preemptionPolicy": "Never", "description": about}
    priority = made(f"{SCHEDULING}/v1", "PriorityClass", PRIORITY, labels=owner_labels(None), **body)
    return [priority, *admission_objects(), *pod_policy()]


def keeper_access(robot: Robot) -> list[Object]:
    """The account of the robot's keeper, its Role in the robot's namespace, and before it what is the cluster's."""
    home, labels = context.master_namespace(robot), owner_labels(context.master_owner(robot))
    account = {"name": names.KEEPER_NAME, "namespace": home}
    objects = [
        *cluster_objects(),
        made("v1", "ServiceAccount", names.KEEPER_NAME, home, labels),
        *_rights(account, KEEPER, robot.namespace, owner_labels(robot.name)),
    ]
    if home == names.FLEET_NAMESPACE:
        objects += _rights(account, (*KEEPER, _rule("", ["configmaps"], ["list"])), home, labels)
        # of all robots at once: where something may be due
        objects += _rights(account, [_rule(LEASES, ["leases"], ["list"])], "", labels)
        kept = {**owner_labels(robot.name), names.LABEL_KEPT: "true"}
        objects.append(config_map(robot.namespace, home, kept, {}))
    return objects


def controller_access(namespaces: Iterable[str]) -> list[Object]:
    """The controller's account, and what it may in these namespaces and elsewhere."""
    account = {"name": CONTROLLER, "namespace": HOME}
    places = {"": IN_CLUSTER, **ELSEWHERE, **dict.fromkeys(namespaces, IN_NAMESPACES)}
    rights = chain.from_iterable(_rights(account, rules, namespace) for namespace, rules in places.items())
    outcomes = config_map(names.OUTCOMES, HOME, owner_labels(None), {})  # which it may not make itself
    return [made("v1", "ServiceAccount", CONTROLLER, HOME), outcomes, *rights]


def _rights(
    account: Mapping[str, str], rules: Sequence[Object], namespace: str = "", labels: Mapping[str, str] | None = None
) -> list[Object]:
    """A role of the account's name, in a namespace or in the whole cluster, given to that, `{name, namespace}`."""
    kind, name = "Role" if namespace else "ClusterRole", account["name"]
    role = {"apiGroup": RBAC, "kind": kind, "name": name}
    subjects = [{"kind": "ServiceAccount", **account}]
    return [
        made(f"{RBAC}/v1", kind, name, namespace, labels, rules=[*rules]),
        made(f"{RBAC}/v1", f"{kind}Binding", name, namespace, labels, roleRef=role, subjects=subjects),
    ]
