# SPDX-License-Identifier: GPL-3.0-or-later
"""Readiness gates: the keeper says when a pod is Ready of which versions overlap.

docs/updates.md, "The hand-over", is the manual. Nothing of ours runs in these pods: the look is the one that other
pods' startup probe makes (`_pod/started.py`), at the nodes of the pod's address.
"""

from __future__ import annotations

import contextlib
import threading
import time
from dataclasses import dataclass, field
from functools import lru_cache, partial
from typing import Callable, ContextManager, Mapping, Sequence

from .._common.errors import FleetError, RosError
from .._common.poll import FAIL, PASS, overall
from .._pod.own_node import OwnNode, places
from .._pod.started import INTERVAL, SECONDS, SLOW_INTERVAL, Outside, Owed, Starting, introduce, message, owed_by
from .._pod.state import TIMEOUT, Settings, State, load_settings
from .._ros.backend import Backend, MasterState
from .._ros.client import Ros1Client
from .._ros.gate import RATE_WINDOW
from .._ros.graph import Graph, Handshake, Rate, host_of
from .._step.objects import Object, address_of, annotations_of, app_of, gate_of, is_terminating, labels_of, name_of
from .._step.record import record_name, record_of
from .._step.words import CONTAINER, READINESS, REVISION, SETTINGS, TEMPLATE_HASH
from .cluster_api import REFRESH, REFUSED, ApiError, Cluster
from .keeper import Keeper

CALLER = "/rosops_fleet_readiness"
PROVEN = "its nodes are wholly in the graph, with all that they owe: container "
ANEW, ENDED = "not ready: its container was started anew", "not ready: its container has ended"
TELL = 1.0  # s between two reasons that are told of one pod
OWED = 1.0  # s for which what was read of its record counts
GONE = 410  # the API's answer where the version to go on from is too old
AGAIN, SELDOM = 1.0, 300.0  # s after an API that did not answer; at most, between refusals
UNHEARD = 5.0  # s for a node to register with a master that has just come: the keeper restores what it knew
LATCHED = 1.0  # s for what the old pod's nodes have latched

PROVE, WITHDRAW, END = "prove", "withdraw", "end"


# ---- what is to be done


def _running(pod: Object) -> Object:
    """What the kubelet says of the app's container, where that runs."""
    found = (pod.get("status") or {}).get("containerStatuses") or ()
    return next((one for one in found if one.get("name") == CONTAINER and "running" in (one.get("state") or {})), {})


def container_of(pod: Object) -> str:
    """The id of the app's container, once it runs; or empty."""
    return str(_running(pod).get("containerID") or "")


def has_started(pod: Object) -> bool:
    """Whether its own startup probe, where it has one, has passed."""
    return _running(pod).get("started", True) is not False


def is_proven(pod: Object) -> bool:
    """Whether its gate lets it be Ready, for the container that runs now."""
    said, runs = gate_of(pod) or {}, container_of(pod)
    return bool(runs) and said.get("status") == "True" and said.get("message") == PROVEN + runs


def due(pod: Object) -> str:
    """What is to be done about a pod with our gate: PROVE, WITHDRAW, END, or nothing."""
    if is_terminating(pod):
        return END
    if container_of(pod):
        return "" if is_proven(pod) and has_started(pod) else PROVE
    return WITHDRAW if (gate_of(pod) or {}).get("status") == "True" else ""


def settings_of(pod: Object) -> Settings:
    """What is to be seen of it, as its template says it."""
    labels = labels_of(pod)
    known = {
        "ROSOPS_SETTINGS": annotations_of(pod).get(SETTINGS, ""),
        "ROSOPS_REVISION": labels.get(REVISION, ""),
        "ROSOPS_TEMPLATE_HASH": labels.get(TEMPLATE_HASH, ""),
    }
    plain = load_settings(known)
    return load_settings({**known, "ROSOPS_NODE_NAME": f"{plain.node.rpartition('/')[2]}_{plain.version}"})


# ---- doing it


