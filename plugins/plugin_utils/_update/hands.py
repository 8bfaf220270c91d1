# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot in the hands of a run: what is known of it, objects applied, waits that say what is open, and its rest."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

from ...module_utils._common.errors import FleetError, NotReadyError, RosError
from ...module_utils._common.poll import FAIL, PASS, WAIT
from ...module_utils._ros.graph import Graph
from ...module_utils._step.rest import MARGIN
from ...module_utils._step.update_record import ways_back
from .._kube.applied import Applied
from .._kube.running import Known
from .._model import names
from .._model.context import Robot, master_namespace, master_uri, namespace_of
from .._objects.common import Files
from .._objects.namespace import needs_fleet_namespace
from .._objects.network import UNKNOWN, Hosts
from .._objects.pod_settings import promised
from .cluster import KubeCluster
from .host import RobotSide
from .outcome import EVENTS_NAME, StepResult, events_map
from .plan import Request
from .step import NO_GRAPH, with_rates
from .world import Calm, Live, MonotonicClock, Object, Seen

Wait = Callable[[float], Seen]  # for so many seconds at most

MASTER_SECONDS = 30.0
SLICE = 8.0  # seconds of one wait on the robot, at least; what is open is said after each
GRAPH_SECONDS = 1.0  # for which the graph has to be as it should be
STAY_EXTRA = 5.0  # until the API shows what the robot shows
LOOKS = 50  # at a robot that works, about, at most
PROMISED = "the graph is what the apps promised"
NO_MASTER = "run the stage master of rosops.fleet.site first"
UNASKED = "-e update_on_busy=force changes the robot without asking it"
HOLD_SECONDS = 60.0  # the keeper lets held goals go then by itself, if the change never comes to its end


@dataclass(frozen=True)
class Settings:
    """How a run goes. Times are in seconds."""

    request: Request = field(default_factory=Request)
    on_busy: str = "wait"  # wait, defer or force
    busy_timeout: float = 600.0
    look_timeout: float | None = None  # of waiting in this run of the engine; then it is `waiting`. None: as above
    since: Mapping[str, float] = field(default_factory=dict)  # step -> when it began to wait, by the clock's `now`
    begun: Mapping[str, float] = field(default_factory=dict)  # step -> when it began, where that was in an earlier look
    earlier: Sequence[StepResult] = ()  # steps that have ended before, in this run of the playbook
    ready_timeout: float = 120.0
    verify_seconds: float = 1.0
    soak: float = 120.0  # for which a version that was found good soaks, before it is proven
    rate_tolerance: float = 0.1
    rate_seconds: float = 1.0
    check: bool = False
    code: Files = field(default_factory=dict)  # what runs in the pods
    hosts: Hosts = UNKNOWN  # from where they reach the robot's pods
    pull_secrets: Sequence[Mapping[str, object]] = ()  # items of robot_namespace_pull_secrets
    remove_claims: Sequence[str] = ()  # names of volumes whose claims go, with their data
    remove_confirm: bool = False
    rollout_timeout: float = 300.0  # of what is installed, whose images may have to be pulled
    at_work: bool = True  # whether a robot at work may be changed; else it is only looked at
    known: Known = lambda _node, _ref: ()
    edge_images: Mapping[str, Collection[str]] = field(default_factory=dict)  # edge host -> names of images there


@dataclass(frozen=True)
class World:
    """What a run has around it beside the cluster.

    `say` is for whoever runs the playbook, `trace` for whoever wants to know where exactly a run stands.
    """

    host: RobotSide
    clock: MonotonicClock
    say: Callable[[str], None] = lambda _text: None
    trace: Callable[[str], None] = lambda _text: None


