# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The goals that a step's new nodes work on: they would go with them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Mapping

from .._common.errors import RosError
from .._ros.backend import Backend
from .._ros.graph import BUSY_STATES, GOAL_STATES, MasterState, Questions, action_names, action_of
from .way_back import Step, node_of


@dataclass(frozen=True)
class Goals:
    """What is under way, in words; what cannot be read; and who serves what, for a hold."""

    busy: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()
    servers: Mapping[str, str] | None = None  # action -> its server, where that is the new node alone


def open_goals(ros: Backend, step: Step) -> Goals:
    """Of the nodes that go if the step is taken back. A node whose address refuses connections works on nothing."""
    nodes = {node_of(member.deployment) for member in step.going_back} - {""}
    if not nodes:  # the master serves no actions
        return Goals()
    try:
        state = ros.state()
        served = _served(state, step, nodes)
        names = sorted({server for servers in served.values() for server in servers})
        graph = ros.ask(state, Questions({name: frozenset() for name in names}, (), tuple(served)))
    except RosError as error:
        return Goals(unknown=(str(error),))
    busy, unknown = [], []
    for action, servers in served.items():
        for server in servers:
            reading = graph.actions[action].statuses[server]
            states = [state for states in reading.readings for state in states if state in BUSY_STATES]
            if states:
                busy.append(f"{action} {GOAL_STATES[states[-1]]}")
            elif len(reading.readings) < 2 and not graph.nodes[server].refused:
                unknown.append(f"{action} of {server} ({reading.error or 'no second status'})")
    alone = {action: servers[0] for action, servers in served.items() if action_of(state, action).servers == servers}
    return Goals(tuple(busy), tuple(unknown), alone)


def _served(state: MasterState, step: Step, nodes: set[str]) -> dict[str, tuple[str, ...]]:
    """Action -> the new nodes that serve it. A launch file's nodes have names of their own: by its actions' names."""
    found = {
        name: servers
        for name in action_names(state)
        for servers in [tuple(one for one in action_of(state, name).servers if one in nodes)]
        if servers
    }
    there = state.nodes()
    for member in step.going_back:
        for name in member.contract.get("actions") or () if node_of(member.deployment) not in there else ():
            if name not in found and action_of(state, name).servers:
                found[name] = action_of(state, name).servers
    return found
