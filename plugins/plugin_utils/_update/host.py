# SPDX-License-Identifier: GPL-3.0-or-later
"""The robot's own host, asked through modules that run there: pods' addresses are routable on the cluster's hosts."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ...module_utils._common.errors import RosError
from ...module_utils._common.poll import FAIL, PASS, WAIT
from ...module_utils._ros.graph import Graph
from ...module_utils._ros.graph_json import graph_data, graph_from
from .world import Calm, Object, Seen

INTERVAL = 0.2
RELEASE_SECONDS = 30.0  # for a keeper that a change of its host has just taken from the network


RunModule = Callable[[str, Object], Object]  # name and arguments to result; AwayError
Bring = Callable[[Sequence[str]], None]  # have these images on the node; NotReadyError, AwayError


class ModuleHost:
    """AwayError where the host cannot be reached.

    `there` is an answer of the host, `run` executes a module of this collection; both raise that.
    """

    def __init__(self, there: Callable[[], None], run: RunModule, bring: Bring) -> None:
        self.there, self.bring, self._run = there, bring, run

    def graph(self, master: str, rate_seconds: float = 0.0, nodes: Sequence[str] = ()) -> Graph:
        """The whole graph, with the rates at which these nodes publish; RosError where the master does not answer."""
        asked: Object = {"md5sums": True, "service_connections": True}
        if nodes:
            asked = {"rates": True, "rate_seconds": rate_seconds, "rate_nodes": list(nodes)}
        return graph_from(_well(self._run("ros_graph_info", {"master_uri": master, **asked}))["graph"])

    def hold(self, master: str, keeper: str, calm: Calm, seconds: float, timeout: float) -> Seen:
        """Wait until the robot is calm; then hold new goals of the actions with a `server`, for `seconds` at most.

        With none, or without a keeper, nothing is held, and one look that finds it so is enough.
        """
        at = {"keeper_uri": keeper} if keeper else {}
        values = {"values": list(calm.when)} if calm.when else {}
        asked = {"actions": list(calm.actions), **values, "seconds": seconds, "timeout": timeout, "interval": INTERVAL}
        found = self._job("ros_hold", {"master_uri": master, **at, **asked})
        return Seen(_verdict(found), str(found.get("reason") or found.get("msg") or ""))

    def release(self, keeper: str, actions: Sequence[Object]) -> None:
        """Let the held goals go."""
        if keeper:
            asked = {"actions": [one["name"] for one in actions], "timeout": RELEASE_SECONDS, "interval": INTERVAL}
            _well(self._job("ros_release", {"keeper_uri": keeper, **asked}))

    def ready(self, master: str, conditions: Object, timeout: float, stable: float = 0.0) -> Seen:
        """Wait until the conditions (options of ros_ready) hold, for `stable` seconds without a break."""
        asked = {"timeout": timeout, "stable": stable, "interval": INTERVAL}
        found = self._run("ros_ready", {"master_uri": master, **conditions, **asked})
        return Seen(_verdict(found), str(found.get("msg") or ""))

    def register(self, master: str, graph: Graph, nodes: Sequence[str] = ()) -> None:
        """Register these nodes (all without names) with the master as the graph shows them."""
        asked = {"master_uri": master, "graph": graph_data(graph), "nodes": list(nodes)}
        _well(self._job("ros_register", asked))

    def reap(self, master: str, nodes: Sequence[str]) -> None:
        """Take away what dead nodes of these names left."""
        _well(self._job("ros_reap", {"master_uri": master, "nodes": list(nodes)}))

    def _job(self, name: str, arguments: Object) -> Object:
        """Done by the module that is private."""
        return self._run("_host", {"job": name, "arguments": arguments})


def _well(result: Object) -> Object:
    if result.get("failed"):
        raise RosError(str(result.get("msg") or "the host's module failed without a word"))
    return result


def _verdict(result: Object) -> str:
    """A module that broke off without a verdict can tell nothing, whatever it was asked."""
    found = result.get("verdict")
    return str(found) if found in (PASS, WAIT, FAIL) else FAIL
