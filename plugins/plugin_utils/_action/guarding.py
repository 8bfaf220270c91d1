# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A guarded change of the host of an action's task: the engine with its real world around it."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._action import voice
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.base import FleetAction
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.clock import MonotonicClock
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.robot_host import RobotHost
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.node import NodeImages
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.fleet import VARIABLE, Fleet, robot_from_vars
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.change import Change, Limits, Surroundings
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.guarded import Guarded
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.host import ImageSource, ModuleHost
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.kube_nodes import KubeNodes


class Guarding:
    """Of the host whose variables are `known`; without a `cluster` nobody can be asked who works there."""

    def __init__(self, action: FleetAction, known: dict[str, Any], cluster: KubeNodes | None) -> None:
        self._action, self._known, self._cluster = action, known, cluster

    def robots(self, node: str, edge: bool = True) -> Sequence[Robot]:
        """Those that have to rest: the robot whose host it is; on an `edge` host those that have pods there."""
        if self._known["inventory_hostname"] in self._known[VARIABLE]["robots"]:
            return [robot_from_vars(self._known)]
        known = Fleet.from_vars(self._known).robots.values()
        return self._cluster.robots_on(node, known) if edge and self._cluster else []

    def change(self, change: Change, robots: Sequence[Robot], node: str, limits: Limits) -> Guarded:
        """What is to be run; `node` is the host's name in the cluster."""
        host, name = RobotHost(self._action, self._known), self._known["inventory_hostname"]
        modules = ModuleHost(
            host.there,
            lambda module, arguments: host.module(f"rosops.fleet.{module}", arguments),
            ImageSource(NodeImages(host)),
            limits.check,
        )
        say = self._action.say(self._known)
        world = Surroundings(modules, MonotonicClock(), self._cluster, say, functools.partial(voice.stand, name))
        return Guarded(change, robots, node, limits, world)
