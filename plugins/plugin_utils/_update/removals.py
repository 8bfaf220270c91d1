# SPDX-License-Identifier: GPL-3.0-or-later
"""What the inventory has no more goes where that is asked for, each app by a step of its own. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ...module_utils._common.errors import SpecError
from ...module_utils._step.objects import app_of, handoff_of, node_of
from .._model.context import Robot, wanted_before
from .._objects.master import keeper_objects
from .._objects.parts import APPS
from .addresses import NAMES, SERVING
from .plan import REMOVE, Plan, Request, Step
from .revisions import described, files_owner, identity, kept, key_of
from .world import Live, Object

ALL = "all"


def with_removals(plan: Plan, robot: Robot, live: Live, request: Request) -> Plan:
    """The plan with a step for each app that goes, and what there is of it besides; SpecError.

    What runs goes last, so that a robot whose new version is refused has what it had. What is in the way of a new
    version, by its node's name, a device or a port, goes first.
    """
    wanted = {app.name for app in robot.apps}
    if not (request.remove and request.own and APPS in request.parts) or request.to:
        return plan
    still = sorted(wanted & {*request.remove})
    if still:
        raise SpecError(
            f"update_remove_apps names {', '.join(still)}, which {robot.name} is to have: take it out of ros_apps first"
        )

    # a master of its own, of a robot that has another one by now
    left = NAMES if robot.master.mode != "robot" else ()
    stays = {"", *wanted, *(set(SERVING) - {*left})}
    shows = {*map(key_of, keeper_objects(robot))}  # of an external master, by a name that a keeper may have had

    def goes(item: Object) -> bool:
        app = app_of(item) or files_owner(item)[1]
        ours = item["metadata"]["namespace"] == robot.namespace and app not in stays
        return ours and (ALL in request.remove or app in request.remove)

    going = [item for item in live.deployments if goes(item) and key_of(item) not in shows]
    if going and ALL in request.remove and not robot.apps:
        raise SpecError(
            f"the inventory has no app for {robot.name}, and update_remove_apps is {ALL}: if it is to have none, name "
            f"what goes: {', '.join(map(app_of, going))}"
        )
    first = [item for item in going if _in_the_way(item, plan.steps)]
    last = [item for item in going if item not in first]
    apps = {app_of(item) for item in going}
    return replace(
        plan,
        steps=[*(_removal(item, robot) for item in first), *plan.steps, *(_removal(item, robot) for item in last)],
        orphans=[name for name in plan.orphans if name not in apps],
        remnants=[*plan.remnants, *(identity(item) for item in [*live.maps, *live.services] if goes(item))],
    )


def _removal(item: Object, robot: Robot) -> Step:
    app = app_of(item)
    return Step(
        name=app,
        kind=REMOVE,
        apps=[app],
        handoff=handoff_of(item),
        previous={app: kept(item)},
        old_nodes={app: node_of(item)},
        when=wanted_before(robot),
        windows=robot.windows,
        before={app: described(item)},
    )


def _in_the_way(item: Object, steps: Sequence[Step]) -> bool:
    nodes = {node for step in steps for node in step.new_nodes.values()} - {""}
    taken = [_takes(other) for step in steps for other in step.workloads]
    return node_of(item) in nodes or any(_takes(item) & other for other in taken)


def _takes(deployment: Object) -> set[tuple[str, object]]:
    """What of its host a pod takes for itself alone."""
    pod = deployment["spec"]["template"]["spec"]
    paths = {("path", volume["hostPath"]["path"]) for volume in pod.get("volumes") or [] if "hostPath" in volume}
    ports = {
        ("port", one["hostPort"]) for each in pod["containers"] for one in each.get("ports") or () if "hostPort" in one
    }
    return paths | ports
