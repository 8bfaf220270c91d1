# SPDX-License-Identifier: GPL-3.0-or-later
"""The whole fleet's input -> everything that is wrong with it, at once, before anything is touched."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Sequence
from types import MappingProxyType
from typing import NamedTuple

from .._model.finding import Problem
from .._model.fleet import Fleet
from .._model.topology import Groups, edge_ordered, fleet_topology, members
from .draft import Draft, Hosts, Inventory, Said
from .hosts import IMPLICIT_HOST, first_servers, host_problems, host_warnings
from .inventory import fleet_hosts, inventory_problems, near_misses
from .robot import fleet_app_problems, port_problems, robot_problems, robot_warnings
from .schema import of_host, value_problems

SHOWN = 4  # hosts of a line
_APP = re.compile(r"ros_apps\[(\d+)\]")


class Report(NamedTuple):
    """What was found, and the fleet if nothing is wrong; `hosts` are the variables that it was found in."""

    problems: list[Problem]
    warnings: list[Problem]
    fleet: Fleet | None
    hosts: Hosts


def check_fleet(groups: Groups, hosts: Hosts, given: Said = MappingProxyType({})) -> Report:
    """What is wrong with the groups of an inventory and with its hosts' variables, whatever else there is among these.

    `given` is what was given with `-e`.
    """
    names = [host for host in dict.fromkeys(itertools.chain(*groups.values())) if host != IMPLICIT_HOST]
    problems: list[Problem] = []
    ours = fleet_hosts(hosts, names, problems)
    groups = edge_ordered(groups, next(filter(None, first_servers(groups, ours).values()), ""))
    kind = of_host()
    wrong = {name: value_problems(said, kind, f"hosts.{name}") for name, said in ours.items()}
    modes = {robot: ours.get(robot, {}).get("robot_mode") or "agent" for robot in members(groups, "robots")}
    there = Inventory(groups, ours, {host: {one.path for one in found} for host, found in wrong.items()}, modes)
    drafts = [there.draft(robot) for robot in modes]
    problems += itertools.chain(
        host_problems(there), *wrong.values(), *(robot_problems(item, there) for item in drafts),
        fleet_app_problems(drafts), port_problems(drafts), inventory_problems(hosts, names, given),
    )  # fmt: skip
    warnings = [*(warning for item in drafts for warning in robot_warnings(item, not problems))]
    warnings += [*host_warnings(there), *near_misses(hosts, names)]
    fleet = None if problems else _fleet(there, drafts)
    return Report([*dict.fromkeys(problems)], [*dict.fromkeys(warnings)], fleet, ours)


def _fleet(there: Inventory, drafts: Iterable[Draft]) -> Fleet:
    nodes = {host: str(said["k3s_node_name"]) for host, said in there.hosts.items() if said.get("k3s_node_name")}
    topology = fleet_topology(there.groups, there.modes, nodes)
    edge = tuple(topology[host].node for host in members(there.groups, "edge"))
    name = next((str(own["fleet_name"]) for own in there.hosts.values() if own.get("fleet_name")), "")
    return Fleet({item.robot.name: item.robot for item in drafts}, topology, edge, name)


def lines(problems: Iterable[Problem], hosts: Hosts) -> list[str]:
    """Problems as people read them, each once for all of its hosts, as it is of the first; in order of appearance.

    `hosts` are the variables as they were written. A line is
    `hosts.robot1.ros_apps[2].placement: is 'cloud'; allowed: local or remote (app lidar; so on robot2, too)`.
    """
    found: dict[tuple[str, ...], list[tuple[str, Problem]]] = {}
    for problem in problems:
        # a host's name may have dots
        host = max((name for name in hosts if problem.path.startswith(f"hosts.{name}.")), key=len, default="")
        # whatever it says of another place of the same host it says of each
        same = [text.replace(f"hosts.{host}.", "") if host else text for text in problem]
        found.setdefault((_app(host, same[0], hosts), *same), []).append((host, problem))
    return [_line(app, group) for (app, *_same), group in found.items()]


def _line(app: str, group: Sequence[tuple[str, Problem]]) -> str:
    _first, *others = dict.fromkeys(host for host, _problem in group)
    more = f" and {len(others) - SHOWN} more" if len(others) > SHOWN else ""
    so = f"so on {', '.join(others[:SHOWN])}{more}, too" if others else ""
    beside = "; ".join(filter(None, (f"app {app}" if app else "", so)))
    return group[0][1].line() + (f" ({beside})" if beside else "")


def _app(host: str, inner: str, hosts: Hosts) -> str:
    match = _APP.match(inner)
    try:
        return str(hosts[host]["ros_apps"][int(match[1])]["name"] or "") if match else ""
    except (KeyError, TypeError):  # what is wrong with them is said elsewhere
        return ""