@dataclass(eq=False)
class Readiness:
    """The gates of one namespace's pods. Each pod that is looked at has a thread for as long as that takes."""

    cluster: Cluster
    namespace: str
    ros: Ros1Client  # of all looks: what one of them has read of a large graph the others need not read again
    keep_latched: Callable[[str, str, float], object]  # takes what a node has latched: its name, its address, seconds
    keeper: Keeper  # what it has seen of the master, by `now`
    log: Callable[[str], None]
    now: Callable[[], float] = time.monotonic
    sleep: Callable[[float], None] = time.sleep
    turn: ContextManager[object] = field(default_factory=contextlib.nullcontext)  # for one look, or one end

    def __post_init__(self) -> None:
        self.over = False  # nobody looks after the namespace any more
        self.pods: dict[str, Object] = {}  # by uid, those with our gate
        self.seen: dict[str, OwnNode] = {}  # by uid, the node that was found of a pod last
        self.at_work: set[tuple[str, str]] = set()  # uid, and the container that is looked at, or END
        self.said = ""
        self.lock = threading.Lock()

    def run(self) -> None:
        """Until it is over. A namespace that refuses is asked ever more seldom: it may be gone, or just be made."""
        version, pause = "", AGAIN
        while not self.over:
            try:
                version, pause = self.follow(version), AGAIN
                self._tell("")
            except Exception as error:  # whatever the API sends, what comes next may be better
                version = ""
                if isinstance(error, ApiError) and error.status == GONE:
                    continue
                self._tell(str(error) if isinstance(error, FleetError) else f"{type(error).__name__}: {error}")
                self.sleep(pause)
                if isinstance(error, ApiError) and error.status in REFUSED:
                    pause = min(2 * pause, SELDOM)
                    self.pods.clear()  # nobody waits for them any longer
        self.pods.clear()

    def _tell(self, text: str) -> None:
        if text != self.said:
            self.log(f"{self.namespace}: readiness of pods: {text or 'the Kubernetes API answers'}")
            self.said = text

    def follow(self, version: str) -> str:
        """The pods from that version on (empty: all there are), until the watch ends; from where to go on."""
        if not version:
            found, version = self.cluster.pods_since(self.namespace)
            self.pods = {}
            for pod in found:
                self.take(pod)
            for uid in self.seen.keys() - self.pods.keys():
                self.seen.pop(uid, None)
        for event in self.cluster.watch_pods(self.namespace, version):
            pod = event.get("object") or {}
            if event.get("type") == "ERROR":  # mostly: that version is too old by now
                raise ApiError(str(pod.get("message") or "the watch failed"), pod.get("code") or 0)
            version = str((pod.get("metadata") or {}).get("resourceVersion") or version)
            if event.get("type") == "DELETED":
                self.pods.pop(pod["metadata"]["uid"], None)
                self.seen.pop(pod["metadata"]["uid"], None)
            else:  # a BOOKMARK has no gate
                self.take(pod)
        return version

    def take(self, pod: Object) -> None:
        if gate_of(pod) is None or SETTINGS not in annotations_of(pod):
            return
        uid = str(pod["metadata"]["uid"])
        self.pods[uid] = pod
        what = due(pod)
        if what == WITHDRAW:
            self._say(pod, False, ENDED)
        elif what:
            self._begin(uid, END if what == END else container_of(pod), self.now())

    def _begin(self, uid: str, work: str, since: float) -> None:
        with self.lock:
            new = (uid, work) not in self.at_work
            self.at_work.add((uid, work))
        if new:
            self.start(partial(self._work, uid, work, since))

    def start(self, work: Callable[[], None]) -> None:
        threading.Thread(target=work, daemon=True).start()

    def _work(self, uid: str, work: str, since: float) -> None:
        try:
            if work == END:
                with self.turn:
                    self._end(self.pods[uid])
            else:
                self._prove(uid, work, since)
        except Exception as error:  # one pod's trouble is no other's
            if uid in self.pods and not isinstance(error, ApiError):  # the watch tells of an API that is away
                self.log(f"{self.namespace}: pod {uid}: {type(error).__name__}: {error}")
            self.sleep(AGAIN)
        else:
            since = self.now()
        self.at_work.discard((uid, work))
        pod = self.pods.get(uid)
        if work != END and pod is not None and due(pod) == PROVE:  # it ended by an error, or was proven just now
            self._begin(uid, container_of(pod), since if container_of(pod) == work else self.now())

    def _say(self, pod: Object, ready: bool, text: str) -> Object:
        """In the pod's own condition, which it returns; a pod that has gone meanwhile needs none."""
        said = {"status": str(ready), "reason": "InTheGraph" if ready else "NotInTheGraph", "message": text}
        condition = {"type": READINESS, **said, "lastTransitionTime": self.cluster.stamp()}
        try:
            self.cluster.set_condition(self.namespace, pod, condition)
        except ApiError as error:
            if error.status not in (404, 409):
                raise
        return condition

    # ---- a new version

    def _prove(self, uid: str, container: str, began: float) -> None:
        """The graph is looked at while the pod's own command is still awaited, and once more when that has passed.

        The kubelet takes up to a second to count a gate, so the gate has to be there when the command passes. A look
        that finds something missing until then takes it back.
        """
        pod, told, told_at = self.pods[uid], "", self.now() - TELL
        proven, proven_at = is_proven(pod), began
        if not proven and (gate_of(pod) or {}).get("status") == "True":
            self._say(pod, False, ANEW)
        look = self.looks(pod)
        while True:
            has_agreed = has_started(self.pods.get(uid, {}))
            with self.turn:
                checks = look()
            pod = self.pods.get(uid, {})
            if is_terminating(pod) or container_of(pod) != container:
                return
            verdict, text, now = overall([check.verdict for check in checks]), message(checks), self.now()
            if verdict == PASS:
                if not proven or (has_agreed and now - proven_at > LATCHED):
                    self._take_latched(pod)
                if not proven:
                    self._open(pod, container)
                    proven, proven_at, told = True, now, ""
                if has_agreed:
                    self.log(f"{self.namespace}: {name_of(pod)} is ready")
                    return
            elif has_agreed and look.unregistered and began < self.keeper.restarted_at <= now - UNHEARD:
                words = "it registered with a master that has gone, and nodes of ROS register once; it is begun anew"
                self.cluster.evict(self.namespace, pod, None)
                self.cluster.tell(self.namespace, pod, "NodeUnheard", words)
                self.log(f"{self.namespace}: {name_of(pod)}: {words}")
                return
            elif text != told and (verdict == FAIL or proven or now - told_at >= TELL):
                self._say(pod, False, text)
                proven, told, told_at = False, text, now
            self.sleep(INTERVAL if not proven and now - began < SECONDS else SLOW_INTERVAL)

    def _take_latched(self, pod: Object) -> None:
        """From the pods that it is to replace."""
        for node in self._nodes([one for one in self._others(pod) if not is_terminating(one)]):
            self.keep_latched(node.name, node.uri, LATCHED)

    def _open(self, pod: Object, container: str) -> None:
        said = self._say(pod, True, PROVEN + container)
        rest = [one for one in pod["status"].get("conditions") or () if one.get("type") != READINESS]
        proven = {**pod, "status": {**pod["status"], "conditions": [*rest, said]}}
        self.pods[pod["metadata"]["uid"]] = proven  # the watch is a moment late

    def looks(self, pod: Object) -> Starting:
        """Who looks at a pod again and again."""
        settings, address, uid = settings_of(pod), address_of(pod), str(pod["metadata"]["uid"])
        ros, record = self.ros, record_name(app_of(pod))

        def here(state: MasterState) -> Mapping[str, str]:
            return {name: uri for name, uri in places(ros, settings, state).items() if host_of(uri) == address}

        def keep(name: str, found: State) -> None:
            self.seen[uid] = OwnNode(name, found.uri, found.services, settings)

        @lru_cache(maxsize=1)
        def owed(_moment: int) -> Owed:
            """By the app's record. What is unknown, as the API is away, waits."""
            return owed_by(record_of(self.cluster.config_map(self.namespace, record)), settings.revision)

        outside = Outside(
            run=lambda *_: "",  # its own startup probe asks the command
            agreed=lambda: has_started(self.pods.get(uid, {})),
            here=here,
            is_here=lambda uri: host_of(uri) == address,
            places=partial(places, ros, settings),
            children=lambda _addresses: (),
            introduce=partial(introduce, ros),
            owed=lambda: owed(int(self.now() / OWED)),
            keep=keep,
            is_whole=self.keeper.is_whole,
            measured=Sent(ros),
            now=self.now,
            sleep=self.sleep,
        )
        return Starting(settings, ros, outside)

    # ---- the old one

    def _end(self, pod: Object) -> None:
        """Its nodes leave the graph, and end: roscpp as process 1 of a container is deaf to SIGTERM."""
        if not pod["spec"].get("hostNetwork"):
            self.keeper.has_ended(address_of(pod), settings_of(pod).space)
        replaced = any(map(is_proven, self._others(pod)))
        for node in self._nodes([pod]):
            if not replaced:  # else that was done before the next one was said to be ready
                self.keep_latched(node.name, node.uri, LATCHED)
            for step in (node.unregister, node.forget, node.shut_down):
                try:
                    step(TIMEOUT)
                except RosError as error:
                    self.log(f"{self.namespace}: {node.name} of {name_of(pod)}, which ends: {error}")

    def _others(self, pod: Object) -> list[Object]:
        uid = pod["metadata"]["uid"]
        return [one for one in list(self.pods.values()) if app_of(one) == app_of(pod) and one["metadata"]["uid"] != uid]

    def _nodes(self, pods: Sequence[Object]) -> list[OwnNode]:
        """What is registered from their addresses; where no master answers the nodes that were seen of them last."""
        try:
            state = self.ros.state() if pods else MasterState()
            return [node for pod in pods for node in self._registered(pod, state)]
        except RosError:
            uids = [str(pod["metadata"]["uid"]) for pod in pods]
            return [self.seen[uid] for uid in uids if uid in self.seen]

    def _registered(self, pod: Object, state: MasterState) -> list[OwnNode]:
        """No other robot's: a pod's address is what its host says."""
        settings, address = settings_of(pod), address_of(pod)
        here = {name: uri for name, uri in places(self.ros, settings, state).items() if host_of(uri) == address != ""}
        services = self.ros.addresses((), [one for name in here for one in state.graph.node(name).services])[1]
        return [OwnNode(name, uri, services, settings) for name, uri in here.items()]


