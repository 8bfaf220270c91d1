# SPDX-License-Identifier: GPL-3.0-or-later
"""What an app has beside its Deployment: ConfigMaps of its files in the inventory, and the Service of its ports. Pure.

A ConfigMap is named by what is in it and never changes: other content is another map, so another pod template and
another revision. The version before keeps its own map, for as long as there is a way back to it. The Service asks each
pod for a port by its name: while two versions are there, or one goes back, either has its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from ...module_utils._step.objects import Object
from .._model import context, names
from .._model.app import App, Port
from .._model.context import Robot
from .common import canonical_hash, config_map, made, mount, object_labels, owner_labels, pod_selector

DIGITS = 8  # of the content's hash


def belongings(robot: Robot) -> list[Object]:
    """All apps' ConfigMaps, then all their Services, each in the order of ros_apps."""
    return [*_file_maps(robot), *(_service(app, robot) for app in robot.apps if app.ports)]


def file_volumes(app: App) -> Iterable[tuple[Object, Object]]:
    """Pairs of a pod's volume and the container's mount of it, one for each file."""
    for number, item in enumerate(app.files):
        name = f"file-{number}"
        at = {"items": [{"key": item.key or name, "path": name}], "defaultMode": int(item.mode, 8)}
        kind, held = ("secret", {"secretName": item.secret}) if item.secret else ("configMap", {"name": _map_name(app)})
        yield {"name": name, kind: {**held, **at}}, {**mount(name, item.path, read_only=True), "subPath": name}


def container_ports(app: App) -> list[Object]:
    """The container's ports; those of the host's network are the host's anyway."""
    return [_named(port, containerPort=port.port, hostPort=port.host_port) for port in app.ports]


def _named(of: Port, **numbers: int | str | None) -> Object:
    """What a port is called, and those of its numbers that it has."""
    return {"name": of.name, "protocol": of.protocol, **{key: one for key, one in numbers.items() if one}}


def _file_maps(robot: Robot) -> Iterator[Object]:
    for app in robot.apps:
        if content := _content(app):
            labels = {**owner_labels(owner_of(app, robot)), names.LABEL_FILES: app.name}
            held = config_map(_map_name(app), context.namespace_of(app, robot), labels, content)
            yield {**held, "immutable": True}


def _content(app: App) -> dict[str, str]:
    """Key in the ConfigMap -> text."""
    return {f"file-{number}": item.content for number, item in enumerate(app.files) if not item.secret}


def _map_name(app: App) -> str:
    return f"{app.name}-files-{canonical_hash(_content(app))[:DIGITS]}"


def _service(app: App, robot: Robot) -> Object:
    ports = [_named(port, port=port.port, targetPort=port.name, nodePort=port.node_port) for port in app.ports]
    outside = any(port.node_port for port in app.ports)
    labels = object_labels(app.name, owner_of(app, robot))
    spec = {"type": "NodePort" if outside else "ClusterIP", "selector": pod_selector(app.name), "ports": ports}
    return made("v1", "Service", app.name, context.namespace_of(app, robot), labels, spec=spec)


def owner_of(app: App, robot: Robot) -> str | None:
    """The robot to which an app belongs; None for one of the whole fleet."""
    return None if app.scope == "fleet" else robot.name
