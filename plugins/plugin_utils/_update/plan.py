# SPDX-License-Identifier: GPL-3.0-or-later
"""What the inventory wants and what the cluster has -> the steps of one robot's update, in order. Pure.

A step changes one app, or the apps of one group together, or the ROS master. It carries all that its phases need: what
to apply, what was there before, the ROS nodes' old and new names, and what has to be idle first.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace

from ...module_utils._common.errors import SpecError
from ...module_utils._ros.contract import Intended
from ...module_utils._step.objects import app_of, handoff_of, has_gate, hash_of, labels_of, name_of, node_of
from ...module_utils._step.record import UNKNOWN, UNPROVEN, Record, answer, mark_of, soaks
from .._model import context, names
from .._model.app import App
from .._model.context import Robot
from .._model.order import in_order
from .._model.windows import ALWAYS, Windows
from .._objects.app import app_objects
from .._objects.master import keeper_objects, ros_core_objects
from .._objects.network import network_policies
from .._objects.parts import APPS, PARTS, POLICED, graph_conditions
from .._objects.parts import MASTER as MASTER_PART
from .._objects.placement import CHOOSES
from .._objects.pod_settings import resting
from .addresses import NAMES, SERVING
from .nodes import Launched, intended, launched
from .revisions import Key, deployments_of, described, files_owner, identity, kept, key_of, working
from .world import Live, Object

MASTER, KEEPER, EXPORTER = names.MASTER_NAME, names.KEEPER_NAME, names.EXPORTER_NAME
PREVIOUS, ALL = "previous", "all"
# When apps of one step hand over in different ways, the one that asks for more care names the step.
HANDOFFS = ("overlap", "replace", "drain")
POLICIES = ("force", "wait", "defer")  # and so of what its apps say about a busy robot
APP, INSTALL, REMOVE = "app", "install", "remove"  # kinds of a step; another one is the master's

Desired = Mapping[str, Sequence[Object]]  # app -> its objects, the master and its keeper as apps of these names


@dataclass(frozen=True)
class Step:
    """One change of one robot."""

    name: str
    kind: str
    apps: Sequence[str]
    handoff: str
    objects: Sequence[Object] = ()
    previous: Mapping[str, Object] = field(default_factory=dict)  # app or keeper -> the Deployment to go back to
    created: Sequence[Object] = ()  # Deployments that were not there: the way back deletes them, and no others
    resume: bool = False  # an earlier run applied just this, and ended before it was proven
    proven: bool = False  # an earlier run proved just this, and only its mark is left to be taken off
    drifted: bool = False  # somebody changed by hand what runs, and did not change its revision with it
    unproven: Sequence[str] = ()  # apps of which something runs that nobody has proven: no graph to hold others to
    new_nodes: Mapping[str, str] = field(default_factory=dict)  # app -> its ROS node after the step
    old_nodes: Mapping[str, str] = field(default_factory=dict)
    launched: Mapping[str, Launched] = field(default_factory=dict)  # apps whose nodes a launch file names
    rest: Sequence[str] = ()  # actions that have to rest, beside those that the apps serve on the graph
    on_busy: str | None = None
    when: Sequence[Object] = ()  # what messages must say before, options of ros_ready
    windows: Windows = ALWAYS  # of time, in which it may be taken
    intended: Intended = field(default_factory=Intended)  # what it is meant to change
    patience: float = 0.0  # seconds until apps are ready of which no pod can tell
    conditions: Object = field(default_factory=dict)  # options of ros_ready: what the apps' readiness asks of the graph
    before: Mapping[str, Mapping[str, str]] = field(default_factory=dict)  # app -> image and revision
    after: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    histories: Mapping[str, Sequence[Object]] = field(default_factory=dict)  # app -> earlier versions, the last first

    @property
    def renames(self) -> dict[str, str]:
        """Old node name -> the name of the revision to come."""
        return {self.old_nodes[app]: new for app, new in self.new_nodes.items() if self.old_nodes.get(app) and new}

    @property
    def workloads(self) -> list[Object]:
        return deployments_of(self.objects)


@dataclass(frozen=True)
class Plan:
    """The steps of a robot.

    `orphans` are the robot's own Deployments that the inventory does not know, `remnants` what goes after all steps.
    """

    steps: Sequence[Step] = ()
    orphans: Sequence[str] = ()
    remnants: Sequence[Object] = ()


@dataclass(frozen=True)
class Request:
    """What is asked for. `to` is empty for what the inventory says, else `previous` or a revision to go back to.

    `remove` names apps that the inventory has no more and that are to go, or says `all`.

    `only` limits it to these apps (`ros-master` is the master), `parts` to these of the robot; `shared` says whether
    what belongs to the whole fleet is this robot's to change, `own` whether what is the robot's own is.
    """

    only: Sequence[str] = ()
    to: str = ""
    shared: bool = True
    own: bool = True
    parts: Collection[str] = PARTS[:-1]  # the last one only looks
    remove: Sequence[str] = ()


def placed(robot: Robot, live: Live, unlabelled: bool) -> Robot:
    """The robot with the labels by which its pods are placed: the old ones where nodes have no others (`unlabelled`).

    What would be another version by these labels alone, keeps its own until it changes anyway.
    """
    every, others = (*NAMES, *(app.name for app in robot.apps)), {labels[not unlabelled] for labels in CHOOSES.values()}
    # nothing is made to be compared where nothing is placed by the other labels, as after an update of all
    pods = ((hash_of(one), one["spec"]["template"]["spec"]) for one in live.deployments)
    there = {digest for digest, pod in pods if others & (pod.get("nodeSelector") or {}).keys()}
    made = rendered(replace(robot, old_labels=() if unlabelled else every)) if there else {}
    stays = {app for app, objects in made.items() if there & {*map(hash_of, deployments_of(objects))}}
    return replace(robot, old_labels=tuple(app for app in every if (app in stays) != unlabelled))


def rendered(robot: Robot) -> Desired:
    """What the robot is to run, and its Services."""
    found: dict[str, list[Object]] = {}
    if robot.master.ours:
        found[KEEPER], found[MASTER] = list(keeper_objects(robot)), list(ros_core_objects(robot))
    for item in app_objects(robot):
        found.setdefault(item["metadata"]["name"], []).append(item)
    return found


def all_of(desired: Desired) -> list[Object]:
    return [item for objects in desired.values() for item in objects]


def promised(robot: Robot, apps: Collection[str]) -> Object:
    """Options of ros_ready: what these apps promise of the graph."""
    return graph_conditions(replace(robot, apps=tuple(app for app in robot.apps if app.name in apps)))


def update_plan(robot: Robot, desired: Desired, live: Live, request: Request, drifted: Collection[Key]) -> Plan:
    """What has to be done about a robot. `drifted`: Deployments (namespace, name) that are not what they say."""
    unknown = sorted(set(request.only) - set(desired))
    if unknown:
        raise SpecError(f"{robot.name} has no app {', '.join(unknown)}; it has {', '.join(desired) or 'none'}")
    running = {key_of(item): item for item in live.deployments}
    there = _Robot(robot, desired, running, live.records, drifted, working(live))
    # a master is not made without its keeper, nor a pod whose gate only a new keeper opens
    gated = (app for app in request.only if has_gate(there.workload(app)) and there.open(app))
    needing = MASTER in request.only or any(gated)
    brought = KEEPER if needing and not request.to else ""
    asked = [
        app for app, objects in desired.items()
        if (not request.only or app in request.only or app == brought)
        and (MASTER_PART if app in NAMES else APPS) in request.parts
        and (request.shared if _is_shared(objects) else request.own)
    ]  # fmt: skip
    if request.to:
        return Plan(_back(there, asked, request))
    known = {*map(key_of, deployments_of(all_of(desired))), (context.master_namespace(robot), KEEPER)}
    left = (key[1] for key in running if key[0] == robot.namespace and key not in known)  # another has the fleet's
    orphans = sorted(name for name in left if name != EXPORTER)
    plan = _with_removals(Plan(there.steps(asked), orphans, _exporters(live, request)), robot, live, request)
    return replace(plan, remnants=[*plan.remnants, *_policies(robot, live, request, plan.orphans)])


@dataclass(frozen=True)
class _Robot:
    """The robot as it is wanted and as it is."""

    robot: Robot
    desired: Desired
    live: Mapping[Key, Object]
    records: Mapping[str, Record]  # app -> that of its last step
    drifted: Collection[Key]  # Deployments that somebody changed by hand
    working: Set[Key]  # those that were proven once, or work now

    def workload(self, app: str) -> Object:
        """The app's Deployment as it is wanted."""
        return next(iter(deployments_of(self.desired[app])))

    def running(self, app: str) -> Object | None:
        """The app's Deployment as it is."""
        return self.live.get(key_of(self.workload(app)))

    def steps(self, apps: Iterable[str], back: bool = False) -> list[Step]:
        """Those that these apps need, in order."""
        changed = [app for app in apps if self.open(app)]
        return _with_install(self, [self.step(members, back) for members in _ordered(self.robot.apps, changed)])

    def step(self, members: Sequence[str], back: bool = False) -> Step:
        apps = {app.name: app for app in self.robot.apps if app.name in members}
        wanted = {app: self.workload(app) for app in members}
        there = {app: item for app in members if (item := self.running(app))}
        changed = any(map(self.differs, members))
        unproven = [
            app for app, item in there.items() if self._unproven(item) and not (changed and self._found_at_work(app))
        ]
        previous = {app: before for app, item in there.items() if (before := self._previous(app, item))}
        running = {app: node_of(item) for app, item in there.items() if app in apps}
        old_nodes = {app: node_of(previous[app]) for app in apps if app in previous} if unproven else running
        return Step(
            name=members[0] if len(members) == 1 else str(next((app.update.group for app in apps.values()), INSTALL)),
            kind=MASTER_PART if list(members) == [MASTER] else APP,
            apps=list(members),
            drifted=any(key_of(item) in self.drifted for item in wanted.values()),
            handoff=max([app.handoff for app in apps.values()] or ["replace"], key=HANDOFFS.index),
            objects=[item for app in members for item in self.desired[app]],
            previous=previous,
            created=[identity(item) for app, item in wanted.items() if app not in there],
            resume=bool(unproven) and not changed,
            proven=not (unproven or changed),
            unproven=unproven,
            new_nodes={app: node_of(wanted[app]) for app in apps},
            old_nodes=old_nodes,
            launched={
                app: found for app, spec in apps.items() if app in previous
                if (found := launched(previous[app], wanted[app], spec))
            },
            rest=self._rest(apps.values()),
            on_busy=max(filter(None, (app.update.on_busy for app in apps.values())), key=POLICIES.index, default=None),
            when=context.wanted_before(self.robot, apps.values()),
            windows=self.robot.windows,
            intended=intended(apps.values(), self.robot, old_nodes, back),
            patience=max([app.readiness.timeout for app in apps.values() if not app.readiness.nodes], default=0.0),
            conditions={} if back else promised(self.robot, members),
            before={app: described(previous[app]) for app in members if app in previous},
            after={app: described(item) for app, item in wanted.items()},
            histories={app: record.history for app, record in self.records.items()},
        )  # fmt: skip

    def differs(self, app: str) -> bool:
        """Whether something else was applied, or is there."""
        wanted, there = self.workload(app), self.running(app)
        return there is None or hash_of(there) != hash_of(wanted) or key_of(wanted) in self.drifted

    def open(self, app: str) -> bool:
        """Whether its Deployment has to be changed, proven, or rid of its mark."""
        there = self.running(app)
        return self.differs(app) or self._unproven(there) or mark_of(there) is not None

    def _previous(self, app: str, there: Object) -> Object | None:
        """What to go back to: the last proven version. Where nobody knows one it is what runs, if it goes."""
        before, unproven = self.records.get(app, Record()).before, self._unproven(there)
        if unproven and before is not None:
            return before
        return kept(there, whole=key_of(there) in self.drifted) if self.differs(app) or not unproven else None

    def _found_at_work(self, app: str) -> bool:
        """Whether it works, and no version before it is known: then its graph is what the next one owes."""
        return key_of(self.workload(app)) in self.working and not self.records.get(app, Record()).history

    def _unproven(self, there: Object | None) -> bool:
        """Whether somebody has to prove it: a step that was cut off, or nobody who has written it down, marked it.

        One that the keeper watches is the keeper's to prove, for as long as nothing else is wanted.
        """
        if there is None or soaks(there, self.records):
            return False
        found = answer(there, self.records)
        return found in UNPROVEN or (found == UNKNOWN and mark_of(there) is not None)

    def _rest(self, apps: Iterable[App]) -> list[str]:
        """Full names of the actions that have to rest by these apps' word, each once."""
        return list(dict.fromkeys(name for app in apps for name in resting(app, self.robot)))


