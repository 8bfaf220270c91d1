# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""That a host works after a change: by the change's own word, by the node and its Deployments, by the graphs."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError, NotReadyError
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.change import (
    Change,
    Limits,
    NodeCluster,
    Surroundings,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.hands import SLICE
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.ward import Ward

PAUSE = 1.0  # between two looks at what comes up


class Proof:
    """Of one change. That the API cannot be reached is weather here, for as long as `ready_timeout` says."""

    def __init__(self, change: Change, node: str, limits: Limits, world: Surroundings) -> None:
        self._change, self._node, self._limits = change, node, limits
        self._cluster, self._clock, self._say = world.cluster, world.clock, world.say
        self._before = ""  # the kubelet's last word before the change

    def begin(self) -> None:
        """Just before the change; KubeError."""
        if self._cluster is not None and self._node:
            self._before = self._cluster.beat(self._node)

    def given(self, wards: Sequence[Ward]) -> None:
        """Wait for it; NotReadyError says what was seen last."""
        self._change.works()
        end = self._clock.now() + self._limits.ready_timeout
        if self._cluster is not None and self._node:
            self._patiently(end, functools.partial(self._heard_anew, self._cluster))
            self._patiently(end, functools.partial(self._rolled_out, self._cluster, wards, end))
        for ward in wards:
            self._patiently(end, functools.partial(ward.as_recorded, self._limits.stable))

    def _heard_anew(self, cluster: NodeCluster) -> None:
        """The API's word on a node may be older than the change: only a kubelet that says something new is up."""
        if cluster.beat(self._node) == self._before:
            raise NotReadyError(f"node {self._node}: its kubelet has not been heard of since")

    def _rolled_out(self, cluster: NodeCluster, wards: Sequence[Ward], end: float) -> None:
        node = {"apiVersion": "v1", "kind": "Node", "metadata": {"name": self._node}}
        there = [item for ward in wards for item in ward.available()]
        cluster.wait([node, *there], max(end - self._clock.now(), 0.0))

    def _patiently(self, end: float, look: Callable[[], None]) -> None:
        """Again and again until it is well or the time is over; what was seen last is the error."""
        said = self._clock.now()
        while True:
            try:
                look()
            except (KubeError, NotReadyError) as error:
                if self._clock.now() >= end:
                    raise NotReadyError(str(error)) from error
                if self._clock.now() - said >= SLICE:
                    said = self._clock.now()
                    self._say(f"{self._change.name}: not yet proven: {error}")
                self._clock.sleep(PAUSE)
            else:
                return
