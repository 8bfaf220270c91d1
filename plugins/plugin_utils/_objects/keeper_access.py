# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a keeper may do in its cluster, in the namespaces of its robots: take back what nobody proved, begin a pod anew
that hangs, and say so. Pure.

A keeper of one robot works in the robot's own namespace. That of a shared master works in those of all robots, which
each bring it their Role, and tell it of themselves by a ConfigMap in the namespace `fleet`: neither may it look for
namespaces, nor does its pod change with every robot that is added.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import Object
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import context, names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.common import config_map, owner_labels

RBAC = "rbac.authorization.k8s.io"
GO_BACK = (
    ("apps", "deployments", ("get", "list", "patch")),
    ("", "pods", ("list",)),
    ("", "configmaps", ("get", "patch")),  # records: what became of a step, and that a version is proven
    ("coordination.k8s.io", "leases", ("get", "create", "update")),
)
BEGIN_ANEW = (("", "pods/eviction", ("create",)), ("", "events", ("create",)))  # what hangs
LEASES = ("coordination.k8s.io", "leases", ("list",))  # of all robots at once: where something may be due
FIND_ROBOTS = ("", "configmaps", ("list",))
Rule = tuple[str, str, Sequence[str]]


def keeper_access(robot: Robot) -> list[Object]:
    """The account of the robot's keeper, and its Role in the robot's namespace; nothing for an external master."""
    if robot.master.mode == "external":
        return []
    home = context.master_namespace(robot)
    objects = [
        _account(home, context.master_owner(robot)),
        *_role(robot.namespace, robot.name, home, (*GO_BACK, *BEGIN_ANEW)),
    ]
    if home == names.FLEET_NAMESPACE:
        labels = {**owner_labels(robot.name), names.LABEL_KEPT: "true"}
        objects += _role(home, None, home, (*GO_BACK, *BEGIN_ANEW, FIND_ROBOTS))
        objects += _role("", None, home, (LEASES,))
        objects.append(config_map(robot.namespace, home, labels, {}))
    return objects


def _account(namespace: str, owner: str | None) -> Object:
    return {"apiVersion": "v1", "kind": "ServiceAccount", "metadata": _metadata(namespace, owner)}


def _role(namespace: str, owner: str | None, home: str, rules: Sequence[Rule]) -> list[Object]:
    """The Role in a namespace, or without one in the cluster, given to the keeper with its account in `home`."""
    kind = "Role" if namespace else "ClusterRole"
    metadata = _metadata(namespace, owner)
    allowed = [{"apiGroups": [group], "resources": [kind], "verbs": list(verbs)} for group, kind, verbs in rules]
    return [
        {"apiVersion": f"{RBAC}/v1", "kind": kind, "metadata": metadata, "rules": allowed},
        {
            "apiVersion": f"{RBAC}/v1",
            "kind": f"{kind}Binding",
            "metadata": metadata,
            "roleRef": {"apiGroup": RBAC, "kind": kind, "name": names.KEEPER_NAME},
            "subjects": [{"kind": "ServiceAccount", "name": names.KEEPER_NAME, "namespace": home}],
        },
    ]


def _metadata(namespace: str, owner: str | None) -> Mapping[str, Any]:
    where = {"namespace": namespace} if namespace else {}
    return {"name": names.KEEPER_NAME, **where, "labels": owner_labels(owner)}