def _with_install(there: _Robot, steps: Sequence[Step]) -> list[Step]:
    """The steps with all that never came up as one, the last one, where no app is at work: nothing can be disturbed.

    Its records say so before anything of it is there, and know no way back. So an installation that was cut off is
    known by them, and what it has brought up is installed once more: as it is wanted, so that nothing becomes of it but
    a proof. The robot's messages are not asked before the other steps: the app that would publish them is itself to
    come, and after them. Nor has a master or keeper of its own, which is at nobody's work, to wait for a window.
    """
    again = [step for step in steps if step.resume and not step.previous]
    installed = {app for step in again for app in step.apps}
    # as long as there are no apps, what serves them is at nobody's work
    if {app for space, app in there.working if space == there.robot.namespace} - installed - {*SERVING}:
        return [*steps]
    new = [step for step in steps if step in again or not there.working & {*map(key_of, step.workloads)}]
    quiet = replace(there.robot, when=())
    others = [
        replace(
            step,
            when=context.wanted_before(quiet, [app for app in quiet.apps if app.name in step.apps]),
            windows=step.windows if _is_shared(step.workloads) else ALWAYS,
        )
        for step in steps if step not in new
    ]  # fmt: skip
    apps = [app for step in new for app in step.apps]
    if not apps:
        return others
    # it replaces nothing
    whole = replace(
        there.step(apps), kind=INSTALL, handoff="replace", previous={}, before={}, old_nodes={}, launched={}
    )
    return [*others, replace(whole, name=INSTALL if len(apps) > 1 else whole.name)]


