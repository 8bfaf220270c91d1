# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the server of an action is the one that will stay: its version is proven, or got ready."""

from __future__ import annotations

import time
from typing import Callable

from .._common.errors import KubeError
from .._step.objects import name_of, node_of, rolled_out
from .._step.record import PROVEN, mark_of
from .cluster_api import Cluster, read_records
from .way_back import member_of

PATIENCE = 10.0  # seconds for an API that does not answer


class Staying:
    """Where nobody can say so, nobody can take it back either."""

    def __init__(self, cluster: Cluster, now: Callable[[], float] = time.monotonic) -> None:
        self.cluster, self.now = cluster, now
        self.of: dict[tuple[str, str], tuple[str, str]] = {}  # action and node -> the Deployment
        self.silent: float | None = None  # since when the API does not answer

    def __call__(self, action: str, node: str) -> bool:
        try:
            found = self._may_go_back(action, node)
            self.silent = None
        except KubeError:
            self.silent = self.now() if self.silent is None else self.silent
            return self.now() - self.silent >= PATIENCE
        return not found

    def _may_go_back(self, action: str, node: str) -> bool:
        found = self.of.get((action, node)) or self._find(action, node)
        if found is None:
            return False
        self.of[action, node] = found
        deployment = self.cluster.deployment(*found)
        if deployment is None or mark_of(deployment) is None or rolled_out(deployment):
            return False
        records = read_records(self.cluster, found[0], [found[1]])
        return member_of(deployment, records).state != PROVEN

    def _find(self, action: str, node: str) -> tuple[str, str] | None:
        """The Deployment of that node; a launch file's is the unproven one that served the action before."""
        for namespace in self.cluster.namespaces():
            there = self.cluster.deployments(namespace)
            for item in there:
                if node_of(item) == node:
                    return namespace, name_of(item)
            for item in there:
                if mark_of(item) is not None:
                    records = read_records(self.cluster, namespace, [name_of(item)])
                    if action in member_of(item, records).actions:
                        return namespace, name_of(item)
        return None
