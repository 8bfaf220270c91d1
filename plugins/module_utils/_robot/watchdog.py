# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The keeper begins a pod anew whose node hangs: not during a goal, not while somebody takes a step, not for ever.

The keeper asks all nodes anyway, whether they live. So this costs nothing while they answer.
"""

from __future__ import annotations

import time
from typing import Callable

from .._common.errors import RosError
from .._ros.backend import Backend, Questions
from .._step.objects import name_of
from .._step.words import LIVENESS_LEAST
from .cluster_api import ApiError, Cluster
from .hung import AT_MOST, UNREADABLE, WITHIN, Hung, Silence, hung_pods, in_no_pod
from .open_goals import Goals, open_goals_at

GRACE = 10  # s for a pod that works on nothing: its node will not end by itself
REASON = "NodeHung"
TOO_MANY = 429  # the API's answer where a PodDisruptionBudget forbids it


class Watchdog:
    """Looks at what does not answer in one namespace after the other."""

    def __init__(
        self, cluster: Cluster, ros: Backend, silence: Callable[[], Silence], now: Callable[[], float] = time.monotonic
    ) -> None:
        """`silence` is what the keeper knows of all nodes of its graph."""
        self.cluster, self.ros, self.silence, self.now = cluster, ros, silence, now
        self.elsewhere: dict[str, set[str]] = {}  # namespace -> addresses of silent nodes that are in none of its pods
        self.restarts: dict[str, list[float]] = {}  # namespace/app -> when

    def hung(self, namespace: str) -> list[Hung]:
        """The pods here that a node hangs in. No request where all answer but those that are in no pod here."""
        silence, others = self.silence(), self.elsewhere.setdefault(namespace, set())
        if all(seconds < LIVENESS_LEAST or uri in others for uri, seconds in silence.silent.values()):
            return []
        pods = self.cluster.pods(namespace)
        self.elsewhere[namespace] = in_no_pod(pods, silence)
        return hung_pods(pods, silence)

    def waits(self, namespace: str, one: Hung) -> str:
        """Why the pod is left as it is, in whole words; nothing where it is to be begun anew."""
        done = self._done(f"{namespace}/{one.app}")
        if len(done) >= AT_MOST:
            return left(one, f"it was begun anew {AT_MOST} times within {WITHIN / 60:.0f} min")
        return _works(one, open_goals_at(self.ros, one.pod))

    def begin_anew(self, namespace: str, one: Hung, at: str) -> str:
        """Evict it; what was done, or why it could not be. An Event of the pod says so, too.

        A goal that has come since `waits` keeps the pod, as one that was there before does.
        So does an answer of the node.
        """
        goals = open_goals_at(self.ros, one.pod)
        waiting = _works(one, goals) or self._answers(one)
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
        self.cluster.tell(namespace, one.pod, REASON, words, at)
        return f"{words}: its pod {name_of(one.pod)} is begun anew"

    def _answers(self, one: Hung) -> str:
        """A node that was silent in the last look of the keeper may be back."""
        try:
            node = self.ros.ask(self.ros.state(), Questions({one.node: frozenset()})).node(one.node)
        except RosError:
            return ""
        return f"node {one.node} answers again" if node.reachable else ""

    def _done(self, about: str) -> list[float]:
        """When the app was begun anew lately."""
        lately = [at for at in self.restarts.get(about, ()) if self.now() - at < WITHIN]
        self.restarts[about] = lately
        return lately


def left(one: Hung, why: object) -> str:
    return f"node {one.node} does not answer, and its pod is left as it is: {why}"


def _works(one: Hung, goals: Goals) -> str:
    """The goals that the pod is left for, if there are any."""
    patient = one.seconds < UNREADABLE * one.timeout
    found = [*goals.busy, *(goals.unknown if patient else ())]
    return left(one, ", ".join(found)) if found else ""