def _exporters(live: Live, request: Request) -> list[Object]:
    """The exporters of earlier collections, where the keeper that does their work is brought, or is there."""
    if MASTER_PART not in request.parts or (request.only and not {*NAMES} & {*request.only}):
        return []
    there = [identity(item) for item in [*live.deployments, *live.maps] if name_of(item) == EXPORTER]
    return [item for item in there if (request.shared if _is_shared([item]) else request.own)]


def _policies(robot: Robot, live: Live, request: Request, orphans: Collection[str]) -> list[Object]:
    """NetworkPolicies of this robot, and of its apps of the whole fleet, that nobody wants any more.

    Those of apps that are left as they are stay.
    """
    if not {*POLICED} & {*request.parts}:
        return []
    wanted = {key_of(item) for item in network_policies(robot)}
    fleets = {app.name for app in robot.apps if request.shared and app.scope == "fleet"}
    own = [
        item
        for item in live.policies
        if (owner := labels_of(item).get(names.LABEL_ROBOT)) == robot.name or (not owner and app_of(item) in fleets)
    ]
    return [identity(item) for item in own if key_of(item) not in wanted and app_of(item) not in orphans]


def _back(there: _Robot, asked: Sequence[str], request: Request) -> list[Step]:
    """Every app to its previous, or to the named revision.

    Apps without a history are `unchanged`, unless they were named, or a revision was: then it is an error that lists
    what there is.
    """
    target: dict[str, Sequence[Object]] = {}
    for app in asked:
        if app in NAMES and app not in request.only:
            continue  # its own history goes back only when it is named: apps outlive their master's version
        history = there.records.get(app, Record()).history
        running = hash_of(there.running(app))  # what runs is no way back
        others = [entry for entry in history if hash_of(entry["deployment"]) != running]
        found = [entry["deployment"] for entry in others if request.to in (PREVIOUS, entry["revision"])]
        if found:
            target[app] = found[:1]
        elif app in request.only or request.to != PREVIOUS:
            wanted = "previous revision" if request.to == PREVIOUS else f"revision {request.to}"
            there_are = ", ".join(f"{entry['revision']} ({entry.get('image', '?')})" for entry in history)
            raise SpecError(f"{there.robot.name}: app {app} has no {wanted} to go back to; kept: {there_are or 'none'}")
    return replace(there, desired={**there.desired, **target}).steps(target, back=True)


