# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A new version that starts beside the old one, before anything is held, and waits there for the old one's end.

Where two versions cannot work at once (`drain`, `replace`) the app is away for as long as the change takes. What needs
no such change, a pod with its place, its volumes and its image, is made before, while the old version works: so it is
away for less long, and not at all for one that cannot even be started. The pod waits by itself (`_pod/namesake.py`).

A launch file of which only some nodes wait for the old ones' end (`launch.replace`) gets Ready with the others. So that
the old pod does not go by that alone, while goals of its action servers are not held yet, the Deployment asks for more
seconds of being Ready than a step lasts. Pure.
"""

from __future__ import annotations

from collections.abc import Iterable

from ...module_utils._step.objects import app_of
from .._objects.app import OVERLAP_STRATEGY
from .._objects.pod_code import waits_for_the_old
from .manifests import with_strategy
from .plan import Step
from .step import new_containers
from .world import Calm, Object


def early(step: Step, calm: Calm, kept: bool = True) -> list[Object]:
    """The step's Deployments that can start so; none of a step that was cut off, or of which somebody changed one.

    What is `calm` are the actions whose goals the step holds: without any a launch file has nothing to wait for. Nor
    has it where the robot's master is not `kept`: should the run die, Kubernetes would hand over in its own time, and
    nobody would hold the goals.
    """
    if step.kind != "app" or step.unproven or step.drifted:
        return []
    return [item for item in step.workloads if _waits_beside(step, item, kept and bool(calm.actions))]


def _waits_beside(step: Step, item: Object, held: bool) -> bool:
    app = app_of(item)
    if waits_for_the_old(item):
        return _keeps_its_name(step, app)
    return held and _holds_nodes(step, app)


def _holds_nodes(step: Step, app: str) -> bool:
    launch = step.launched.get(app)
    return app in step.previous and launch is not None and bool(launch.new and launch.held)


def _keeps_its_name(step: Step, app: str) -> bool:
    node = step.new_nodes.get(app)
    return app in step.previous and bool(node) and node == step.old_nodes.get(app)


def beside(objects: Iterable[Object], chosen: Iterable[Object]) -> list[Object]:
    """Of a step's objects the ConfigMaps, and these Deployments, the old pods of which stay for now."""
    apps = {app_of(item) for item in chosen}
    first = (
        item
        for item in objects
        if item["kind"] == "ConfigMap" or (item["kind"] == "Deployment" and app_of(item) in apps)
    )
    return [
        item if item["kind"] != "Deployment" or waits_for_the_old(item) else _patient(item)
        for item in with_strategy(first, OVERLAP_STRATEGY)
    ]


def _patient(deployment: Object) -> Object:
    """Not available for as long as the API allows; once it is applied without, its pod is available at once."""
    spec = deployment["spec"]
    return {**deployment, "spec": {**spec, "minReadySeconds": spec.get("progressDeadlineSeconds", 600) - 1}}


def took_over(step: Step, pods: Iterable[Object]) -> bool:
    """Whether the new version works already, because the old one has ended by itself."""
    return any(container.get("ready") for container in new_containers(step, pods))
