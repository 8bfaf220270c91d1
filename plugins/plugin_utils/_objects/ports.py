# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""An app's ports -> those of its container, and the Service in front of them. Pure.

The Service asks each pod for a port by its name: while two versions are there, or one goes back, either has its own.
"""

from __future__ import annotations

from ...module_utils._step.objects import Object
from .._model import context
from .._model.app import App
from .._model.context import Robot
from .common import made, object_labels, pod_selector


def container_ports(app: App) -> list[Object]:
    """The container's ports; those of the host's network are the host's anyway."""
    return [
        {
            "name": port.name,
            "containerPort": port.port,
            "protocol": port.protocol,
            **({"hostPort": port.host_port} if port.host_port else {}),
        }
        for port in app.ports
    ]


def port_services(robot: Robot) -> list[Object]:
    """A Service of the app's name for each app with ports, in the order of ros_apps."""
    return [_service(app, robot) for app in robot.apps if app.ports]


def _service(app: App, robot: Robot) -> Object:
    ports = [
        {
            "name": port.name,
            "port": port.port,
            "targetPort": port.name,
            "protocol": port.protocol,
            **({"nodePort": port.node_port} if port.node_port else {}),
        }
        for port in app.ports
    ]
    outside = any(port.node_port for port in app.ports)
    labels = object_labels(app.name, None if app.scope == "fleet" else robot.name)
    spec = {"type": "NodePort" if outside else "ClusterIP", "selector": pod_selector(app.name), "ports": ports}
    return made("v1", "Service", app.name, context.namespace_of(app, robot), labels, spec=spec)
