# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What gate, probes and reports ask of a ROS system: the interface that each kind of ROS has a client for.

`client.Ros1Client` is the one for ROS 1. Whoever asks knows the answers (`graph`) and nothing of how they came.
"""

from __future__ import annotations

from typing import Iterable, Mapping, Protocol

from .graph import Graph, Handshake, MasterState, Questions, Rate


class Backend(Protocol):
    """One ROS graph. It is read only; RosError where the graph as a whole cannot be asked."""

    uri: str  # where it is asked, for messages

    def state(self, types: bool = False) -> MasterState:
        """Who has registered what; topics' types only where they are wanted."""

    def ask(self, state: MasterState, wanted: Questions) -> Graph:
        """The graph with what the peers themselves say; one that does not answer stands in it with the reason."""

    def handshakes(self, graph: Graph, topics: Iterable[str]) -> dict[str, Handshake]:
        """Topic -> what a publisher of it says; none, no entry."""

    def rates(self, graph: Graph, seconds: Mapping[str, float], patient: bool = False) -> dict[str, Rate]:
        """Count the messages of topics, all at the same time, each for its number of seconds.

        Those of the publishers that the topics have in this graph (`Graph.published_by`). If `patient`, slow topics are
        counted for longer, some seconds at most, for as long as that may still make their rate known.
        """
