# SPDX-License-Identifier: GPL-3.0-or-later
"""The door: whether a robot may be changed now, its graph and its apps, over HTTP and as JSON.

Who changes a robot has its Lease, which the API server gives to whoever may write it. So a question needs no guard, and
a job that changes something names the holder of the Lease, whom other pods do not know. docs/other-updaters.md is the
manual of the questions; the jobs are for updates alone.
"""

from __future__ import annotations

import json
import threading
import time
from dataclasses import dataclass
from typing import Callable

from .._common.documents import Data, Document, json_of
from .._common.errors import FleetError, RosError, SpecError
from .._common.poll import PASS, WAIT
from .._ros.backend import Questions, everything
from .._ros.conditions import conditions_from
from .._ros.graph_json import graph_data
from .._ros.idle_robot import IdleRobot, hold_when_idle
from .._ros.jobs import JOBS
from .._ros.keeper_client import FORGETFUL
from .._ros.raw_node import Asked, Said
from .._step.objects import Object, holder_of, name_of, node_of, revision_of, suffix_of, version_of
from .._step.record import answer, soaks
from .._step.rest import MARGIN, actions_to_rest, nodes_below, own_nodes
from .._step.windows import Windows
from .._step.words import FLEET, JOBS_PATH, LASTING, OWNER, PATH, REST, REST_KEY
from .cluster_api import read_records
from .holds import Holds

INTERVAL = 0.2
AT_ONCE = 4  # who asks more often than the robot can be looked at is sent away
JOBS_AT_ONCE, TURN = 8, 15.0  # and a job waits so many seconds for its turn,
SHORTEST = 0.05  # seconds from one look of a job to the next
LONGEST = 900.0  # and does not take longer than so many, whoever asks
CHANGING = ("register", "reap", "release")  # jobs; one that holds goals says so by the address of a keeper
MOMENTS, MOMENT = 3, 1.0  # looks, and seconds between them, at whether a master has all
GIVEN_BACK = 15.0  # seconds for which what is asked of a master that was begun anew is asked once more
UNTOLD = "nobody has told the keeper when it may be changed: run rosops.fleet.update once"


@dataclass(frozen=True)
class RestRules:
    """What a robot has to be before it, or one app of it, is changed.

    `when` are options of ros_ready, `idle` actions besides those that its nodes serve.
    """

    space: str
    windows: Windows
    when: tuple[Document, ...]
    idle: tuple[str, ...]


def rest_of(found: Object | None, app: str) -> RestRules:
    """What the ConfigMap says of one app, or without one of all of them together; SpecError where it says nothing."""
    try:
        said = json_of((found or {})["data"][REST_KEY])
        windows = Windows(*(said["windows"][key] for key in ("spans", "zone", "turns")))
        apps = [one for name, one in said["apps"].items() if app in ("", name)]
        when = [*said["when"], *(item for one in apps for item in one["when"])]
        rest = RestRules(said["space"], windows, tuple(when), tuple(name for one in apps for name in one["idle"]))
    except (AttributeError, KeyError, TypeError, ValueError):
        raise SpecError(UNTOLD) from None
    if app and not apps:
        raise SpecError(f"there is no app {app}; there are {', '.join(said['apps'])}")
    return rest


