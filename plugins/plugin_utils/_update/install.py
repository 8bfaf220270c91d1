# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot on which no app is at work: all that is new comes at once, for nothing can be disturbed. Pure.

Its records say so before anything of it is there, and know no way back. So an installation that was cut off is known by
them: what was installed, was never proven and does not work was never at work, and the next run installs it again.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from ...module_utils._step.objects import app_of
from .._model import names
from .._model.context import Robot
from .._objects.parts import graph_conditions
from .addresses import SERVING
from .plan import Plan, Step
from .revisions import deployments_of
from .world import Live, Object

INSTALL = "install"


def with_install(plan: Plan, robot: Robot) -> Plan:
    """The plan with all that never came up as one step, the last one, where no app is at work.

    What an installation that was cut off has brought up is installed once more: as it is wanted, so that nothing
    becomes of it but a proof. The robot's messages are not asked before the other steps, those of master and keeper:
    the app that would publish them is itself to come, and after them.
    """
    again = [step for step in plan.steps if step.resume and not step.previous]
    installed = {app for step in again for app in step.apps}
    # as long as there are no apps, what serves them is at nobody's work
    at_work = {app for namespace, app in plan.working if namespace == robot.namespace} - {*SERVING}
    if at_work - installed:
        return plan
    new = [step for step in plan.steps if step.fresh or step in again]
    others = [replace(step, when=[]) for step in plan.steps if step not in new]
    return replace(plan, steps=[*others, *([_united(new, robot)] if new else [])])


def _united(steps: Sequence[Step], robot: Robot) -> Step:
    apps = [app for step in steps for app in step.apps]
    return Step(
        name=apps[0] if len(apps) == 1 else INSTALL,
        kind=INSTALL,
        apps=apps,
        handoff="replace",
        objects=[item for step in steps for item in step.objects],
        created=[item for step in steps for item in step.created],
        unproven=[app for step in steps for app in step.unproven],
        new_nodes={app: node for step in steps for app, node in step.new_nodes.items()},
        conditions=promised(robot, apps),
        after={app: found for step in steps for app, found in step.after.items()},
        histories=steps[0].histories,
    )


def promised(robot: Robot, apps: Collection[str]) -> Object:
    """Options of ros_ready: what these apps promise of the graph."""
    return graph_conditions(replace(robot, apps=tuple(app for app in robot.apps if app.name in apps)))


def members(step: Step) -> dict[str, list[Object]]:
    """App -> its Deployments in the step; the master's keeper is the master's."""
    found: dict[str, list[Object]] = {app: [] for app in step.apps}
    for item in deployments_of(step.objects):
        found[app_of(item) if app_of(item) in found else names.MASTER_NAME].append(item)
    return found


def claim_users(live: Live, claims: Collection[Object], leaving: Collection[str] = ()) -> list[str]:
    """`claim app`, for each of the claims that a Deployment mounts; the apps that are `leaving` do not count."""
    wanted = {(claim["metadata"]["namespace"], claim["metadata"]["name"]) for claim in claims}
    return [
        f"{name} {app_of(item)}"
        for item in live.deployments
        if app_of(item) not in leaving
        for volume in item["spec"]["template"]["spec"].get("volumes") or []
        if (name := (volume.get("persistentVolumeClaim") or {}).get("claimName"))
        and (item["metadata"]["namespace"], name) in wanted
    ]
