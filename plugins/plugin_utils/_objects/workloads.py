# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot's ctx -> the Kubernetes objects that make it up. Pure and deterministic; no I/O, no clock, no random.

Objects of the whole fleet (namespace `fleet`: a shared master, apps of scope `fleet`) come out of every robot's ctx,
the same bytes each time: applying them again is no change, and no robot's absence keeps them from existing.
"""

from __future__ import annotations

import base64
import json
from typing import Any, Mapping

from ansible_collections.rosops.fleet.plugins.plugin_utils._model import context, names
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_deployment
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.code_maps import hook_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.master import master_objects


def namespace_objects(ctx: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The robot's namespace with quota, limits and pull secrets; the namespace `fleet` where the robot needs it."""
    full = context.complete_context(ctx)
    namespace, robot = full["namespace"], full["robot"]
    objects = [_namespace(namespace, robot)]
    if full["quota"]:
        objects.append(_object("v1", "ResourceQuota", namespace, robot, spec={"hard": _texts(full["quota"])}))
    if full["limits"]:
        limits = [{"type": "Container", **{key: _texts(value) for key, value in full["limits"].items()}}]
        objects.append(_object("v1", "LimitRange", namespace, robot, spec={"limits": limits}))
    objects += _pull_secrets(full["pull_secrets"], namespace, robot)
    if needs_fleet_namespace(full):
        objects.append(_namespace(names.FLEET_NAMESPACE, None))
        objects += _pull_secrets(full["pull_secrets"], names.FLEET_NAMESPACE, None)
    return objects


def storage_objects(ctx: Mapping[str, Any]) -> list[dict[str, Any]]:
    """A claim `<name>-pvc` per volume, in the namespace of the apps that mount it (the robot's if none does)."""
    full = context.complete_context(ctx)
    users: dict[str, list[str]] = {}
    for app in full["apps"]:
        for mount in app["volumes"]:
            users.setdefault(mount["name"], []).append(context.namespace_of(app, full))
    return [
        _claim(volume, namespace, None if namespace == names.FLEET_NAMESPACE else full["robot"])
        for volume in full["volumes"]
        for namespace in dict.fromkeys(users.get(volume["name"]) or [full["namespace"]])
    ]


