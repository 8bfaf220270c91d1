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

from ...module_utils._step.objects import Object
from .._model import context, names
from .._model.context import Robot
from .common import config_map, made, owner_labels
from .rights import Rule, rights

GO_BACK: tuple[Rule, ...] = (
    ("apps", ["deployments"], ["get", "list", "patch"]),
    ("", ["pods"], ["list"]),
    ("", ["configmaps"], ["get", "patch"]),  # records: what became of a step, and that a version is proven
    ("coordination.k8s.io", ["leases"], ["get", "create", "update"]),
)
BEGIN_ANEW: tuple[Rule, ...] = (("", ["pods/eviction"], ["create"]), ("", ["events"], ["create"]))  # what hangs
LEASES: Rule = ("coordination.k8s.io", ["leases"], ["list"])  # of all robots at once: where something may be due
FIND_ROBOTS: Rule = ("", ["configmaps"], ["list"])


def keeper_access(robot: Robot) -> list[Object]:
    """The account of the robot's keeper, and its Role in the robot's namespace; nothing for an external master."""
    if robot.master.mode == "external":
        return []
    home, labels = context.master_namespace(robot), owner_labels(context.master_owner(robot))
    account = {"name": names.KEEPER_NAME, "namespace": home}
    objects = [
        made("v1", "ServiceAccount", names.KEEPER_NAME, home, labels),
        *rights(account, (*GO_BACK, *BEGIN_ANEW), robot.namespace, owner_labels(robot.name)),
    ]
    if home == names.FLEET_NAMESPACE:
        objects += rights(account, (*GO_BACK, *BEGIN_ANEW, FIND_ROBOTS), home, labels)
        objects += rights(account, (LEASES,), "", labels)
        kept = {**owner_labels(robot.name), names.LABEL_KEPT: "true"}
        objects.append(config_map(robot.namespace, home, kept, {}))
    return objects
