# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A look at the fleet, first at its clusters, then at its graphs -> how it stands. Pure.

Of reports there may be none, several (one per playbook or kept by hand), and spoilt ones; each host's newest run
counts, be it of a report or kept by the host's cluster.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from .._model.keys import plain, read
from . import held, host_run, ros_graph
from .host_run import HostRun
from .ros_graph import Graphs
from .rows import Status, Trouble


@dataclass(frozen=True)
class Asked:
    """Whose graph a robot reads, at which master, and the addresses of the pods that may be in it."""

    robot: str
    master_uri: str = ""
    addresses: tuple[str, ...] = ()


@dataclass(frozen=True)
class Look:
    """What the clusters said: sections of the status, which robots are to read which graphs, and the last runs."""

    status: Status
    graphs: Mapping[str, Asked] = field(default_factory=dict)
    promised: ros_graph.Promises = field(default_factory=dict)
    runs: tuple[HostRun, ...] = ()
    name: str = ""

    def as_dict(self) -> dict[str, Any]:
        """For the tasks between: the sections beside the rest."""
        runs = [run.as_dict() for run in self.runs]
        more = {"graphs": plain(self.graphs), "promised": plain(self.promised), "name": self.name, "runs": runs}
        return {**plain(self.status), **more}

    @classmethod
    def from_dict(cls, told: Mapping[str, Any]) -> Look:
        """What `as_dict` made of it."""
        runs = tuple(map(HostRun.from_dict, told.get("runs") or ()))
        return replace(read(cls, {**told, "status": told, "runs": ()}), runs=runs)


def status_of(look: Look, graphs: Graphs, reports: Mapping[str, str], more: Iterable[Trouble] = ()) -> Status:
    """All sections, with the ROS graphs by robot, the texts of reports by file name, and more problems.

    Nothing is promised by apps that are not there yet.
    """
    seen = look.status
    there = {(row.robot, row.name) for row in seen.workloads}
    kept = {
        graph: {topic: one for topic, one in topics.items() if (one.robot, one.app) in there}
        for graph, topics in look.promised.items()
    }
    crashes, ended = ros_graph.launched_rows(seen.apps, graphs)
    found, unreadable = host_run.read_reports(reports)
    runs = [*found, *look.runs]
    return replace(
        seen,
        problems=(*seen.problems, *more, *held.ending_rows(seen.workloads), *crashes, *unreadable),
        ended=tuple(ended),
        ros_nodes=tuple(ros_graph.node_rows(graphs, ros_graph.Places(seen.workloads, seen.nodes))),
        topics=tuple(ros_graph.topic_rows(graphs, kept)),
        links=tuple(ros_graph.links(graphs)),
        outcomes=tuple(host_run.outcome_rows(runs)),
        steps=tuple(host_run.step_rows(runs)),
    )