class Hands:
    """One robot and its world. `live` is what the API showed of it last, `graph` what the robot itself did."""

    def __init__(self, robot: Robot, settings: Settings, cluster: KubeCluster, world: World) -> None:
        self.robot, self.settings, self.cluster, self.world = robot, settings, cluster, world
        self.clock, self.check, self.say, self.trace = world.clock, settings.check, world.say, world.trace
        self.host = world.host.by(cluster.door(robot), self.trace)
        self.live, self.graph = Live(), NO_GRAPH
        self.registered = NO_GRAPH  # the same with the names that nodes have in their pods
        self.recorded = False  # the graph is known
        self.stale = False  # a step has changed it since
        self.rated: set[str] = set()  # nodes of which the rates at rest are known
        self.changes: list[Applied] = []
        self.results: list[StepResult] = []  # of this run's steps that have ended
        self.graph_told: dict[str, object] = {}  # of what the whole robot promises: verdict, and elapsed seconds

    @property
    def master(self) -> str:
        """The address of the robot's ROS master, as its hosts reach it."""
        if self.robot.master.mode == "external":
            return master_uri(self.robot)
        if self.robot.master.mode == "none":
            return self._keeper
        return self.live.service_uri(names.MASTER_NAME, master_namespace(self.robot))

    def need_master(self) -> None:
        """NotReadyError where nobody can be asked for the robot's graph."""
        if not self.master:
            raise NotReadyError(f"{self.robot.name} has no ROS master; {NO_MASTER}")

    @property
    def keeper(self) -> str:
        """The address of the keeper, where it holds goals: it does so at no external master."""
        return self._keeper if self.robot.master.ours else ""

    def watched(self, workloads: Sequence[Object]) -> bool:
        """Whether a keeper is there that takes these back if they do not stay good."""
        places = {item["metadata"]["namespace"] for item in workloads}
        return bool(self._keeper) and (self.robot.master.mode == "shared" or places == {self.robot.namespace})

    @property
    def _keeper(self) -> str:
        return self.live.service_uri(names.KEEPER_NAME, master_namespace(self.robot))

    # --- its cluster ------------------------------------------------------------------------------------------------

    def read(self) -> Live:
        """What the API shows of the robot now, with what of the fleet is its own, too."""
        robot = self.robot
        shared = [names.FLEET_NAMESPACE] if needs_fleet_namespace(robot) else []
        homes = {app.name: namespace_of(app, robot) for app in robot.apps}
        return replace(self.cluster.read([robot.namespace, *shared]), homes=homes)

    def apply_all(self, objects: Sequence[Object]) -> None:
        """All of them in one call; in check mode it is only found out what that would change."""
        done = self.cluster.apply(objects, self.check)
        # the record of updates changes with every step: its news is the outcome itself
        self.changes += [change for change in done if change.changed and change.ref.name != EVENTS_NAME]

    def delete(self, objects: Sequence[Object]) -> None:
        self.changes += [done for done in self.cluster.delete(objects, self.check) if done.changed]

    def events(self, *last: StepResult) -> Object:
        """The record of the robot's updates with this run's steps: those that are over, and the `last` one."""
        back = ways_back(self.live.deployments, self.live.records)
        return events_map([*self.results, *last], self.robot.name, self.live.maps, back)

    # --- its graph --------------------------------------------------------------------------------------------------

    def until(self, wait: Wait, timeout: float, what: str, least: float = SLICE, since: float | None = None) -> Seen:
        """Wait in slices, and say between two of them what is still open, and since when."""
        began = self.clock.now()
        self.trace(what)
        while True:
            spent = self.clock.now() - began
            self.cluster.confirm()
            seen = wait(max(min(timeout - spent, max(least, SLICE)), 0.0))
            spent = self.clock.now() - began
            if seen.verdict != WAIT or spent >= timeout:
                return seen
            open_for = self.clock.now() - (began if since is None else since)
            self.say(f"{what}, for {open_for:.0f} s now: {seen.reason}")

    def ready(self, conditions: Object, timeout: float, what: str, stable: float = 0.0) -> None:
        """Wait until the robot's graph is like that; NotReadyError says what of it is not."""
        seen = self.until(
            lambda seconds: self.host.ready(self.master, conditions, max(seconds, stable), stable),
            timeout,
            f"waits until {what}",
            least=stable + SLICE,  # a peer that hangs is known to after some seconds, and the stable ones begin then
        )
        if seen.verdict != PASS:
            raise NotReadyError(seen.reason)

    def stays(self, conditions: Object, timeout: float, what: str, workloads: Sequence[Object]) -> None:
        """The robot's graph is like that, and for `verify_seconds` no container of these ends; NotReadyError.

        The graph is looked at first and last. Between them the API alone is watched: that costs the robot nothing.
        """
        seconds, at_first = self.settings.verify_seconds, min(self.settings.verify_seconds, GRAPH_SECONDS)
        self.ready(conditions, timeout + at_first, what, stable=at_first)
        self.cluster.wait(workloads, STAY_EXTRA, stay=seconds - at_first)
        if seconds > at_first:
            self.ready(conditions, timeout, what)

    def as_promised(self, conditions: Object, workloads: Sequence[Object] = ()) -> None:
        """Wait until the graph is what apps promised, and where these were just installed, stays so; NotReadyError.

        How that ends is kept for the report.
        """
        self.need_master()
        began, timeout, self.graph_told = self.clock.now(), float(conditions["timeout"]), {"verdict": FAIL}
        try:
            if workloads:
                self.stays(conditions, timeout, PROMISED, workloads)
            else:
                self.ready(conditions, timeout, PROMISED)
            self.graph_told["verdict"] = PASS
        finally:
            self.graph_told["elapsed"] = round(self.clock.now() - began, 3)

    def master_answers(self, what: str) -> None:
        """Wait until it does; NotReadyError. A new one's pod is ready a moment before its Service leads there."""
        self.ready({}, MASTER_SECONDS, what)

    def ask(self, what: str, unknown: str) -> Graph:
        """The graph. A master that is silent is waited for a moment; NotReadyError, `unknown` in it, if it stays so."""
        try:
            return self.host.graph(self.master)
        except RosError as error:
            self.say(f"{what}: {error}")
        try:
            self.master_answers("the master answers")
            return self.host.graph(self.master)
        except (RosError, NotReadyError) as error:
            raise NotReadyError(f"{unknown}: {error}") from error

    def learn(self, graph: Graph) -> None:
        """The graph as it is now, with the rates that are known, by the names of revisions: plan and records have them,
        as nobody knows those of pods to come. Whoever looks at the graph on the robot knows what they mean there."""
        self.registered, self.graph = graph, with_rates(graph.by_revision(), self.graph)
        self.recorded, self.stale = True, False