@dataclass(eq=False)
class Door:
    """The pages below /v1/."""

    holds: Holds
    left_over: Callable[[str, Object | None], bool]  # whether whoever has this Lease of a namespace has gone
    is_whole: Callable[[float], bool]  # the keeper's, by the clock of the `holds`
    sleep: Callable[[float], None] = time.sleep

    def __post_init__(self) -> None:
        self.cluster, self.ros = self.holds.cluster, self.holds.ros
        self.turns = threading.BoundedSemaphore(AT_ONCE)
        self.jobs = threading.BoundedSemaphore(JOBS_AT_ONCE)

    def page(self, asked: Asked) -> Said:
        job = asked.method == "POST" and asked.path.startswith(JOBS_PATH)
        if asked.method != "GET" and not job:
            return _json(405, {"error": "only GET is answered here"})
        turns, limit = (self.jobs, JOBS_AT_ONCE) if job else (self.turns, AT_ONCE)
        if not turns.acquire(timeout=TURN if job else 0.0):
            return _json(503, {"error": f"{limit} others ask just now"})
        try:
            return _json(200, self._done(asked) if job else self._found(asked))
        except FleetError as error:
            return _json(404 if isinstance(error, SpecError) else 503, {"error": str(error)})
        finally:
            turns.release()

    def _namespace(self, asked: Asked) -> str:
        namespace = asked.query.get("namespace") or self.cluster.home
        if namespace not in self.cluster.namespaces():
            raise SpecError(f"this keeper does not look after {namespace}")
        return namespace

    def _done(self, asked: Asked) -> Data:
        """The result of a job, as a module's: one that failed says so in `failed` and `msg`."""
        name, namespace = asked.path[len(JOBS_PATH) :], self._namespace(asked)
        if name not in JOBS:
            raise SpecError(f"there is no {asked.path}")
        try:
            arguments = {**json_of(asked.body), "master_uri": self.ros.uri}
            lasts = [float(arguments.get(key) or 0.0) for key in (*LASTING, "node_timeout")]
            pause = float(arguments.get("interval", INTERVAL))
        except (TypeError, ValueError) as error:
            raise SpecError(
                f"what {asked.path} is given is no object of JSON, with numbers for times: {error}"
            ) from None
        if not all(0.0 <= seconds <= LONGEST for seconds in (*lasts, pause)) or pause < SHORTEST:
            raise SpecError(f"a job may take {LONGEST:g} s at the most, with {SHORTEST:g} s from look to look")
        if "keeper_uri" in arguments:
            arguments["keeper_uri"] = self.holds.keeper.uri
        try:
            if name in CHANGING or "keeper_uri" in arguments:
                self._permit(namespace, asked.query.get("holder", ""))
            return self._told(name, arguments)
        except FleetError as error:
            return {**error.details, "failed": True, "msg": str(error)}

    def _told(self, name: str, arguments: Data) -> Data:
        """The result of a job. What passes has been seen at a master that has all which the one before had."""
        over = self.holds.now() + GIVEN_BACK
        while True:
            began = self.holds.now()
            found = JOBS[name](arguments)
            if name in CHANGING or found.get("verdict", PASS) != PASS:
                return found
            for _look in range(MOMENTS):  # one that is only busy for a moment is the same as before
                if self.is_whole(began):
                    return found
                self.sleep(MOMENT)
            if began >= over:
                raise RosError(f"the ROS master at {self.ros.uri}: {FORGETFUL}")

    def _permit(self, namespace: str, holder: str) -> None:
        now = holder_of(self.cluster.lease(namespace, newest=True))
        if not now or now != holder:
            raise FleetError(f"{now or 'nobody'} changes this robot now, and not {holder or 'who asks'}")

    def _found(self, asked: Asked) -> Data:
        query, name, namespace = asked.query, asked.path[len(PATH) :], self._namespace(asked)
        if name == "may-change":
            return self.may_change(namespace, query.get("app", ""), query.get("owner", ""))
        if name == "apps":
            return self.apps(namespace)
        if name == "graph":
            state = self.ros.state()
            return graph_data(self.ros.ask(state, everything(state)))
        raise SpecError(f"there is no {asked.path}")

    def apps(self, namespace: str) -> Data:
        """App -> what its version is: `state` is an answer of `_step/record.py`."""
        there = self.cluster.deployments(namespace)
        records = read_records(self.cluster, namespace, map(name_of, there))
        return {
            name_of(one): {"state": answer(one, records), "revision": revision_of(one), "soaks": soaks(one, records)}
            for one in there
        }

    def may_change(self, namespace: str, app: str, owner: str) -> Data:
        """Whether the robot of this namespace, or this app of it, may be changed now by this owner, and why not.

        Where the owner has its Lease by now, new goals are held first; `held` are their actions. `holder` has the
        Lease, whose version `lease` this was seen with. KubeError, RosError or SpecError.
        """
        found = self.holds.look(namespace)
        holder, version = holder_of(found), version_of(found)
        mine = bool(owner) and holder == OWNER + owner

        def no(why: str) -> Data:
            return {"go": False, "reason": why, "holder": holder, "lease": version, "held": []}

        if self.cluster.home == FLEET != namespace and self._at_work(FLEET, self.cluster.lease(FLEET, newest=True)):
            return no("what is the whole fleet's is changed just now")
        if not mine and self._at_work(namespace, found):
            return no(f"{holder} changes it since {(found or {})['spec'].get('acquireTime')}")
        rest = rest_of(self.cluster.config_map(namespace, REST), app)
        if self._closed(rest):
            return no(self._closed(rest))
        verdict, why = self._rests(namespace, app, rest, mine)
        if version_of(self.cluster.lease(namespace, newest=True)) != version:
            return no("its Lease changed hands just now")
        if verdict != PASS or self._closed(rest):  # to look takes its time
            return no(self._closed(rest) or why)
        return {**no(why), "go": True, "held": [*self.holds.of(namespace).servers] if mine else []}

    def _closed(self, rest: RestRules) -> str:
        """Until when its window is, in words; empty: it is open."""
        wall = self.holds.wall()
        opens = rest.windows.opens_at(wall)
        return f"it may be changed from {rest.windows.told(opens)} on" if opens > wall else ""

    def _at_work(self, namespace: str, lease: Object | None) -> bool:
        return bool(holder_of(lease)) and not self.left_over(namespace, lease)

    def _rests(self, namespace: str, app: str, rest: RestRules, mine: bool) -> tuple[str, str]:
        """Verdict and reason. What is held already is only looked at: its owner may be at work."""
        began, state = self.holds.now(), self.ros.state()
        graph = self.ros.ask(state, Questions(dict.fromkeys(state.nodes(), frozenset()))).by_revision()
        found = self.cluster.deployment(namespace, app) if app else None
        pods = self.cluster.pods(namespace) if found else []
        own = own_nodes({app: node_of(found)}, graph, pods, {app: suffix_of(found)}) if found else {app: []}
        nodes = own[app] if app else nodes_below(graph, rest.space)
        actions = actions_to_rest(graph, nodes, rest.idle)
        idle = [{**one, "state": "idle"} for one in actions]
        conditions = conditions_from({"actions": idle, "values": rest.when})
        heard = max((one.seconds + MARGIN for one in conditions.values), default=0.0)
        hold, now = self.holds.of(namespace), self.holds.now
        served = {one["name"]: one["server"] for one in actions if mine and "server" in one}
        new = {name: server for name, server in served.items() if name not in hold.servers}
        robot = IdleRobot(self.ros, self.holds.keeper, conditions, lambda: hold.until - now())
        try:
            ended = hold_when_idle(robot, new, heard, INTERVAL, 1, now, self.sleep)
        finally:
            robot.close()
        self.holds.add(namespace, {name: new[name] for name in ended.held})
        if ended.verdict == PASS and not self.is_whole(began):
            return WAIT, f"the ROS master: {FORGETFUL}"
        return ended.verdict, ended.reason


def _json(status: int, said: Data) -> Said:
    return Said(status, json.dumps(said).encode(), "application/json")
