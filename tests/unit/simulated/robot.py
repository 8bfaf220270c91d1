# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot and its cluster, simulated: pods that behave as their versions do, the ROS graph that follows, goals.

What the robot shows is judged by the collection's own code (gate, contract, hold). `Version` says how an image behaves,
`Offer` what an app is to the ROS graph. Times are in seconds.
"""

from __future__ import annotations

import heapq
import json
import zlib
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import MasterState, Questions, everything
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import (
    Graph,
    Handshake,
    Rate,
    ServiceProbe,
    StatusReading,
)
from ansible_collections.rosops.fleet.plugins.module_utils._ros.replies import NodeAnswer, build
from ansible_collections.rosops.fleet.plugins.module_utils._step import words
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import app_of, revision_of, suffix_of
from ansible_collections.rosops.fleet.plugins.module_utils._step.words import TEMPLATE_HASH
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Object

EPOCH = 1795252000.0
FOREVER = 1e12
LEAST = 0.001  # what is left of a wait after rounding must not take for ever
PROBE = 0.5  # between two looks of a pod's startup probe
START, REGISTER, STOP = 1.0, 0.3, 0.5  # of a container, of its node, of a pod that has nothing to drain
WAITS = 0.1  # between two looks of a pod whether its node's name is free
BACKOFF = 10.0  # between the second start of a container that crashes and the next
DRAIN = 30.0  # a pod's stop hook waits so long for an open goal
REAP = 15.0  # until the keeper takes away what a killed process left
KEEPER = 3.0  # until the keeper has given a new master what was registered
HOLD = 60.0  # the longest that the keeper holds goals

# --- how versions behave, and what apps offer -----------------------------------------------------------------------


@dataclass(frozen=True)
class Version:
    """`crash_at`, `hang_at`, `worse_at`: seconds after its start; `crashes` is how often, `worse` what it does less."""

    starts: bool = True
    connects: bool = True
    rate: float = 1.0  # of what the app sends
    offers_all: bool = True
    crash_at: float = FOREVER
    crashes: int = 0
    hang_at: float = FOREVER
    worse_at: float = FOREVER
    worse: str = ""

    @property
    def late(self) -> bool:
        """Whether it passes for a good one at first, so that the old one has gone when it shows what it is."""
        return min(self.hang_at, self.worse_at) < FOREVER or FOREVER > self.crash_at > PROBE

    @property
    def good(self) -> bool:
        return self in (GOOD, CRASHES_ONCE)


GOOD = Version()
CRASHES_ONCE = Version(crash_at=0.4, crashes=1)
VERSIONS = {
    "good": GOOD,
    "crashes-once": CRASHES_ONCE,
    "never-starts": Version(starts=False),
    "never-connects": Version(connects=False),
    "half-the-rate": Version(rate=0.5),
    "offers-less": Version(offers_all=False),
    "crashes-at-once": Version(crash_at=0.4, crashes=999),
    "crashes-when-ready": Version(crash_at=5.0, crashes=999),
    "hangs": Version(hang_at=5.0),
    **{f"crashes-after-{seconds}": Version(crash_at=float(seconds), crashes=999) for seconds in (1, 3, 5, 8, 30, 90)},
    "sends-less-after-30": Version(worse_at=30.0, worse="rate"),
    "loses-its-edges-after-30": Version(worse_at=30.0, worse="edges"),
    "crashes-after-5-once": Version(crash_at=5.0, crashes=1),
}


def image(version: str, number: int = 1) -> str:
    """The name of an image that behaves like this."""
    return f"x.org/app:{version}.{number}"


def version_of(name: str) -> Version:
    return VERSIONS.get(name.rpartition(":")[2].partition(".")[0], GOOD)


@dataclass(frozen=True)
class Offer:
    """What an app is to the graph: topic -> Hz, and names, relative to its namespace."""

    topics: Mapping[str, float] = field(default_factory=dict)
    subscriptions: Sequence[str] = ()
    services: Sequence[str] = ()
    actions: Sequence[str] = ()
    moving: Mapping[str, float] = field(default_factory=dict)  # topic -> Hz while a goal is under way, else nothing
    held: Sequence[str] = ()  # actions of another node of its launch file, which waits for the old version's to end


OFFERS = {
    "sensor": Offer({"temperature": 500.0}, services=["calibrate"]),
    "stats": Offer({"mean": 20.0}, ["temperature"], ["reset_stats"]),
    "planner": Offer({"load": 100.0}, actions=["plan"], moving={"velocity": 20.0}),
    "driver": Offer({"scan": 40.0}, services=["reset_driver"]),
    "chart": Offer({"map": 10.0}, services=["get_map"]),
    "base": Offer({"odom": 50.0}, ["temperature"], ["reset_base"]),  # a launch file
    "arm": Offer({"joints": 50.0}, services=["reset_arm"], held=["lift"]),  # another one
}
SERVER_TOPICS = (("status", True), ("feedback", True), ("result", True), ("goal", False), ("cancel", False))


@dataclass
class Process:
    """A ROS node: of a pod, or one that nobody deployed. What it has registered, it has under these names."""

    node: str
    uri: str
    topics: Mapping[str, float] = field(default_factory=dict)
    subscriptions: Sequence[str] = ()
    services: Sequence[str] = ()
    actions: Sequence[str] = ()
    connects: bool = True
    alive: bool = True
    moving: Collection[str] = ()


@dataclass
class Pod:
    uid: int
    key: tuple[str, str]
    app: str
    template: str  # its hash
    version: Version
    node: str
    offer: Offer
    handoff: str
    revision: str
    hash: str  # of its template, by Kubernetes
    gate: bool  # the keeper says when it is Ready, and nothing of ours is in it
    process: Process | None = None
    held: Process | None = None  # of its launch file
    restarts: int = 0
    ready: bool = False
    since: float = 0.0  # ready
    met: bool = False  # it has shown all that its contract asks for
    hopeless: str = ""
    stopping: bool = False
    gone: bool = False
    waits: bool = False  # its container runs, and waits for the end of the process that has its node's name

    @property
    def up(self) -> bool:
        return self.process is not None and self.process.alive

    @property
    def processes(self) -> list[Process]:
        return [one for one in (self.process, self.held) if one]


@dataclass
class Goal:
    action: str
    seconds: float
    process: Process | None = None  # that works on it
    ended: bool = False


@dataclass
class Hold:
    server: Process | None
    until: float
    asked: bool = False  # by a step, and not by a pod that ends


class SimulatedRobot:
    """Everything that goes on by itself. `invariants` is called after every event that changed something."""

    def __init__(self) -> None:
        HASHES.clear()
        self.time = 0.0
        self.queue: list[tuple[float, int, Callable[[], None]]] = []
        self.count = self.version = 0
        self.objects: dict[tuple[str, str, str], dict[str, Any]] = {}
        self.pods: list[Pod] = []
        self.registered: dict[str, Process] = {}
        self.providers: dict[str, str] = {}  # service -> the node that registered it last
        self.others: list[Process] = []
        self.goals: list[Goal] = []
        self.waiting: list[Goal] = []  # held, or without a server
        self.holds: dict[str, Hold] = {}
        self.uneven_until = -1.0  # the machine stands still now and then: no rate can be told
        self.robot_until = self.master_until = self.deaf_until = -1.0  # away, silent; action servers that tell nothing
        self.cut: list[Goal] = []  # goals whose server was stopped under them

    def invariants(self) -> None:
        """What must hold at every moment."""

    # --- time -------------------------------------------------------------------------------------------------------

    def now(self) -> float:
        return self.time

    def later(self, seconds: float, what: Callable[[], None]) -> None:
        self.count += 1
        heapq.heappush(self.queue, (self.time + seconds, self.count, what))

    def advance(self, seconds: float) -> None:
        end = self.time + max(seconds, LEAST if seconds else 0.0)
        while self.queue and self.queue[0][0] <= end:
            self._next()
        self.time = end

    def _next(self) -> None:
        self.time, _number, what = heapq.heappop(self.queue)
        before = self.version
        what()
        if self.version != before:
            self.invariants()

    def changed(self) -> None:
        self.version += 1

    def settle(self, seconds: float = 200.0) -> None:
        """Until nothing is on its way any more."""
        end = self.time + seconds
        while self.queue and self.queue[0][0] <= end:
            self._next()

    # --- the cluster's controllers ----------------------------------------------------------------------------------

    def of(self, key: tuple[str, str]) -> list[Pod]:
        return [pod for pod in self.pods if pod.key == key and not pod.gone]

    def deployment(self, key: tuple[str, str]) -> dict[str, Any] | None:
        return self.objects.get(("Deployment", *key))

    def reconcile(self, key: tuple[str, str]) -> None:
        """What the Deployment's controller does next."""
        wanted, pods = self.deployment(key), self.of(key)
        if wanted is None or not wanted["spec"].get("replicas", 1):
            for pod in pods:
                self.stop(pod)
            return
        new = [pod for pod in pods if pod.hash == kubernetes_hash(wanted) and not pod.stopping]
        old = [pod for pod in pods if pod.hash != kubernetes_hash(wanted)]
        overlap = wanted["spec"]["strategy"]["type"] == "RollingUpdate"
        patience = wanted["spec"].get("minReadySeconds", 0)
        for pod in old:
            if not overlap or not pod.ready or any(one.ready and self.time - one.since >= patience for one in new):
                self.stop(pod)
        leaving = [pod for pod in pods if pod not in new]
        if not new and (overlap or not leaving):
            self.create(key, wanted)

    def create(self, key: tuple[str, str], wanted: Object) -> None:
        spec = wanted["spec"]["template"]
        app = app_of(wanted)
        said = spec["metadata"].get("annotations") or {}
        pod = Pod(
            len(self.pods), key, app, template_of(wanted), version_of(spec["spec"]["containers"][0]["image"]),
            "" if app in INFRASTRUCTURE else node_in_pod(wanted), OFFERS.get(app, Offer()),
            said.get(words.HANDOFF, "replace"), revision_of(wanted), kubernetes_hash(wanted),
            "readinessGates" in spec["spec"],
        )  # fmt: skip
        self.pods.append(pod)
        self.kubelet(START, lambda: self.run_pod(pod))
        self.changed()

    def kubelet(self, seconds: float, what: Callable[[], None]) -> None:
        """A robot that is away hears nothing of what it should do."""

        def due() -> None:
            if self.robot_until > self.time:
                self.later(1.0, due)
            else:
                what()

        self.later(seconds, due)

    def run_pod(self, pod: Pod) -> None:
        if pod.gone or pod.stopping:
            return
        if not pod.version.starts:
            pod.restarts += 1
            self.changed()
            self.later(BACKOFF, lambda: self.run_pod(pod))
            return
        before, pod.waits = pod.waits, self.taken(pod)
        if pod.waits != before:
            self.changed()
        if pod.waits:
            self.later(WAITS, lambda: self.run_pod(pod))
            return
        start = pod.restarts
        if pod.restarts < pod.version.crashes:
            self.later(pod.version.crash_at, lambda: self.crash(pod, start))
        if pod.version.hang_at < FOREVER:
            self.later(pod.version.hang_at, lambda: self.hang(pod, start))
        if pod.version.worse:
            self.later(pod.version.worse_at, lambda: self.worsen(pod, start))
        pod.process = self.process_of(pod)
        self.changed()
        self.later(REGISTER, lambda: self.enter(pod, start))
        self.later(PROBE, lambda: self.probe(pod, start))
        if pod.offer.held:
            self.later(REGISTER, lambda: self.begin_held(pod, start))

    def begin_held(self, pod: Pod, start: int) -> None:
        """As soon as no other version has its own, and there is a master."""
        if pod.gone or pod.stopping or pod.restarts != start:
            return
        others = [one.held for one in self.of(pod.key) if one is not pod and one.held and one.held.alive]
        if others or not self.master_up():
            self.later(WAITS, lambda: self.begin_held(pod, start))
            return
        actions = [f"/{name}" for name in pod.offer.held if pod.version.offers_all]
        address = f"http://10.42.0.{pod.uid}:{5000 + pod.restarts}/"
        pod.held = Process(pod.node.replace("_node", "_held"), address, actions=actions, connects=pod.version.connects)
        self.register(pod.held)

    def taken(self, pod: Pod) -> bool:
        """Whether another pod's process has the name of its node, for the end of which its own waits.

        One that overlaps waits for nobody: its node takes the name, and the master sends the other one away.
        """
        others = [one for one in self.pods if one is not pod and one.node and one.up and not one.gone]
        return pod.handoff != "overlap" and any(one.node == pod.node for one in others)

    def process_of(self, pod: Pod) -> Process:
        below, offer, all_of_it = pod.node.rpartition("/")[0], pod.offer, pod.version.offers_all
        topics = {**offer.topics, **offer.moving}
        return Process(
            pod.node,
            f"http://10.42.0.{pod.uid}:{4000 + pod.restarts}/",
            {f"{below}/{name}": hz * pod.version.rate for name, hz in topics.items()},
            [f"{below}/{name}" for name in offer.subscriptions],
            [f"{below}/{name}" for name in offer.services if all_of_it],
            [f"{below}/{name}" for name in offer.actions if all_of_it],
            pod.version.connects,
            moving={f"{below}/{name}" for name in offer.moving},
        )

    def crash(self, pod: Pod, start: int) -> None:
        if pod.gone or pod.restarts != start or not pod.process:
            return
        pod.ready, pod.restarts = False, start + 1
        for process in pod.processes:
            process.alive = False
            self.later(REAP, lambda process=process: self.reap(process))  # type: ignore[misc]
        self.changed()
        self.later(1.0 if pod.restarts == 1 else BACKOFF, lambda: self.run_pod(pod))
        self.reconcile(pod.key)

    def hang(self, pod: Pod, start: int) -> None:
        if not pod.gone and pod.restarts == start and pod.process:
            pod.process.alive = False  # ready all the same: the kubelet asks a pod that is at work nothing
            self.changed()

    def worsen(self, pod: Pod, start: int) -> None:
        """It runs on, and gives less."""
        process = pod.process
        if pod.gone or pod.restarts != start or process is None:
            return
        if pod.version.worse == "rate":
            process.topics = {name: hz / 2 for name, hz in process.topics.items()}
        else:
            process.connects = False
        self.changed()

    def enter(self, pod: Pod, start: int) -> None:
        """Its node registers, as soon as there is a master."""
        if pod.gone or pod.restarts != start or not pod.up or pod.app in INFRASTRUCTURE:
            return
        if not self.master_up():
            self.later(PROBE, lambda: self.enter(pod, start))
        elif pod.process:
            self.register(pod.process)

    def probe(self, pod: Pod, start: int) -> None:
        """The startup probe, until it passes once."""
        if pod.gone or pod.stopping or pod.restarts != start or not pod.up or pod.ready:
            return
        if pod.gate and not self.keeper_sees():
            self.later(PROBE, lambda: self.probe(pod, start))
            return
        why = self.unready(pod)
        hopeless = why if why.startswith("cannot") else ""
        if hopeless != pod.hopeless:
            pod.hopeless = hopeless
            self.changed()
        if why:
            self.later(PROBE, lambda: self.probe(pod, start))
            return
        pod.ready, pod.since = True, self.time
        pod.met = True
        self.changed()
        if pod.app == names.MASTER_NAME:
            self.later(KEEPER, self.remember)
        self.reconcile(pod.key)

    def keeper_sees(self) -> bool:
        """Whether it looks at pods, and can say what it sees."""
        return self.is_up(names.KEEPER_NAME)

    def unready(self, pod: Pod) -> str:
        if pod.app in INFRASTRUCTURE:
            return ""
        process = pod.process
        there = process and self.registered.get(pod.node) is process and self.master_up()
        if not process or not there or not process.connects:
            return "not wholly part of the graph"
        return self.broken_promise(pod, process)

    def broken_promise(self, pod: Pod, process: Process) -> str:
        contract = self.promised(pod.key[0], pod.app)
        judged = not contract or contract.get("proven") or contract.get("soak")
        if judged or contract["revision"] != pod.revision:
            return self.less_than_beside(pod, process, "" if judged else contract["revision"])
        lacking = [name for name in contract["services"] if name not in process.services]
        lacking += [name for name in contract["topics"] if name not in topics_of(process)]
        if lacking:
            return f"cannot become ready: it lacks {', '.join(lacking)}"
        for name, topic in contract["topics"].items():
            rates = [sent["rate"] or 0.0 for sent in topic["publishers"].values()]
            least = max(rates, default=0.0) * (1 - contract["tolerance"])
            if self.hertz(process, name) < least:
                return f"too slow on {name}"
        return ""

    def less_than_beside(self, pod: Pod, process: Process, trial: str) -> str:
        """What a version lacks that no step has brought, and the pods have that it is to replace."""
        others = [one.process for one in self.of(pod.key) if one is not pod and one.revision != trial and one.process]
        beside = [one for one in others if one.alive and self.registered.get(one.node) is one]
        offered = {name for one in beside for name in (*topics_of(one), *one.services)}
        lacking = offered - {*topics_of(process), *process.services}
        return f"it lacks {', '.join(sorted(lacking))} of the pod before" if lacking else ""

    def hertz(self, process: Process, topic: str) -> float:
        at_work = any(goal.process is process and not goal.ended for goal in self.goals)
        return 0.0 if topic in process.moving and not at_work else process.topics.get(topic, 0.0)

    def promised(self, namespace: str, app: str) -> Any:
        return json.loads(self.update_map(namespace, app)["data"]["contract.json"])

    def update_map(self, namespace: str, app: str) -> Mapping[str, Any]:
        return self.objects.get(("ConfigMap", namespace, names.update_name(app))) or NO_MAP

    def stop(self, pod: Pod) -> None:
        if pod.stopping or pod.gone:
            return
        pod.stopping = True
        self.changed()
        if pod.handoff == "drain" or pod.held:
            for process in pod.processes:
                for action in process.actions:  # its stop hook has goals held
                    self.holds[action] = Hold(process, self.time + HOLD)
                    self.later(HOLD, lambda action=action: self.expire(action))  # type: ignore[misc]
            self.kubelet(STOP, lambda: self.drain(pod, self.time + DRAIN))
        else:
            self.kubelet(STOP, lambda: self.end(pod))

    def drain(self, pod: Pod, deadline: float) -> None:
        works = any(goal.process is one and not goal.ended for one in pod.processes for goal in self.goals)
        if self.time < deadline and works:
            self.later(PROBE, lambda: self.drain(pod, deadline))
        else:
            self.end(pod)

    def end(self, pod: Pod) -> None:
        """Cleanly: its nodes leave the graph. Without a keeper nothing of ours sees the end of a pod with a gate."""
        pod.gone, pod.ready = True, False
        for process in pod.processes:
            if process.alive:
                process.alive = False
                self.cut += [goal for goal in self.goals if goal.process is process and not goal.ended]
                if pod.gate and not self.keeper_sees():
                    self.later(REAP, lambda process=process: self.reap(process))  # type: ignore[misc]
                elif self.registered.get(process.node) is process:
                    self.unregister(process.node)
        if pod.app == names.MASTER_NAME:
            self.registered, self.providers = {}, {}
        if pod.app == names.KEEPER_NAME:
            self.holds = {}
        self.changed()
        self.reconcile(pod.key)

    # --- the robot's graph ------------------------------------------------------------------------------------------

    def is_up(self, app: str) -> bool:
        return any(pod.app == app and pod.ready and pod.up for pod in self.pods)

    def master_up(self) -> bool:
        """That of a robot without ROS is its keeper."""
        alone = all(pod.app != names.MASTER_NAME for pod in self.pods)
        return self.is_up(names.KEEPER_NAME if alone else names.MASTER_NAME)

    def register(self, process: Process) -> None:
        self.registered[process.node] = process
        self.providers.update(dict.fromkeys(process.services, process.node))
        for action in process.actions:
            hold = self.holds.get(action)
            if hold and hold.server is not process:
                del self.holds[action]  # the keeper hands what it held to the new server
        self.serve_waiting()
        self.changed()

    def registered_whole(self, process: Process) -> bool:
        """Whether the master knows all that it has."""
        providers = {self.providers.get(service) for service in process.services}
        return self.registered.get(process.node) is process and providers <= {process.node}

    def unregister(self, node: str) -> None:
        process = self.registered.pop(node)
        for service in process.services:
            if self.providers.get(service) == node:
                del self.providers[service]
                self.later(KEEPER, self.remember)  # an earlier provider may live
        self.changed()

    def remember(self) -> None:
        """The keeper gives the master back what it lost: all of it where it is a new one."""
        if self.master_up() and self.is_up(names.KEEPER_NAME):
            for process in self.living():
                lost = [name for name in process.services if name not in self.providers]
                if process.node not in self.registered or lost:
                    self.register(process)

    def reap(self, process: Process) -> None:
        if self.registered.get(process.node) is process and self.master_up() and self.is_up(names.KEEPER_NAME):
            self.unregister(process.node)

    def living(self) -> list[Process]:
        there = [pod for pod in self.pods if not pod.gone and pod.app not in INFRASTRUCTURE]
        own = [process for pod in there for process in pod.processes]
        return [process for process in [*own, *self.others] if process.alive]

    def graph(self, wanted: Callable[[MasterState], Questions] = everything) -> Graph:
        self.ask_master()
        state = self.state()
        return self.ask(state, wanted(state))

    def ask_master(self) -> None:
        if not self.master_up() or self.master_until > self.time:
            raise RosError("the ROS master does not answer")

    # what gate.look asks of a ROS system
    uri = "http://10.43.0.1:11311"

    def state(self, types: bool = False) -> MasterState:
        del types
        self.ask_master()
        publishers: dict[str, list[str]] = {}
        subscribers: dict[str, list[str]] = {}
        for node, process in sorted(self.registered.items()):
            for topic in topics_of(process):
                publishers.setdefault(topic, []).append(node)
            for topic in subscriptions_of(process):
                subscribers.setdefault(topic, []).append(node)
        given = dict.fromkeys(publishers, "x/Type")
        given.update({topic: "x/DoActionGoal" for topic in subscribers if topic.endswith("/goal")})
        return MasterState(
            tuples(publishers), tuples(subscribers), tuples({k: [v] for k, v in self.providers.items()}), given
        )

    def ask(self, state: MasterState, wanted: Questions) -> Graph:
        answers = {node: self.answer(node, state) for node in wanted.nodes}
        probes = {}
        for service in wanted.services:
            process = self.registered.get(self.providers.get(service, ""))
            if process is not None and process.alive:
                probes[service] = ServiceProbe("rosrpc://x", process.node, "x/Srv")
            else:
                probes[service] = ServiceProbe(error="dead")
        statuses = {action: self.statuses(action) for action in wanted.actions}
        return build(state, answers, probes, statuses)

    def answer(self, node: str, state: MasterState) -> NodeAnswer:
        process = self.registered.get(node)
        if process is None or not process.alive:
            return NodeAnswer(process.uri if process else "", error="it does not answer", refused=True)
        bus = [
            [number, peer, "o", "TCPROS", topic, True]
            for topic in topics_of(process)
            for number, peer in enumerate(state.subscribers.get(topic, ()))
            if process.connects and self.registered[peer].alive and self.registered[peer].connects
        ]
        return NodeAnswer(process.uri, 4711, bus=bus)

    def statuses(self, action: str) -> dict[str, StatusReading]:
        found = {}
        for node, process in self.registered.items():
            if action in process.actions:
                states = tuple(1 for goal in self.goals if goal.process is process and not goal.ended)
                told = process.alive and self.deaf_until <= self.time
                found[node] = StatusReading((states, states)) if told else StatusReading(error="it tells nothing")
        return found

    def handshakes(self, graph: Graph, topics: Iterable[str]) -> dict[str, Handshake]:
        raise NotImplementedError

    def rates(self, graph: Graph, seconds: Mapping[str, float], patient: bool = False) -> dict[str, Rate]:
        del patient
        self.advance(max(seconds.values(), default=0.0))
        found = {}
        for topic, window in seconds.items():
            by = {}
            for key in graph.topic(topic).publishers:
                process = self.registered.get(key.name)
                hz = self.hertz(process, topic) if process and process.alive else 0.0
                told = hz > 0 and self.uneven_until <= self.time
                by[key] = Rate(hz, int(hz * window), window, known=hz if told else None)
            found[topic] = Rate(sum(rate.hz for rate in by.values()), 0, window, by=by)
        return found

    # --- goals ------------------------------------------------------------------------------------------------------

    def goal(self, action: str, seconds: float, after: float = 0.0) -> Goal:
        """A client sends a goal that takes so long."""
        goal = Goal(action, seconds)
        self.goals.append(goal)
        self.later(after, lambda: self.send(goal))
        return goal

    def send(self, goal: Goal) -> None:
        self.waiting.append(goal)
        self.serve_waiting()

    def serve_waiting(self) -> None:
        for goal in [*self.waiting]:
            servers = [one for one in self.registered.values() if goal.action in one.actions and one.alive]
            if servers and goal.action not in self.holds:
                self.waiting.remove(goal)
                goal.process = server = servers[0]
                self.later(goal.seconds, lambda goal=goal, server=server: self.done(goal, server))  # type: ignore[misc]

    def done(self, goal: Goal, process: Process) -> None:
        if goal.process is process and process.alive:
            goal.ended = True

    def let_go(self, action: str) -> None:
        """What was held goes to whatever server there is."""
        self.holds.pop(action, None)
        self.serve_waiting()

    def expire(self, action: str) -> None:
        hold = self.holds.get(action)
        if hold and hold.until <= self.time:
            self.let_go(action)


