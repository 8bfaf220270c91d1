# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role update: one robot. The engine in the process of the action, with the real world handed in.

The strategy imports this file once, in the process that forks the workers. So what is imported here is loaded once per
run, and not once per robot.
"""

from __future__ import annotations

import functools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..module_utils._common.documents import Arguments, Result, Variables
from ..module_utils._common.errors import NotReadyError
from ..module_utils._step.objects import name_of
from ..plugin_utils._action.cancelled import cancellable
from ..plugin_utils._action.cluster import foreseen
from ..plugin_utils._action.gated import GatedAction
from ..plugin_utils._action.host import RobotHost
from ..plugin_utils._images.archive import archived_ids, normal_ref
from ..plugin_utils._images.node import NodeImages
from ..plugin_utils._kube.access import NoClusterError
from ..plugin_utils._kube.applied import diff_of
from ..plugin_utils._kube.client import Kube
from ..plugin_utils._kube.running import Known
from ..plugin_utils._model.context import Robot
from ..plugin_utils._model.fleet import VARIABLE, robot_from_vars
from ..plugin_utils._model.formats import listed
from ..plugin_utils._model.outcomes import BUSY, FAILED, OUTCOMES, ROLLED_BACK, UNCHANGED, UPDATED
from ..plugin_utils._objects.namespace import of_fleet
from ..plugin_utils._objects.network import UNKNOWN, Hosts, host_networks
from ..plugin_utils._objects.parts import CODE, ground_objects, images, tagged_parts, workload_objects
from ..plugin_utils._report.kept import keep_early
from ..plugin_utils._update.change import NOTHING
from ..plugin_utils._update.engine import Engine
from ..plugin_utils._update.hands import Settings, look_seconds
from ..plugin_utils._update.ledger import FLEET, Ledger
from ..plugin_utils._update.outcome import WAITING, RobotOutcome, StepResult
from ..plugin_utils._update.plan import Request

# What an update takes of roles' variables; of its own all.
TAKEN: dict[str, tuple[str, ...]] = {
    "update": (),
    "images": ("images_archives", "images_refs", "images_rate_limit"),
    "ros_app": ("ros_app_rollout_timeout",),
    "storage": ("storage_remove_claims", "storage_remove_confirm"),
}


class ActionModule(GatedAction):
    KIND = "robot"
    # Not TRANSFERS_FILES: for that Ansible contacts the host before any of this runs. One that is off would leave the
    # run there, and be the end of it where it is all of a wave.

    def work(self, params: Arguments, known: Variables) -> Result:
        """`params` get the roles' variables, without the roles' names."""
        self._vars, self._host = known, str(known["inventory_hostname"])
        params = {**params, **self._given(known)}
        run_tags, skip_tags = known.get("ansible_run_tags") or (), known.get("ansible_skip_tags") or ()
        self._parts = tagged_parts(params["parts"], run_tags, skip_tags)
        # robots that need no wave are one of their own
        ledger = self.ledger(known, FLEET if not params["own"] else None if params["at_work"] else "")
        if params["own"]:
            return self._turn(params, ledger)
        with ledger.alone():  # one robot's turn settles what is the whole fleet's, but for what others alone have
            begun = ledger.last(self._host).get("outcome") == WAITING
            if begun or not ledger.fleet_done(of_fleet(robot_from_vars(known))):
                return self._turn(params, ledger)
        return {"changed": False}

    def _given(self, known: Variables) -> Result:
        found: Result = {}
        for role, names in TAKEN.items():
            given = self.variables(known, role, *names)
            found |= {name.removeprefix(f"{role}_"): said for name, said in given.items()}
        for name in ("apps", "remove_apps"):  # also as a survey's answer
            found[name] = listed(self._templar.template(known.get(f"update_{name}")))
        to = found["to"] or ("previous" if found["back"] else "")
        if isinstance(known.get("update_to"), int) and to.isdigit() and len(to) < 8:
            to = f"{int(to):08o}"  # eight digits of a survey that begin with 0 are an octal number to YAML
        return {**found, "to": to}

    def _turn(self, params: Arguments, ledger: Ledger) -> Result:
        known, before = self._vars, ledger.last(self._host)
        result: Result = {}
        self._before = before if before.get("wave") == FLEET or before.get("outcome") == WAITING else {}
        if self._before.get("outcome") in (FAILED, ROLLED_BACK, BUSY):
            # its turn for the whole fleet did not go well: that is its outcome
            return {"outcome": {key: self._before[key] for key in ("outcome", "reason", "steps")}}
        self._earlier = tuple(map(StepResult.from_dict, self._before.get("steps") or ()))
        outcome = self.outcome(ledger, params["failure_budget"], known, lambda: self._update(params, result))
        if outcome is None:
            return {**result, "at_work": True}
        if self._earlier and not outcome.steps:  # the robot came to no step this time
            outcome = replace(outcome, reason=outcome.reason.removeprefix(f"{NOTHING}: "), steps=self._earlier)
        waits = outcome.outcome == WAITING
        steps = [step.as_dict() for step in outcome.steps if step.outcome != WAITING]
        # of a robot that the run comes back to
        wait = {"since": self._since, "begun": self._begun} if waits else {}
        more = {"reason": outcome.reason, "steps": steps, "parts": of_fleet(robot_from_vars(known)), **wait}
        ledger.note(self._host, outcome.outcome, **(more if waits or not params["own"] else {}))
        if waits:
            return {**result, "msg": outcome.reason, "waiting": True}
        good = set(OUTCOMES) - {FAILED} if self._task.check_mode else {UPDATED, UNCHANGED}
        if params["strict"] and outcome.outcome not in good:
            result.update(failed=True, msg=f"{outcome.outcome}: {outcome.reason}")
        # which the report and the last play read: a robot's outcome is no error of the task
        return {**result, "outcome": outcome.as_dict()}

    def _pull_secrets(self) -> list[dict[str, Any]]:
        return list(self._templar.template(self._vars.get("robot_namespace_pull_secrets")) or ())

    def _update(self, params: Arguments, result: Result) -> RobotOutcome | None:
        """The robot's outcome; nothing where it is left for its wave."""
        try:
            with self.cluster(params, self._vars) as kube, cancellable():
                return self._updated(params, result, kube)
        except NoClusterError:
            if not self._task.check_mode:
                raise
        # the run may be what would make it: then all of it would be new
        robot = robot_from_vars(self._vars)
        made = ground_objects(robot, self._parts, self._pull_secrets(), CODE)
        result.update(foreseen([*made, *workload_objects(robot, self._parts)]))
        return RobotOutcome(UPDATED if result["changed"] else UNCHANGED, result["msg"])

    def _updated(self, params: Arguments, result: Result, kube: Kube) -> RobotOutcome | None:
        check, edge, since = bool(self._task.check_mode), self._edge_images(), self._before.get("since") or {}
        robot = robot_from_vars(self._vars)
        settings = Settings(
            Request(
                only=tuple(params["apps"]), to=params["to"], shared=params["shared"], own=params["own"],
                parts=self._parts, remove=tuple(params["remove_apps"]),
            ),
            check=check,
            code=CODE,
            hosts=self._hosts(robot, kube),
            pull_secrets=self._pull_secrets(),
            look_timeout=look_seconds(params["busy_timeout"], bool(since)) if params["own"] else None,
            since=since,
            begun=self._before.get("begun") or {},
            earlier=self._earlier,
            edge_images=edge,
            known=self._known(params["archives"], edge),
            **{name: params[name] for name in (
                "on_busy", "busy_timeout", "ready_timeout", "verify_seconds", "soak", "rate_tolerance", "rate_seconds",
                "at_work", "rollout_timeout", "remove_claims", "remove_confirm",
            )},
        )  # fmt: skip

        def bring(there: RobotHost, wanted: Sequence[str]) -> None:
            """With those that are always wanted; what apps run by the inventory stays pinned."""
            node = NodeImages(there, params["rate_limit"], self.say(self._vars), self._pull_secrets())
            refs = dict.fromkeys([*params["refs"], *wanted])
            brought = node.bring(params["archives"], refs, check, images(robot, "local"))
            if brought.get("failed"):
                raise NotReadyError(brought["msg"])

        engine = Engine(robot, settings, self.run_of(kube, self._vars), self.world(self._vars, bring))
        outcome, self._since, self._begun = engine.run(), engine.waiting, engine.begun
        if not (check or engine.left or outcome.outcome in (UNCHANGED, WAITING)):
            keep_early(kube, self._host, outcome.outcome, outcome.reason, bool(engine.changes))
        result.update(engine.graph_told, changed=any(change.changed for change in engine.changes))
        if self._task.diff:
            result["diff"] = diff_of(engine.changes)
        return None if engine.left else outcome

    def _hosts(self, robot: Robot, kube: Kube) -> Hosts:
        """A standalone robot is its cluster's only one, from which everything reaches its pods."""
        if robot.mode == "standalone":
            return UNKNOWN
        fleet, hosts = self._vars[VARIABLE], self._vars[VARIABLE]["hosts"]
        own, edge = [hosts[self._host]["node"]], fleet["edge_nodes"]
        servers = [hosts[server]["node"] for server in hosts[self._host]["servers"]]
        found = self._fetch(self._vars).networks(
            hosts[self._host]["cluster"],
            {*own, *servers},
            lambda: {name_of(node): host_networks(node) for node in kube.objects("Node")},
        )
        groups = own, servers, edge, sorted(found)
        return Hosts(*([one for node in group for one in found.get(node, ())] for group in groups))

    def _known(self, archives: Sequence[Mapping[str, Any]], edge: Mapping[str, Mapping[str, str]]) -> Known:
        """What images' names mean: on a node by what this run saw there, else on the robot's own by its archives."""
        hosts = self._vars[VARIABLE]["hosts"]
        own, paths = str(hosts[self._host]["node"]), [str(one["path"]) for one in archives]
        there = {hosts[name]["node"]: images for name, images in edge.items() if name in hosts}
        there[own] = (self._vars.get("images_brought") or {}).get("present") or {}

        @functools.cache
        def known(node: str, ref: str) -> Collection[str]:
            seen = there.get(node, {}).get(normal_ref(ref))
            return {seen} if seen else archived_ids(paths, ref) if node == own else ()

        return known

    def _edge_images(self) -> dict[str, Mapping[str, str]]:
        """What the play before this one saw on the edge hosts; those that it did not see may be away.

        Any of them knows it of all: looking at each of them would cost every robot as much as there are edge hosts.
        """
        if not images(robot_from_vars(self._vars), "remote"):
            return {}
        hostvars, edge = self._vars["hostvars"], self._vars["groups"].get("edge", [])
        told: Mapping[str, Any] = next(filter(None, (hostvars[name].get("edge_images") for name in edge)), {})
        return {name: one["present"] for name, one in told.items() if one.get("present")}