@dataclass(eq=False)
class AllGates:
    """Those of all namespaces that the keeper looks after. Each has a thread, for as long as it is listed."""

    cluster: Cluster
    made: Callable[[str], Readiness]  # for a namespace
    sleep: Callable[[float], None] = time.sleep
    gates: dict[str, Readiness] = field(default_factory=dict)  # by namespace

    def run(self) -> None:
        while True:
            with contextlib.suppress(Exception):  # who watches steps asks the same, and tells why there is no answer
                self.look()
            self.sleep(REFRESH)

    def look(self) -> None:
        listed = self.cluster.namespaces()
        for namespace in self.gates.keys() - {*listed}:
            self.gates.pop(namespace).over = True
        for namespace in listed:
            if namespace not in self.gates:
                made = self.made(namespace)
                made.start(made.run)
                self.gates[namespace] = made


class Sent:
    """What the nodes of a version before send, and its definitions: listened to once, when a new pod is first held to
    it.
    """

    def __init__(self, ros: Backend) -> None:
        self.ros = ros
        self.taken: tuple[Mapping[str, Rate], Mapping[str, Handshake]] | None = None

    def __call__(self, graph: Graph, nodes: Sequence[str]) -> Graph:
        if self.taken is None:
            heard = graph.heard(nodes)
            rates = self.ros.rates(heard, dict.fromkeys(heard.topics, RATE_WINDOW), patient=True)
            self.taken = rates, self.ros.handshakes(heard, heard.topics)
        return graph.measured(*self.taken)