NO_MAP = {"data": {"contract.json": "{}", "history.json": "[]"}}
LETTERS = "bcdfghjklmnpqrstvwxz2456789"  # apimachinery's SafeEncodeString
HASHES: dict[int, tuple[Object, str]] = {}  # of templates, which nobody changes in place
INFRASTRUCTURE = (names.MASTER_NAME, names.KEEPER_NAME, names.EXPORTER_NAME)


def template_of(deployment: Object) -> str:
    return str(deployment["metadata"]["annotations"][names.ANNOTATION_HASH])


def looping(pod: Pod) -> bool:
    """CrashLoopBackOff."""
    return pod.restarts >= 2 and not pod.up


def pod_object(pod: Pod) -> Object:
    """As the API shows it."""
    labels = {names.LABEL_APP: pod.app, names.LABEL_REVISION: pod.revision, TEMPLATE_HASH: pod.hash}
    waits = "CrashLoopBackOff" if looping(pod) else "ContainerCreating"
    container: Object = {"state": {"running": {}} if pod.up or pod.waits else {"waiting": {"reason": waits}}}
    if pod.restarts:
        life = {"startedAt": "2026-11-25T14:00:00Z", "finishedAt": "2026-11-25T14:00:01Z"}
        container["lastState"] = {"terminated": {"exitCode": 1, "reason": "Error", **life}}
    container |= {"ready": pod.ready, "restartCount": pod.restarts}
    return {
        "metadata": {"name": f"{pod.app}-{pod.uid}", "namespace": pod.key[0], "labels": labels},
        "spec": {},
        "status": {
            "podIP": f"10.42.0.{pod.uid}" if pod.process else None,
            "containerStatuses": [container],
            "conditions": [{"type": "Ready", "status": str(pod.ready)}],
        },
    }


