# SPDX-License-Identifier: GPL-3.0-or-later
"""What happens to one robot, from "what differs" to its outcome. The world is handed in.

    plan      what differs from the inventory; nothing does: `unchanged`
    prepare   images on the node, namespace, claims, code for the pods, while the robot works

then, where no app is at work, all that is new at once: applied, awaited, and the graph is what the apps promised; else
step by step, each a change from its gate to its outcome (`change.py`). And in the end, where that is asked for, the
graph of the whole robot is what its apps promise.

What has to be remembered is in the cluster before it is needed: the record of the step in a ConfigMap beside each
Deployment (`_step/record.py`). So a run may end at any line, and the next one goes on from there.
"""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

from ...module_utils._common.errors import FleetError, NotReadyError, SpecError
from ...module_utils._step.objects import app_of
from ...module_utils._step.record import soaks
from ...module_utils._step.update_record import NEWS, REASON_KEPT, back_in_words, ways_back
from .._kube.running import TODO, outdated
from .._model import names
from .._model.context import Robot, namespace_of
from .._model.outcomes import FAILED, ROLLED_BACK, UNCHANGED, UPDATED
from .._objects.namespace import removed_claims, storage_objects
from .._objects.network import KIND as POLICY
from .._objects.parts import APPS, MASTER, READY, STORAGE, ground_objects
from .addresses import NAMES, located, other_master
from .app_change import AppChange, InstallChange, RemovalChange
from .change import NOTHING, StepChange, word_of
from .cluster import KubeCluster
from .hands import Hands, Settings, World
from .outcome import EVENTS_NAME, WAITING, RobotOutcome, known_events, robot_outcome
from .plan import INSTALL, REMOVE, Desired, Plan, Step, all_of, placed, promised, rendered, update_plan
from .revisions import Key, claim_users, deployments_of, files_owner, key_of, lost_services, suspects, unused
from .step import images_of
from .world import AwayError, CancelledError, HeldError, Object

MOVED = (
    "the inventory has another one for them. A node cannot change its master while it works: take the apps out first "
    "(ros_apps without them, update_remove_apps with their names), then change the mode, then put them back"
)

# where the role node was not there with this version
UNLABELLED = "nodes have no labels but those of 1.0: new versions are placed by these until rosops.fleet.site has run"

KINDS: dict[str, type[StepChange]] = {INSTALL: InstallChange, REMOVE: RemovalChange}
SOAK_PAUSE = 5.0  # seconds between two looks at what soaks
LATE = 60.0  # seconds: a keeper looks at one robot after the other, and each look may take its time


