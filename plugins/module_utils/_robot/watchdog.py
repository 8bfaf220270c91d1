# SPDX-License-Identifier: GPL-3.0-or-later
"""A pod is begun anew of which a ROS node hangs: not during a goal, not while somebody takes a step, not for ever.

A host or a network that is away looks the same from here. So a node counts only while another one of its host answers,
which for a robot's own master is always so: the keeper itself is on that host, and asks all nodes anyway.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Callable, Iterable

from .._common.errors import RosError
from .._ros.backend import Backend, Questions
from .._ros.graph import host_of
from .._step.objects import Object, annotations_of, app_of, has_node, is_ready, name_of
from .._step.words import KEEPER, LIVENESS, LIVENESS_LEAST, LIVENESS_TIMEOUT, MASTER
from .cluster_api import ApiError, Cluster
from .memory import Silence
from .open_goals import open_goals_at

AT_MOST, WITHIN = 3, 3600.0  # restarts of an app, in so many seconds: more of them help nobody
UNREADABLE = 5  # times the timeout: after that, goals of a node that cannot be read keep nobody waiting
GRACE = 10  # s for a pod that works on nothing: its node will not end by itself
REASON = "NodeHung"
TOO_MANY = 429  # the API's answer where a PodDisruptionBudget forbids it


@dataclass(frozen=True)
class Hung:
    """A pod, and its node that is silent longest."""

    pod: Object
    node: str
    seconds: float
    timeout: float

    @property
    def app(self) -> str:
        return app_of(self.pod)

    def left(self, why: object) -> str:
        return f"node {self.node} does not answer, and its pod is left as it is: {why}"


def hung_pods(pods: Iterable[Object], silence: Silence) -> list[Hung]:
    """The longest silent one first. Only apps' pods that the API has for ready, so their host is there."""
    there = [(pod, pod.get("status") or {}) for pod in pods]
    awake = {host_of(uri) for uri in silence.answering}
    hosts = {status.get("hostIP") for pod, status in there if status.get("podIP") in awake or app_of(pod) == KEEPER}
    found = []
    for pod, status in there:
        timeout = _timeout(pod)
        silent = [(seconds, node) for node, (uri, seconds) in silence.silent.items() if has_node(pod, node, uri)]
        seconds, node = max(silent, default=(0.0, ""))
        is_up = is_ready(pod) and app_of(pod) not in ("", MASTER, KEEPER)
        if node and 0 < timeout <= seconds and is_up and status.get("hostIP") in hosts:
            found.append(Hung(pod, node, seconds, timeout))
    return sorted(found, key=lambda one: -one.seconds)


def _timeout(pod: Object) -> float:
    """Seconds; 0: never."""
    try:
        return float(annotations_of(pod).get(LIVENESS, LIVENESS_TIMEOUT))
    except ValueError:  # by hand
        return 0.0


class Watchdog:
    """Looks at what does not answer in one namespace after the other."""

    def __init__(
        self, cluster: Cluster, ros: Backend, silence: Callable[[], Silence], now: Callable[[], float] = time.monotonic
    ) -> None:
        """`silence` is what the keeper knows of all nodes of its graph."""
        self.cluster, self.ros, self.silence, self.now = cluster, ros, silence, now
        self.elsewhere: dict[str, set[str]] = {}  # namespace -> addresses of silent nodes in none of its pods: laptops'
        self.restarts: dict[str, list[float]] = {}  # namespace/app -> when

    def hung(self, namespace: str) -> list[Hung]:
        """The pods here that a node hangs in. No request where all answer but those that are in no pod here."""
        silence, others = self.silence(), self.elsewhere.get(namespace, set())
        if all(seconds < LIVENESS_LEAST or uri in others for uri, seconds in silence.silent.values()):
            return []
        pods, silent = self.cluster.pods(namespace), silence.silent.items()
        in_pods = {uri for node, (uri, _seconds) in silent if any(has_node(pod, node, uri) for pod in pods)}
        self.elsewhere[namespace] = {uri for _node, (uri, _seconds) in silent} - in_pods
        return hung_pods(pods, silence)

    def waits(self, namespace: str, one: Hung) -> str:
        """Why the pod is left as it is, in whole words; nothing where it is to be begun anew."""
        if len(self._done(f"{namespace}/{one.app}")) >= AT_MOST:
            return one.left(f"it was begun anew {AT_MOST} times within {WITHIN / 60:.0f} min")
        try:
            node = self.ros.ask(self.ros.state(), Questions({one.node: frozenset()})).node(one.node)
            if node.reachable:
                return f"node {one.node} answers again"
        except RosError:
            pass  # the master is away: what it said of the node's goals is not known either
        goals = open_goals_at(self.ros, one.pod).waiting(patient=one.seconds < UNREADABLE * one.timeout)
        return one.left(goals) if goals else ""

    def begin_anew(self, namespace: str, one: Hung) -> str:
        """Evict it; what was done, or why it could not be. An Event of the pod says so, too.

        What has come since it was looked at last, a goal or an answer of the node, keeps the pod.
        """
        waiting, goals = self.waits(namespace, one), open_goals_at(self.ros, one.pod)
        if waiting:
            return waiting
        at_work = goals.servers and not goals.unknown  # a goal may begin now: its stop hook lets it end
        words = f"node {one.node} has not answered for {one.seconds:.0f} s while its process lives"
        try:
            self.cluster.evict(namespace, one.pod, None if at_work else GRACE)
        except ApiError as error:
            if error.status in (404, 409):  # another pod has its name by now
                return f"{words}; its pod is gone already"
            if error.status == TOO_MANY:
                return f"{words}, and a PodDisruptionBudget keeps its pod: {error}"
            raise
        self._done(f"{namespace}/{one.app}").append(self.now())
        self.cluster.tell(namespace, one.pod, REASON, words)
        return f"{words}: its pod {name_of(one.pod)} is begun anew"

    def _done(self, about: str) -> list[float]:
        """When the app was begun anew lately."""
        lately = [at for at in self.restarts.get(about, ()) if self.now() - at < WITHIN]
        self.restarts[about] = lately
        return lately