def kubernetes_hash(deployment: Object) -> str:
    """The label pod-template-hash, with its letters."""
    template = deployment["spec"]["template"]
    known, said = HASHES.get(id(template), (None, ""))
    if known is not template:
        number = zlib.crc32(json.dumps(template, sort_keys=True).encode())
        said = "".join(LETTERS[ord(digit) % len(LETTERS)] for digit in str(number))
        HASHES[id(template)] = template, said
    return said


def node_in_pod(deployment: Object) -> str:
    """What the pod's node is called: by the container's argument, as Kubernetes hands it on; else by a launch file."""
    template = deployment["spec"]["template"]
    (container,) = template["spec"]["containers"]
    known = {one["name"] for one in container["env"]}
    own = names.TEMPLATE_ENV in known and f"_{kubernetes_hash(deployment)}"
    node = str(template["metadata"]["annotations"].get(names.ANNOTATION_NODE, ""))
    given = [word.partition(":=")[2] for word in container.get("args") or () if word.startswith("__name:=")]
    if node and given:
        name = given[-1].replace(f"_$({names.TEMPLATE_ENV})", own or "")
        return f"{node.rpartition('/')[0]}/{name}"
    return node or f"/{app_of(deployment)}_node{suffix_of(deployment)}{own or ''}"


def tuples(lists: Mapping[str, list[str]]) -> dict[str, tuple[str, ...]]:
    return {name: tuple(sorted(items)) for name, items in lists.items()}


def topics_of(process: Process) -> list[str]:
    return [*process.topics, *(f"{action}/{part}" for action in process.actions for part, own in SERVER_TOPICS if own)]


def subscriptions_of(process: Process) -> list[str]:
    parts = [f"{action}/{part}" for action in process.actions for part, own in SERVER_TOPICS if not own]
    return [*process.subscriptions, *parts]