class Engine(Hands):
    def __init__(self, robot: Robot, settings: Settings, cluster: KubeCluster, world: World) -> None:
        super().__init__(robot, settings, cluster, world)
        self.plan = Plan()
        self.desired: Desired = {}  # what the robot is to run
        self.ground: Sequence[Object] = ()  # what the pods stand on, of the parts that are asked for
        self.waiting: dict[str, float] = {}  # step -> since when it has waited for the robot, by the clock's `now`
        self.begun: dict[str, float] = {}  # step that waits -> when it began
        self.left = False  # it is at work and has to be changed, which this run may not
        self.unlabelled = False  # nodes of its pods have the labels of 1.0 alone
        self.trouble: FleetError | None = None  # after the steps

    def run(self) -> RobotOutcome:
        """From what differs to the outcome. Whatever goes wrong with this robot is its outcome, and no error."""
        try:
            gone = removed_claims(self.robot, self.settings.remove_claims, self.settings.remove_confirm)
            if not (self.settings.request.own and STORAGE in self.settings.request.parts):
                gone = []
            self.host.there()
            self.unlabelled = self.cluster.unlabelled(self.robot)
            if self.unlabelled:
                self.say(UNLABELLED)
            self._plan()
            if not self.left:
                self._work(gone)
            if self.left:
                return RobotOutcome(UNCHANGED, "at work: it is changed in its wave")
        except FleetError as error:
            if not self.results:
                before = tuple(self.settings.earlier)
                untouched = "no app was touched" if self.changes and not self.check else NOTHING
                return RobotOutcome(word_of(error), str(error) if before else f"{untouched}: {error}", before)
        earlier = self.settings.earlier
        outcome = robot_outcome([*earlier, *self.results], len(earlier) + len(self.plan.steps))
        found = self._conclude(outcome)
        return replace(found, reason="; ".join(filter(None, [found.reason, *self.news()])))

    def _conclude(self, outcome: RobotOutcome) -> RobotOutcome:
        """What comes after all steps, if they went well: the whole graph is looked at."""
        if outcome.outcome not in (UPDATED, UNCHANGED):
            return outcome
        try:
            if self.trouble:
                raise self.trouble
            installed = any(step.kind == INSTALL for step in self.plan.steps)  # that was looked at just now
            if READY in self.settings.request.parts and not (self.check or installed):
                # all of it is rolled out, and its graph is what its apps promise, whether or not they were changed
                workloads = deployments_of(all_of(self.desired))
                self.cluster.wait([*storage_objects(self.robot), *workloads], self.settings.rollout_timeout)
                self.as_promised(promised(self.robot, [app.name for app in self.robot.apps]))
        except FleetError as error:
            reason = "; ".join(filter(None, [outcome.reason, str(error)]))
            return replace(outcome, outcome=word_of(error, begun=True), reason=reason)
        if outcome.outcome == UNCHANGED and self.changes:
            return replace(outcome, outcome=UPDATED, reason=", ".join(str(change.ref) for change in self.changes))
        return outcome

    # --- whose the robot is -----------------------------------------------------------------------------------------

    def _work(self, gone: Sequence[Object]) -> None:
        """What is to be done, under the robot's Lease; who changes nothing needs none."""
        if self.check:
            self._change(gone)
            return
        needed = bool(self.plan.steps or self.plan.remnants or self._lost()) or self._differs(gone)
        if not (needed or self.untold()):
            self._tell_first()
            return
        try:
            with self._claimed():
                if not self.left:
                    self._change(gone)
        except HeldError:
            if needed or self.plan.steps:
                raise
            self._tell_first()  # its record alone was to be brought to its end: whoever has the robot does that

    @contextlib.contextmanager
    def _claimed(self) -> Iterator[None]:
        """Be the only run that changes the robot. What was planned before may be another run's work by now."""
        # those that are not there: a Lease lives in one
        wanted = [item for item in self.ground if item["kind"] == "Namespace"]
        found = self.cluster.apply(wanted, dry_run=True)
        self.apply_all([item for item, there in zip(wanted, found, strict=True) if there.before is None])
        with contextlib.ExitStack() as claims:
            claims.enter_context(self.cluster.claim(self.robot.namespace))
            self._plan()
            # a step changes what is the whole fleet's; to make what is not there is anybody's
            changed = [item for step in self.plan.steps if step.kind != INSTALL for item in step.objects]
            changed += [item for item in self.plan.remnants if item["kind"] != POLICY]  # each robot has its own there
            if any(item["metadata"].get("namespace") == names.FLEET_NAMESPACE for item in changed):
                claims.enter_context(self.cluster.claim(names.FLEET_NAMESPACE))
                self._plan()
            if self._make_services():
                self._plan()
            yield

    def _make_services(self) -> bool:
        """Those of a new master: its pods and the apps' are told their addresses. Whether there were any."""
        objects = [item for step in (() if self.left else self.plan.steps) for item in step.objects]
        services = [item for item in objects if item["kind"] == "Service"]
        new = [item for item in services if item["metadata"]["name"] not in self.robot.master.addresses]
        self.apply_all(new)
        return bool(new)

    def _differs(self, gone: Sequence[Object]) -> bool:
        """Whether anything is to be changed that no pod notices. The API server says so."""
        found = [*self.cluster.apply(self.ground, dry_run=True), *self.cluster.delete(gone, dry_run=True)]
        return any(change.changed for change in found)

    # --- what is to be done -----------------------------------------------------------------------------------------

    def _change(self, gone: Sequence[Object]) -> None:
        """Take the steps. What goes wrong before the first of them is an error, afterwards it is the step's result."""
        self._tell_first()
        gated = [step for step in self.plan.steps if step.kind != INSTALL and not step.proven]
        self._prepare(gated)
        if gated:
            self._record()
        for number, step in enumerate(self.plan.steps):
            change = KINDS.get(step.kind, AppChange)(self.plan.steps[number:], self)
            result = change.take()
            self.results.append(result)
            self.stale = not self.check
            if result.outcome == WAITING and change.since is not None:
                self.waiting[step.name], self.begun[step.name] = change.since, result.started
            if result.outcome != UPDATED or change.over:
                break
            try:
                self.apply_all(self._leads(self._apps([step])))
            except FleetError as error:
                self.trouble = error
                break
        else:
            self._remove(gone)
            self._tidy(gated)
        self.tell()

    def _tell_first(self) -> None:
        if self.plan.orphans:
            orphans = ", ".join(self.plan.orphans)
            self.say(f"not in the inventory, left as they are (update_remove_apps takes them away): {orphans}")
        for told in self.news():
            self.say(told)

    def _plan(self) -> None:
        self.live = self.read()
        other = other_master(self.robot, self.live, lambda: self.cluster.read([names.FLEET_NAMESPACE]))
        if other:
            raise SpecError(f"{self.robot.name}'s apps run with {other}, and {MOVED}")
        settings, request = self.settings, self.settings.request
        self.robot = placed(located(self.robot, self.live), self.live, self.unlabelled)
        self.desired = rendered(self.robot)
        secrets, code, hosts = settings.pull_secrets, settings.code, settings.hosts
        self.ground = ground_objects(self.robot, request.parts, secrets, code, hosts)
        self.plan = update_plan(self.robot, self.desired, self.live, request, self._drifted())
        self.left = not settings.at_work and any(step.kind != INSTALL for step in self.plan.steps)

    def _drifted(self) -> set[tuple[str, str]]:
        """Deployments that are not what they say. The API server knows whether a difference is one."""
        suspected = suspects(deployments_of(all_of(self.desired)), self.live)
        found = [one.ref for one in self.cluster.apply(suspected, dry_run=True) if one.changed]
        for ref in found:
            self.say(f"{ref.name} was changed by hand")
        return {(ref.namespace, ref.name) for ref in found}

    def _lost(self) -> list[Object]:
        """Services that no step brings back."""
        parts = self.settings.request.parts
        asked = {app: made for app, made in self.desired.items() if (MASTER if app in NAMES else APPS) in parts}
        return lost_services(all_of(asked), self.live)

    def _prepare(self, gated: Sequence[Step]) -> None:
        """What all of it stands on, and what the steps need, while the robot works."""
        self.trace("prepare")
        images = {image for step in gated for image in images_of(step, "local")}
        # of what is installed the archives alone: the node pulls the rest, all at the same time
        if images or any(step.kind == INSTALL for step in self.plan.steps):
            self.host.bring(sorted(images))
        others = set() if self.settings.request.shared else self._own(names.FLEET_NAMESPACE)
        services, later = self._lost(), self._leads(self._apps(gated) | others)
        for item in services:
            self.say(f"Service {item['metadata']['name']} is gone or was changed by hand")
        self.apply_all([*(item for item in self.ground if item not in later), *services])
        # without ROS the graph is asked of the keeper, which may be new
        asked, keeper = self.robot.master.mode == "none" and self.plan.steps, deployments_of(self.ground)
        if services or asked:  # with addresses of their own
            self.live = replace(self.live, services=self.read().services)
        if asked and not (self.check and keeper):
            self.need_master()
            self.cluster.wait(keeper, self.settings.rollout_timeout)
            self.master_answers("the keeper answers")

    def _apps(self, steps: Sequence[Step]) -> set[Key]:
        """Those of these steps. The master and its keeper have Services of their own."""
        return {key_of(item) for step in steps for item in step.workloads} & self._own()

    def _own(self, space: str = "") -> set[Key]:
        """The robot's apps, or those of them in a namespace."""
        found = {(namespace_of(app, self.robot), app.name) for app in self.robot.apps}
        return {key for key in found if space in ("", key[0])}

    def _leads(self, apps: Collection[Key]) -> list[Object]:
        """Of the ground what leads to the ports of these apps, and is there: what runs may have others."""
        there = [(item["kind"], *key_of(item)) for item in [*self.live.services, *self.live.policies]]
        of_apps = [item for item in self.ground if (item["metadata"].get("namespace"), app_of(item)) in apps]
        return [item for item in of_apps if (item["kind"], *key_of(item)) in there]

    def _record(self) -> None:
        """Before the first step. The update of a master that does not answer is how to mend it."""
        self.trace("record")
        try:
            self.learn(self.host.graph(self.master))
        except (AwayError, CancelledError):
            raise
        except FleetError:
            mending = [step for step in self.plan.steps if step.kind == "master"]
            if self.settings.on_busy != "force" and not mending:
                raise
            # a new keeper has nobody to ask: it waits for a master that answers
            self.plan = replace(self.plan, steps=[*mending, *(step for step in self.plan.steps if step not in mending)])

    def _tidy(self, gated: Sequence[Step]) -> None:
        """What apps had before: their files, when nobody goes back to them any more, and their Services.

        Of those that went all of it. What is left because of an error the next update finds.
        """
        apps = self._apps(gated)
        before = {*map(files_owner, self.live.maps), *map(key_of, self.live.services)}
        gone = [*self.plan.remnants]
        try:
            if apps & before:  # most have none
                gone += unused(self.read(), apps, self.ground)
            self.delete(gone)
        except FleetError as error:
            self.say(f"what earlier versions had is still there: {error}")

    def _remove(self, claims: Sequence[Object]) -> None:
        """The claims, with their data; none of them while something runs that mounts it."""
        if not claims:
            return
        leaving = [app for step in self.plan.steps for app in step.apps] if self.check else []
        try:
            users = claim_users(self.read(), claims, leaving)
            if users:
                raise NotReadyError(f"no claim is deleted while an app runs that mounts it: {', '.join(users)}")
            self.delete(claims)
        except FleetError as error:
            self.trouble = error

    # --- the record of the robot's updates --------------------------------------------------------------------------

    def untold(self) -> list[Object]:
        """The record, where it is not at its end: also that a run before this one ended without a word."""
        there = [item.get("data") for item in self.live.maps if item["metadata"]["name"] == EVENTS_NAME]
        record = self.events()
        return [] if self.check or not (self.results or there) or record["data"] in there else [record]

    def tell(self) -> None:
        last = self.results[-1] if self.results else None
        waits = last and last.outcome == WAITING and not {"start", "apply"} & last.phases.keys()
        if last and (waits or (last.outcome == UPDATED and not last.reason)):
            return  # told before it waited, or when its mark was taken off
        try:
            self.apply_all(self.untold())
        except FleetError as error:
            self.say(f"the robot's metrics will not show this: {error}")

    def news(self) -> list[str]:
        """What the keeper did that no run has told yet, and apps that run another image than its name means by now."""
        taken = {app for step in self.plan.steps for app in step.apps}  # their pods are new ones by then
        others = [one for one in outdated(self.live.pods, self.settings.known) if one.app not in taken]
        events = known_events(self.live.maps, self.robot.name)
        known = {str(event.get("reason")) for event in events if NEWS not in event}
        back = ways_back(self.live.deployments, self.live.records)
        told = {app: back_in_words(one) for app, one in back.items()}
        new = [f"{app}: {text}" for app, text in told.items() if text[:REASON_KEPT] not in known]
        return [*new, *dict.fromkeys(f"{one.app} {one.what}; {TODO}" for one in others)]