def ros_master_objects(ctx: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Deployment and Service `ros-master`, in the robot's namespace or in `fleet`; none for an external master."""
    return master_objects(context.complete_context(ctx))


def ros_app_objects(ctx: Mapping[str, Any], code: Mapping[str, str] | None = None) -> list[dict[str, Any]]:
    """One Deployment per app, in the order of ros_apps; with `code` (file name -> text) its ConfigMaps first."""
    full = context.complete_context(ctx)
    maps = [] if code is None else hook_objects(full, code)
    return [*maps, *(app_deployment(app, full) for app in full["apps"])]


def fleet_images(ctx: Mapping[str, Any], placement: str | None = None) -> list[str]:
    """The images a robot's master and apps run, sorted; with `placement` those of local or of remote pods only."""
    images: set[str] = set()
    for item in [*ros_master_objects(ctx), *ros_app_objects(ctx)]:
        if item["kind"] == "Deployment":
            pod = item["spec"]["template"]["spec"]
            where = "local" if names.LABEL_ROBOT in (pod.get("nodeSelector") or {}) else "remote"
            if placement in (None, where):
                containers = [*(pod.get("initContainers") or []), *pod["containers"]]
                images.update(container["image"] for container in containers if container.get("image"))
    return sorted(images)


def ros_conditions(ctx: Mapping[str, Any]) -> dict[str, Any]:
    """What the graph must show when all the robot's apps are up: options of ros_ready, every name in full.

    `{nodes, topics, services, actions, absent, timeout, interval, consecutive}`, and `master_uri` for an external
    master only: the address of a master in the cluster is known to the cluster (its Service), not to the inventory.
    """
    full = context.complete_context(ctx)
    conditions: dict[str, Any] = {key: [] for key in ("nodes", "topics", "services", "actions", "absent")}
    for app in full["apps"]:
        deployment = app_deployment(app, full)
        node = deployment["spec"]["template"]["metadata"]["annotations"][names.ANNOTATION_NODE]
        _add_conditions(conditions, app, context.graph_namespace(app, full), node, context.graph_node(app, full))
    ready = [app["readiness"] for app in full["apps"]] or [context.complete_readiness({})]
    conditions["timeout"] = max(item["timeout"] for item in ready)
    conditions["interval"] = min(item["interval"] for item in ready)
    conditions["consecutive"] = max(item["consecutive"] for item in ready)
    if full["master"]["mode"] == "external":
        conditions["master_uri"] = full["master"]["uri"]
    return conditions


def _add_conditions(conditions: dict[str, Any], app: Mapping[str, Any], namespace: str, node: str, stable: str) -> None:
    readiness = app["readiness"]

    def resolve(name: str) -> str:
        # a private name that is remapped stays below the stable name, the others follow the revision's
        owner = stable if name.startswith("~") and name[1:].lstrip("/") in app["private_names"] else node
        return names.resolve_graph_name(name, namespace, owner)

    found: dict[str, list[Any]] = {
        "nodes": [node] if readiness["nodes"] else [],
        "absent": [resolve(name) for name in readiness["absent"]],
        **{
            kind: [{**item, "name": resolve(item["name"])} for item in readiness[kind]]
            for kind in ("topics", "services", "actions")
        },
    }
    for kind, items in found.items():
        conditions[kind] += [item for item in items if item not in conditions[kind]]


def needs_fleet_namespace(ctx: Mapping[str, Any]) -> bool:
    """Whether something of this robot lives in the namespace `fleet`; ctx is complete."""
    return ctx["master"]["mode"] == "shared" or any(app["scope"] == "fleet" for app in ctx["apps"])


def _labels(robot: str | None) -> dict[str, str]:
    labels = {"app.kubernetes.io/managed-by": names.MANAGER}
    return labels if robot is None else {**labels, names.LABEL_ROBOT: robot}


def _namespace(name: str, robot: str | None) -> dict[str, Any]:
    return {"apiVersion": "v1", "kind": "Namespace", "metadata": {"name": name, "labels": _labels(robot)}}


def _object(api: str, kind: str, namespace: str, robot: str | None, name: str = "robot", **body: Any) -> dict[str, Any]:
    metadata = {"name": name, "namespace": namespace, "labels": _labels(robot)}
    return {"apiVersion": api, "kind": kind, "metadata": metadata, **body}


def _claim(volume: Mapping[str, Any], namespace: str, robot: str | None) -> dict[str, Any]:
    spec: dict[str, Any] = {
        "accessModes": [volume["access_mode"]],
        "resources": {"requests": {"storage": str(volume["size"])}},
    }
    if volume["storage_class"] is not None:
        spec["storageClassName"] = volume["storage_class"]
    return _object("v1", "PersistentVolumeClaim", namespace, robot, names.claim_name(volume["name"]), spec=spec)


def _pull_secrets(secrets: list[Mapping[str, Any]], namespace: str, robot: str | None) -> list[dict[str, Any]]:
    """Registry credentials as Secrets; an item without `registry` names a Secret that somebody else keeps there."""
    return [
        _object(
            "v1",
            "Secret",
            namespace,
            robot,
            secret["name"],
            type="kubernetes.io/dockerconfigjson",
            data={".dockerconfigjson": _docker_config(secret)},
        )
        for secret in secrets
        if secret.get("registry")
    ]


def _docker_config(secret: Mapping[str, Any]) -> str:
    """The file that `docker login` writes, base64 as Kubernetes wants it in `data`."""
    user, password = str(secret["username"]), str(secret["password"])
    auth = base64.b64encode(f"{user}:{password}".encode()).decode()
    config = {"auths": {secret["registry"]: {"username": user, "password": password, "auth": auth}}}
    return base64.b64encode(json.dumps(config, sort_keys=True).encode()).decode()


def _texts(quantities: Mapping[str, Any]) -> dict[str, str]:
    """Quantities as text: `2` and `"2"` are the same to Kubernetes, but not to a comparison with what it stores."""
    return {str(key): str(value) for key, value in quantities.items()}
