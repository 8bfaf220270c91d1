# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""For how long each node has not answered, from look to look: one late answer takes nobody out of the graph.

Startup probe and gate both look through it, so that a peer counts as gone for both after the same time.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Callable

from .graph import Graph


class Silence:
    """Since when each node has been silent. Any answer ends that, and so does a look that had nothing to ask of it."""

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self.now = now
        self.since: dict[str, float] = {}

    def noted(self, graph: Graph, began: float) -> Graph:
        """The graph, of which each node knows for how long it has been silent. `began`: when they were asked."""
        silent = [node for node in graph.nodes.values() if node.asked and not node.reachable]
        self.since = {node.name: self.since.get(node.name, began) for node in silent}
        ended = self.now()
        nodes = {node.key: replace(node, silent=ended - self.since[node.name]) for node in silent}
        return replace(graph, nodes={**graph.nodes, **nodes}) if nodes else graph