# --- a robot at rest ------------------------------------------------------------------------------------------------


class BusyError(FleetError):
    """The robot works, and the run does not wait any longer."""


class Rest:
    """Of one robot, for one change of it: its actions are idle, and new goals are held back.

    By the `policy` wait it has `busy_timeout` seconds to come to rest, from when an earlier look began to wait
    (`since`, by the clock's `now`), or from the first call.
    """

    def __init__(self, hands: Hands, policy: str, since: float | None) -> None:
        self._hands, self.policy, self.since = hands, policy, since
        self.seconds = hands.settings.busy_timeout if policy == "wait" and not hands.check else 0.0
        self.look = hands.settings.look_timeout  # seconds of one wait; None: all that are left
        self.held: dict[str, Object] = {}  # by name, actions whose new goals are, or may be, held back

    @property
    def patient(self) -> bool:
        return self.since is not None and self._hands.clock.now() < self.since + self.seconds

    def needed(self, calm: Calm) -> bool:
        """Whether there is anything to wait for; in check mode whoever forces wants to know of it, too."""
        return bool(calm) and (self.policy != "force" or self._hands.check)

    def begin(self, calm: Calm, change: str, who: str = "", seconds: float | None = None) -> None:
        """Wait until it is, as `idle` does; BusyError, or NotReadyError where nobody can tell.

        In check mode nobody has waited: what would be waited for is no reason against the change.
        """
        hands, whose = self._hands, f"{who}: " if who else ""
        topics = {one["topic"] for one in calm.when if "topic" in one}
        silent = {topic for topic in topics if not hands.graph.topic(topic).publishers}
        owners = {topic: app.name for topic, app, _said in promised(hands.robot) if topic in silent} if silent else {}
        for topic, app in owners.items():  # it may be down, and come up with this very run
            hands.say(f"{change}: {topic} is app {app}'s, which publishes nothing; {UNASKED}")
        seen = self.idle(calm, f"{change} waits until {who or 'the robot'} is idle", seconds=seconds)
        if hands.check:
            hands.say(f"{change}: {whose}{'idle now' if seen.verdict == PASS else f'busy now: {seen.reason}'}")
        if seen.verdict == FAIL and self.policy != "force":
            raise NotReadyError(f"{whose}it cannot be seen whether the robot is idle: {seen.reason}")
        if seen.verdict == WAIT and not (hands.check and self.policy != "defer"):
            raise BusyError(f"{whose}{seen.reason}; {UNASKED}" if silent else f"{whose}{seen.reason}")
        if seen.verdict == PASS and seen.reason:  # a goal that comes now may be lost
            hands.say(f"{change}: {whose}{seen.reason}")

    def idle(self, calm: Calm, what: str, hold: bool = True, seconds: float | None = None) -> Seen:
        """Wait until it is, and hold new goals, so that none comes before the change.

        `what` says who waits for what, `seconds` for how long, whatever is left. Without `hold`, and in check mode,
        nothing is held: the robot is only looked at.
        """
        hands, now = self._hands, self._hands.clock.now()
        self.since = now if self.since is None else self.since
        left, keeper = max(self.since + self.seconds - now, 0.0), "" if hands.check else hands.keeper
        before, named = self.held, {action["name"]: action for action in calm.actions if hold and not hands.check}
        heard = calm.seconds + MARGIN if calm.when else 0.0  # in fewer it cannot be seen
        left = max(left if seconds is None else seconds, heard)
        if seconds is None and self.look is not None and self.seconds:
            left = min(left, max(self.look, heard) if self.look else 0.0)

        def looks(slice_: float) -> Seen:
            wall = hands.clock.wall()
            opens = calm.windows.opens_at(wall)
            if opens > wall:  # before its window opens the robot is left alone
                hands.clock.sleep(min(opens - wall, slice_))
                return Seen(WAIT, f"it may be changed from {calm.windows.told(opens)} on")
            return hands.host.hold(hands.master, keeper, calm, HOLD_SECONDS if hold else 0.0, slice_)

        # as long as nobody knows better: an answer may be lost
        self.held = {**before, **named}
        seen = hands.until(looks, left, what, least=heard, since=self.since)
        # all of them, and not only those of the answer: a keeper that answers too late holds, too
        self.held = {**before, **(named if seen.verdict == PASS else {})}
        return seen

    def put_off(self, why: str) -> None:
        """The change waits for another moment: BusyError. Whoever forces it, or only checks, is told of it alone."""
        hands, self.since = self._hands, self._hands.clock.now() if self.since is None else self.since
        if not hands.check and self.policy != "force":
            raise BusyError(why)
        hands.say(f"WARNING: {why}")

    def let_go(self) -> None:
        """Let the goals go that are held: their clients wait. FleetError; they may be held still."""
        if self.held:
            self._hands.host.release(self._hands.keeper, [*self.held.values()])
            self.held = {}

    def release(self) -> None:
        """The same at the end of all. If nobody can, the keeper does it by itself."""
        try:
            self.let_go()
        except FleetError as error:
            self._hands.say(f"goals of {', '.join(self.held)} may be held for another {HOLD_SECONDS:.0f} s: {error}")
            self.held = {}


def look_seconds(busy_timeout: float, again: bool) -> float:
    """Of one look, where a run comes back to robots that work. The first takes no time: those at rest come first."""
    return max(SLICE, busy_timeout / LOOKS) if again else 0.0
