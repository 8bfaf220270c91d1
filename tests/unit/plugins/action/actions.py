# SPDX-License-Identifier: GPL-3.0-or-later
"""An action plugin run by itself: arguments and variables in, result out; and what a controller may."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.rights import controller_access


def run(
    module: Any, args: dict[str, Any], task_vars: dict[str, Any], check_mode: bool = False, **environment: str
) -> dict[str, Any]:
    task = SimpleNamespace(args=args, check_mode=check_mode, async_val=0, diff=True, environment=None, no_log=False)
    task.environment = [environment] if environment else None
    connection = SimpleNamespace(_shell=SimpleNamespace(tmpdir="/unused", env_prefix=lambda **_: ""))
    templar = SimpleNamespace(template=lambda value: value)
    made = module.ActionModule(
        task=task, connection=connection, play_context=None, loader=None, templar=templar, shared_loader_obj=None
    )
    found: dict[str, Any] = made.run(task_vars={"inventory_hostname": "robot1", **task_vars})
    return found


def k3s_of(host: str, *servers: str, **more: Any) -> dict[str, Any]:
    """Variables of the role k3s of a host, which is one of its cluster's servers or their agent."""
    return {
        "inventory_hostname": host, "k3s_node_name": host, "k3s_role": "server" if host in servers else "agent",
        "k3s_cluster": "edge", "k3s_server_hosts": [*servers], "k3s_kubeconfig_path": "", **more,
    }  # fmt: skip


SPACES = ("robot-robot1", "robot-robot2")


def allows(verb: str, group: str, resource: str, namespace: str = "", name: str = "") -> bool:
    """Whether a controller may, as the API server judges it: in a namespace, or without one in all of them."""
    roles = [one for one in controller_access(SPACES) if one["kind"] in ("Role", "ClusterRole")]
    return any(
        group in rule["apiGroups"]
        and resource in rule["resources"]
        and verb in rule["verbs"]
        and ("resourceNames" not in rule or name in rule["resourceNames"])
        for role in roles
        if role["metadata"].get("namespace") in (None, namespace)
        for rule in role["rules"]
    )
