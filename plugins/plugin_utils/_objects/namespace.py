# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot's namespace, who may do what there, and its claims. Pure and deterministic; no I/O, no clock, no random.

What is the whole fleet's (namespace `fleet`: a shared master, apps of scope `fleet`) comes out of every robot, the same
bytes each time: applying it again is no change, and no robot's absence keeps it from existing.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence

from ...module_utils._common.documents import Variables
from ...module_utils._common.errors import SpecError
from ...module_utils._step.objects import Object
from .._model import context, names
from .._model.app import Volume
from .._model.context import Robot
from .common import made, owner_labels
from .rights import keeper_access

POD_SECURITY = "pod-security.kubernetes.io/enforce"


def namespace_objects(robot: Robot) -> list[Object]:
    """The robot's namespace with quota, limits and its keeper's rights; the namespace `fleet` where it needs that."""
    labels = owner_labels(robot.name)
    access = {names.LABEL_HOST_ACCESS: "true"} if robot.edge_host_access else {}
    level = {POD_SECURITY: robot.pod_security} if robot.pod_security else {}
    objects = [made("v1", "Namespace", robot.namespace, labels={**labels, **level, **access})]
    if robot.quota:
        quota = {"hard": _texts(robot.quota)}
        objects.append(made("v1", "ResourceQuota", "robot", robot.namespace, labels, spec=quota))
    if robot.limits:
        limits = [{"type": "Container", **{key: _texts(value) for key, value in robot.limits.items()}}]
        objects.append(made("v1", "LimitRange", "robot", robot.namespace, labels, spec={"limits": limits}))
    if needs_fleet_namespace(robot):
        objects.append(made("v1", "Namespace", names.FLEET_NAMESPACE, labels={**owner_labels(None), **access}))
    return [*objects, *keeper_access(robot)]


def pull_secret_objects(robot: Robot, pull_secrets: Sequence[Variables]) -> list[Object]:
    """Registry credentials (robot_namespace_pull_secrets) as Secrets, wherever pods of the robot run."""
    fleet = [(names.FLEET_NAMESPACE, None)] if needs_fleet_namespace(robot) else []
    kind = "kubernetes.io/dockerconfigjson"
    return [
        made("v1", "Secret", secret["name"], namespace, owner_labels(owner), type=kind, data=_docker_config(secret))
        for namespace, owner in [(robot.namespace, robot.name), *fleet]
        for secret in pull_secrets
        if secret.get("registry")  # else it is somebody else's to keep there
    ]


def storage_objects(robot: Robot) -> list[Object]:
    """A claim `<name>-pvc` per volume, in the namespace of the apps that mount it (the robot's if none does)."""
    users: dict[str, list[str]] = {}
    for app in robot.apps:
        for mount in app.volumes:
            users.setdefault(mount.name, []).append(context.namespace_of(app, robot))
    return [
        _claim(volume, namespace, None if namespace == names.FLEET_NAMESPACE else robot.name)
        for volume in robot.volumes
        for namespace in dict.fromkeys(users.get(volume.name) or [robot.namespace])
    ]


def removed_claims(robot: Robot, volumes: Sequence[str], confirmed: bool) -> list[Object]:
    """The claims of volumes to delete, with their data. SpecError if that is not confirmed, or one is still wanted."""
    still = {volume.name for volume in robot.volumes} & set(volumes)
    if volumes and (still or not confirmed):
        raise SpecError(
            f"storage_remove_claims would delete the data of {', '.join(volumes)} on {robot.name}. "
            "It needs storage_remove_confirm=true, and volumes that persistent_storage no longer has."
        )
    return [_claim(Volume(name, ""), robot.namespace, robot.name) for name in volumes]


def needs_fleet_namespace(robot: Robot) -> bool:
    """Whether something of this robot lives in the namespace `fleet`."""
    return bool(of_fleet(robot))


def of_fleet(robot: Robot) -> list[str]:
    """What of it that is: a shared master, and apps of the whole fleet."""
    shared = [names.MASTER_NAME] if robot.master.mode == "shared" else []
    return [*shared, *(app.name for app in robot.apps if app.scope == "fleet")]


def _claim(volume: Volume, namespace: str, robot: str | None) -> Object:
    size = {"requests": {"storage": str(volume.size)}}
    of_class = {} if volume.storage_class is None else {"storageClassName": volume.storage_class}
    spec = {"accessModes": [volume.access_mode], "resources": size, **of_class}
    return made("v1", "PersistentVolumeClaim", names.claim_name(volume.name), namespace, owner_labels(robot), spec=spec)


def _docker_config(secret: Variables) -> dict[str, str]:
    """The file that `docker login` writes, base64 as Kubernetes wants it in `data`."""
    user, password = str(secret["username"]), str(secret["password"])
    auth = base64.b64encode(f"{user}:{password}".encode()).decode()
    config = {"auths": {secret["registry"]: {"username": user, "password": password, "auth": auth}}}
    return {".dockerconfigjson": base64.b64encode(json.dumps(config, sort_keys=True).encode()).decode()}


def _texts(quantities: Mapping[str, object]) -> dict[str, str]:
    """Quantities as text: `2` and `"2"` are the same to Kubernetes, but not to a comparison with what it stores."""
    return {str(key): str(value) for key, value in quantities.items()}
