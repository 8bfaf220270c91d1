# SPDX-License-Identifier: GPL-3.0-or-later
"""What ends a robot's rights in its cluster, and which of its secrets are left for its user to change. Pure.

k3s has no list of certificates that are revoked, and a kubelet's holds for a year. So a policy of the API server
refuses whatever is written in the node's name, its Node among it (ValidatingAdmissionPolicy, Kubernetes 1.30 and
later). A node may read only what pods need that are bound to it (authorization mode Node): without Node and pods that
is nothing of ours. Nor does k3s' supervisor give another certificate of a node to one whose Node is gone
(pkg/nodepassword/validate.go).

The password of the Node (`<node>.node-password.k3s`) guards nothing here: k3s deletes it with the Node
(docs.k3s.io/architecture, "How Agent Node Registration Works"). The policy keeps the name, whoever comes under it.
"""

from __future__ import annotations

from base64 import b64decode
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from ...module_utils._common.documents import Variables
from ...module_utils._step.objects import Object
from .._model.context import Robot
from .admission import policy
from .parts import APPS, MASTER, workload_objects

REVOKER = "rosops.fleet.revoke"  # as holder of the robot's Lease, too
NODES = "system:nodes"  # the group of all kubelets
SYSTEM = "kube-system"
NAMING = ("secretKeyRef", "secretRef", "secret")  # what is in them names a Secret


def policy_name(node: str) -> str:
    """Of the policy, and of what puts it in force."""
    return f"rosops-fleet-revoked-{node}"


def described(node: str) -> str:
    """By this one knows the bootstrap tokens that were made for a node."""
    return f"rosops.fleet: {node}"


def user_of(node: str) -> str:
    """As the API server knows its kubelet."""
    return f"system:node:{node}"


def refusal_of(node: str) -> str:
    """What whoever comes under its name is told."""
    return f"the node {node} is revoked ({REVOKER}); k3s_enrol takes it in again, by its inventory name"


def revocation_objects(node: str) -> list[Object]:
    """The policy, and what puts it in force."""
    condition = {"node": f"request.userInfo.username == '{user_of(node)}'"}
    validation = {"expression": "false", "message": refusal_of(node), "reason": "Forbidden"}
    return policy(policy_name(node), {"*/*/*": ("*",)}, condition, {}, [validation])


def tokens_of(node: str, secrets: Iterable[Object]) -> list[str]:
    """Names of the Secrets of kube-system that are bootstrap tokens made for the node."""
    wanted = described(node)
    return [
        str(one["metadata"]["name"])
        for one in secrets
        if b64decode((one.get("data") or {}).get("description") or "").decode(errors="replace") == wanted
    ]


def accounts_of(pods: Iterable[Object]) -> list[str]:
    """`namespace/name` of the accounts whose tokens are in these pods; such a token ends with its pod."""
    return sorted(
        {f"{pod['metadata']['namespace']}/{pod['spec'].get('serviceAccountName') or 'default'}" for pod in pods}
    )


def left_to_user(
    robot: Robot, variables: Variables, secrets: Iterable[Object] = (), workloads: Iterable[Object] = ()
) -> list[str]:
    """What the robot has, holds elsewhere, and can be changed only where it comes from. Names alone.

    `variables` are those of the role k3s, `secrets` the Secrets of the robot's namespace, `workloads` what may run on
    every node.
    """
    ours = [*workload_objects(robot, (MASTER, APPS)), *workloads]
    named = {f"{one['metadata'].get('namespace', '')}/{name}" for one in ours for name in _secret_names(one)}
    named |= {f"{robot.namespace}/{name}" for name in robot.pull_secrets}
    named |= {f"{one['metadata']['namespace']}/{one['metadata']['name']}" for one in secrets}
    registries = sorted(variables["k3s_registries"].get("configs") or {})
    keys = sorted(key for key in variables["k3s_config"] if key.startswith("vpn"))
    left = [
        *(f"Secret {name}" for name in sorted(named)),
        *(f"the login for {name} (k3s_registries)" for name in registries),
        *(f"what k3s_config says as {key}" for key in keys),
        "its SSH host key, its own SSH keys, keys of a VPN, passwords in k3s_environment",
        "what is on its disk: claims, images, logs",
        "its line in the inventory: where it can be reached, runs bring it whatever you change there",
    ]
    if robot.mode == "agent":
        left += [
            "the agents' token (k3s_agent_token), where it joined by a collection that gave that to robots",
            "its way to the edge: close the ports 6443, 8472 and 51820 to it. Until its certificates end it may list "
            "pods with their plain variables, Services and namespaces there",
        ]
    return left


def _secret_names(item: Any) -> Iterator[str]:
    """Names of the Secrets that an object names, wherever."""
    if isinstance(item, (list, tuple)):
        for one in item:
            yield from _secret_names(one)
    if not isinstance(item, Mapping):
        return
    for key, value in item.items():
        if key == "secretName":
            yield str(value)
        elif key == "imagePullSecrets":
            yield from (str(one["name"]) for one in value if one.get("name"))
        elif key in NAMING and isinstance(value, Mapping) and "name" in value:
            yield str(value["name"])
        else:
            yield from _secret_names(value)