def _ordered(apps: Sequence[App], changed: Sequence[str]) -> list[list[str]]:
    """The changed apps as steps: the master first, apps of one group together, providers before their users.

    The master's keeper comes before the master, alone: each has the registrations for the other, so both at once would
    lose them. The new keeper is proven with all that the old master has, and gives that to the new master.

    Within what the dependencies leave open the inventory's order counts. Validation has refused cycles between apps.
    """
    unit = {app.name: app.update.group or f"app {app.name}" for app in apps}
    needs: dict[str, set[str]] = {name: set() for name in unit.values()}
    for app in apps:
        needs[unit[app.name]] |= {unit[other] for other in app.depends_on if other in unit} - {unit[app.name]}
    steps = [[app] for app in (KEEPER, MASTER) if app in changed]
    for name in in_order(needs):
        members = {app.name: set(app.depends_on) for app in apps if unit[app.name] == name and app.name in changed}
        steps += [in_order({app: needed & set(members) for app, needed in members.items()})] if members else []
    return steps


def _is_shared(objects: Sequence[Object]) -> bool:
    return any(item["metadata"]["namespace"] == names.FLEET_NAMESPACE for item in objects)


# --- what the inventory has no more -----------------------------------------------------------------------------------


def _with_removals(plan: Plan, robot: Robot, live: Live, request: Request) -> Plan:
    """The plan with a step for each app that goes, and what there is of it besides; SpecError.

    What runs goes last, so that a robot whose new version is refused has what it had. What is in the way of a new
    version, by its node's name, a device or a port, goes first.
    """
    wanted = {app.name for app in robot.apps}
    if not (request.remove and request.own and APPS in request.parts):
        return plan
    still = sorted(wanted & {*request.remove})
    if still:
        raise SpecError(
            f"update_remove_apps names {', '.join(still)}, which {robot.name} is to have: take it out of ros_apps first"
        )

    # a master of its own, of a robot that has another one by now
    left = NAMES if robot.master.mode != "robot" else ()
    stays = {"", *wanted, *(set(SERVING) - {*left})}
    shows = context.master_namespace(robot), KEEPER  # of an external master, by a name that a keeper may have had

    def goes(item: Object) -> bool:
        app = app_of(item) or files_owner(item)[1]
        ours = item["metadata"]["namespace"] == robot.namespace and app not in stays and key_of(item) != shows
        return ours and (ALL in request.remove or app in request.remove)

    going = [item for item in live.deployments if goes(item)]
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
        when=context.wanted_before(robot),
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
