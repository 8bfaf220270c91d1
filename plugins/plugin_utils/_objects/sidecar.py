# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The hooks beside an app whose image has no Python: a container of the ROS master's image. Pure.

It is a sidecar as Kubernetes means it, an init container that stays (KEP-753, from 1.29 on): the app's container is
started after it and ended before it, so that each start and each stop finds it there.
"""

from __future__ import annotations

from collections.abc import Sequence

from ...module_utils._pod.sidecar import PORT
from ...module_utils._step.objects import Object
from .._model import context, names
from .._model.app import App
from .._model.context import Robot
from .common import FOR_EVER, ONE_HEAP
from .pod_code import STARTED_TIMEOUT, begin_after, code_command, code_mount, steady_probe

# At rest a bare interpreter; a look at the graph, or a stop, is a second one for as long as it lasts.
RESOURCES = {"requests": {"cpu": "5m", "memory": "16Mi"}, "limits": {"memory": "96Mi"}}
BEGIN_TIMEOUT = 3600  # s; then it is asked once more


def _asked(path: str) -> Object:
    return {"httpGet": {"path": path, "port": PORT}}


def _startup(path: str, timeout: int) -> Object:
    return {**_asked(path), "periodSeconds": 1, "timeoutSeconds": timeout, "failureThreshold": FOR_EVER}


def sidecar(app: App, robot: Robot, environment: Sequence[Object]) -> Object:
    """The container; `environment` is what the hooks have to know. Once it has started, the app's own may begin."""
    return {
        "name": names.SIDECAR,
        "image": robot.master.image,
        "imagePullPolicy": "IfNotPresent",
        "restartPolicy": "Always",
        "command": [*code_command("sidecar"), *begin_after(app, context.graph_node(app, robot))],
        "env": [*environment, ONE_HEAP],
        "resources": RESOURCES,
        "volumeMounts": [code_mount()],
        "startupProbe": _startup("/begin", BEGIN_TIMEOUT),
    }


def asking_fields(app: App) -> Object:
    """What the app's container has of it: the same moments as with hooks of its own, asked for by the kubelet."""
    command = app.readiness.command
    return {
        "startupProbe": _startup("/started", STARTED_TIMEOUT),
        **({"readinessProbe": steady_probe(command)} if command else {}),
        "lifecycle": {"preStop": _asked("/stop")},
    }
