# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot itself, beside its cluster: its ROS graph, asked of its keeper or on its host, and its images."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ...module_utils._common.errors import KubeError, RosError
from ...module_utils._common.poll import FAIL, PASS, WAIT
from ...module_utils._ros.graph import Graph
from ...module_utils._ros.graph_json import graph_data, graph_from
from .._kube.door import KeeperDoor
from .world import Calm, Object, Seen

INTERVAL = 0.2
RELEASE_SECONDS = 30.0  # for a keeper that a change of its host has just taken from the network


Job = Callable[[str, Object], Object]  # of `module_utils/_ros/jobs.py`: its name and arguments to its result
Bring = Callable[[Sequence[str]], None]  # have these images on the node; NotReadyError, AwayError


class RobotSide:
    """AwayError where the robot cannot be reached. `there` is an answer of its host, `job` has a job done there."""

    def __init__(self, there: Callable[[], None], job: Job, bring: Bring) -> None:
        self.there, self.bring, self._job = there, bring, job

    def by(self, door: KeeperDoor, trace: Callable[[str], None]) -> RobotSide:
        """The same robot, of which the keeper is asked first, and the host where the keeper does not answer.

        That costs the robot no interpreter, and the run no connection to it.
        """

        def there() -> None:
            try:
                door.there()
            except KubeError:
                self.there()

        def job(name: str, arguments: Object) -> Object:
            try:
                return door.job(name, arguments)
            except KubeError as error:
                trace(f"{name} on its host: {error}")
                return self._job(name, arguments)

        return RobotSide(there, job, self.bring)

    def graph(self, master: str, rate_seconds: float = 0.0, nodes: Sequence[str] = ()) -> Graph:
        """The whole graph, with the rates at which these nodes publish; RosError where the master does not answer."""
        asked: Object = {"md5sums": True}
        if nodes:
            asked = {"rates": True, "rate_seconds": rate_seconds, "rate_nodes": list(nodes)}
        return graph_from(_well(self._job("graph", {"master_uri": master, **asked}))["graph"])

    def hold(self, master: str, keeper: str, calm: Calm, seconds: float, timeout: float) -> Seen:
        """Wait until the robot is calm; then hold new goals of the actions with a `server`, for `seconds` at most.

        With none, or without a keeper, nothing is held, and one look that finds it so is enough.
        """
        at = {"keeper_uri": keeper} if keeper else {}
        values = {"values": list(calm.when)} if calm.when else {}
        asked = {"actions": list(calm.actions), **values, "seconds": seconds, "timeout": timeout, "interval": INTERVAL}
        return _seen(self._job("hold", {"master_uri": master, **at, **asked}))

    def release(self, keeper: str, actions: Sequence[Object]) -> None:
        """Let the held goals go."""
        if keeper:
            asked = {"actions": [one["name"] for one in actions], "timeout": RELEASE_SECONDS, "interval": INTERVAL}
            _well(self._job("release", {"keeper_uri": keeper, **asked}))

    def ready(self, master: str, conditions: Object, timeout: float, stable: float = 0.0) -> Seen:
        """Wait until the conditions (options of ros_ready) hold, for `stable` seconds without a break."""
        asked = {"timeout": timeout, "stable": stable, "interval": INTERVAL}
        return _seen(self._job("ready", {"master_uri": master, **conditions, **asked}))

    def register(self, master: str, graph: Graph, nodes: Sequence[str] = ()) -> None:
        """Register these nodes (all without names) with the master as the graph shows them."""
        asked = {"master_uri": master, "graph": graph_data(graph), "nodes": list(nodes)}
        _well(self._job("register", asked))

    def reap(self, master: str, nodes: Sequence[str], hosts: Sequence[str]) -> None:
        """Take away what dead nodes of these names left; `hosts` are addresses of pods that have gone."""
        _well(self._job("reap", {"master_uri": master, "nodes": list(nodes), "hosts": list(hosts)}))


def _well(result: Object) -> Object:
    if result.get("failed"):
        raise RosError(str(result.get("msg") or "the robot's answer is a failure without a word"))
    return result


def _seen(result: Object) -> Seen:
    """A job that broke off without a verdict can tell nothing, whatever it was asked."""
    verdict = result.get("verdict")
    reason = str(result.get("reason") or result.get("msg") or "")
    return Seen(str(verdict) if verdict in (PASS, WAIT, FAIL) else FAIL, reason)
