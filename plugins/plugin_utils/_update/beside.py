# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A new version that starts beside the old one, before anything is held, and waits there for the old one's end.

Where two versions cannot work at once (`drain`, `replace`) the app is away for as long as the change takes. What needs
no such change, a pod with its place, its volumes and its image, is made before, while the old version works: so it is
away for less long, and not at all for one that cannot even be started. The pod waits by itself (`_pod/namesake.py`).
Pure.
"""

from __future__ import annotations

from collections.abc import Iterable

from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import OVERLAP_STRATEGY
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.pod_code import waits_for_the_old
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.plan import Step
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.revisions import app_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.step import new_containers, with_strategy
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Object


def early(step: Step) -> list[Object]:
    """The step's Deployments that can start so; none of a step that was cut off, or of which somebody changed one."""
    if step.kind != "app" or step.unproven or step.drifted:
        return []
    return [item for item in step.workloads if _keeps_its_name(step, app_of(item)) and waits_for_the_old(item)]


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
    return with_strategy(first, OVERLAP_STRATEGY)


def took_over(step: Step, pods: Iterable[Object]) -> bool:
    """Whether the new version works already, because the old one has ended by itself."""
    return any(container.get("ready") for container in new_containers(step, pods))