# --- the wait between two waves -------------------------------------------------------------------------------------


def soak(cluster: KubeCluster, robot: Robot, new: Mapping[str, str], world: World) -> RobotOutcome:
    """What became of a robot whose apps were updated, once its keeper has proven what is new, or taken it back.

    `new` is app -> revision. KubeError.
    """
    hands, clock = Hands(robot, Settings(), cluster, world), world.clock
    began = clock.now()
    while True:
        live = hands.read()
        back = ways_back(live.deployments, live.records)
        bad = [f"{app}: {back_in_words(told)}" for app, told in back.items() if told["from"] == new.get(app)]
        if bad:
            return RobotOutcome(ROLLED_BACK, "; ".join(bad))
        soaking = [app_of(item) for item in live.deployments if soaks(item, live.records) and app_of(item) in new]
        if not soaking:
            return RobotOutcome(UPDATED)
        spent, seconds = clock.now() - began, max(live.records[app].soak for app in soaking)
        if spent >= 2 * seconds + LATE:
            return RobotOutcome(
                FAILED,
                f"the robot's keeper has said for {spent:.0f} s neither that {', '.join(soaking)} stays good nor that "
                "it does not; see its log (kubectl logs deploy/ros-keeper)",
            )
        world.trace(f"waits whether {', '.join(soaking)} stays good for {seconds:.0f} s")
        clock.sleep(SOAK_PAUSE)
