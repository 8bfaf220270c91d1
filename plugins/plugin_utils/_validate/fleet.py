# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The whole fleet's input -> everything that is wrong with it, at once, before anything is touched."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from .._model.finding import Problem, join_path, shown, unique
from .._model.fleet import Fleet
from .._model.formats import FORMS
from .._model.topology import (
    EDGE_CLUSTER,
    edge_ordered,
    edge_servers,
    fleet_topology,
    members,
    mode_of,
    topology_problems,
)
from .._model.versions import Version, version
from .app import app_problems, app_warnings
from .draft import Draft, draft
from .explain import plain, value_problems
from .layers import layered
from .observability import observability_problems
from .refused import without_refused
from .robot import answer_warnings, fleet_app_problems, master_problems, port_problems, robot_problems, robot_warnings
from .said import Hosts, Inventory, Said
from .schema import of_host

IMPLICIT_HOST = "localhost"


class Report(NamedTuple):
    """What was found, and the fleet if nothing is wrong; `hosts` are the variables that it was found in."""

    problems: list[Problem]
    warnings: list[Problem]
    fleet: Fleet | None
    hosts: Hosts


def check_fleet(given: Any) -> Report:
    """`given` is `{groups: {edge: [..], robots: [..], k3s_server: [..]}, hosts: {name: {variable: value}}}`."""
    problems: list[Problem] = []
    if not isinstance(given, Mapping):
        return Report([Problem("fleet", f"is {shown(given)}", "a mapping with groups and hosts")], [], None, {})
    value = plain(given, "", problems)
    problems += _shape_problems(value)
    groups = _mapping(value, "groups")
    hosts = {
        name: _variables(item, join_path("hosts", name), problems) for name, item in _mapping(value, "hosts").items()
    }
    first = _first_servers(groups, hosts)
    problems += _first_server_problems(first)
    groups = edge_ordered(groups, next(filter(None, first.values()), ""))
    there = Inventory(groups, hosts, {robot: mode_of(robot, hosts) for robot in members(groups, "robots")})
    problems += topology_problems(groups, there.modes)
    kind = of_host()
    wrong = [problem for name in hosts for problem in value_problems(hosts[name], kind, f"hosts.{name}")]
    drafts = [draft(robot, hosts.get(robot, {}), wrong) for robot in there.modes]
    problems += itertools.chain(
        _name_problems(groups), _node_problems(hosts), _group_problems(there), wrong, _token_problems(there),
        _version_problems(there), _fleet_name_problems(hosts), observability_problems(there, wrong),
        *(_robot_problems(item, there) for item in drafts), fleet_app_problems(drafts), port_problems(drafts),
    )  # fmt: skip
    problems = unique(problems)
    warnings = [warning for item in drafts for warning in _robot_warnings(item, sound=not problems)]
    fleet = None if problems else _fleet(there, drafts)
    return Report(problems, unique(warnings), fleet, hosts)


def _robot_problems(item: Draft, there: Inventory) -> Iterator[Problem]:
    yield from robot_problems(item, len(members(there.groups, "edge")))
    for path, app, raw in item.apps():
        yield from (problem.below(path) for problem in app_problems(app, raw, item))
    yield from master_problems(item, there.variable(item.robot.name, "ros_master_uri") or "")


def _robot_warnings(item: Draft, sound: bool) -> Iterator[Problem]:
    """Some are worth a word only where the whole fleet is `sound`."""
    for path, app, raw in item.apps():
        yield from (warning.below(path) for warning in app_warnings(app, raw))
    yield from robot_warnings(item)
    yield from answer_warnings(item) if sound else ()


def _variables(said: Any, path: str, problems: list[Problem]) -> Said:
    return layered(without_refused(said, path, problems), path, problems) if isinstance(said, dict) else {}


def _mapping(value: Said, key: str) -> Said:
    item = value.get(key)
    return item if isinstance(item, dict) else {}


def _shape_problems(value: Said) -> Iterator[Problem]:
    for key in ("groups", "hosts"):
        if key not in value:
            yield Problem(key, "is missing", "a mapping")
        elif not isinstance(value[key], dict):
            yield Problem(key, f"is {shown(value[key])}", "a mapping")
    for key in sorted(set(value) - {"groups", "hosts"}):
        yield Problem(key, "is unknown", "groups and hosts")
    for name, item in _mapping(value, "hosts").items():
        if not isinstance(item, dict):
            yield Problem(f"hosts.{name}", f"is {shown(item)}", "a mapping of variables")


def _name_problems(groups: Said) -> Iterator[Problem]:
    """Names become Kubernetes nodes, labels and namespaces: lower case, and apart from each other there."""
    robots, taken = members(groups, "robots"), dict[str, str]()
    for form, hosts in (("robot-name", robots), ("dns-name", members(groups, "edge"))):
        for host in hosts:
            if not FORMS[form].test(host):
                group = "robots" if hosts is robots else "edge"
                yield Problem(f"groups.{group}.{host}", "is no name for a Kubernetes node", FORMS[form].allowed)
    for host in dict.fromkeys([*members(groups, "edge"), *robots]):
        key = host.lower().replace("_", "-")
        if key in taken:
            yield Problem(
                f"groups.{host}",
                f"clashes with {taken[key]} once both are Kubernetes names",
                "names that differ in more than case, - and _",
            )
        taken.setdefault(key, host)


def _node_problems(hosts: Hosts) -> Iterator[Problem]:
    """Two hosts of one node name would take each other's place in the cluster."""
    first: dict[str, str] = {}
    for host, own in hosts.items():
        node = str(own.get("k3s_node_name") or host)
        other = first.setdefault(node, host)
        if other != host:
            yield Problem(f"hosts.{host}.k3s_node_name", f"is {node} as that of {other}", "a name of its own")


def _group_problems(there: Inventory) -> Iterator[Problem]:
    """A host in no group of ours would silently be left out of the fleet."""
    placed = {*members(there.groups, "edge"), *members(there.groups, "robots")}
    for host in dict.fromkeys([*members(there.groups, "all"), *there.hosts]):
        if host not in placed and (host != IMPLICIT_HOST or there.hosts.get(host)):
            yield Problem(f"hosts.{host}", "is in neither of the groups edge and robots", "each host in one of them")


def _token_problems(there: Inventory) -> Iterator[Problem]:
    """Servers with different tokens form no cluster; nor do agents whose agent token nobody knows."""
    for name, sharers in (("k3s_token", edge_servers(there.groups)), ("k3s_agent_token", there.edge_cluster)):
        holders = [host for host in sharers if name in there.hosts.get(host, {})]
        for host in holders[1:]:
            if there.variable(host, name) != there.variable(holders[0], name):
                yield Problem(
                    f"hosts.{host}.{name}",
                    f"differs from the one of {holders[0]}",
                    f"one {name} for the cluster {EDGE_CLUSTER}, in the group_vars of its hosts",
                )


def _version_problems(there: Inventory) -> Iterator[Problem]:
    """A kubelet must not be newer than its API server. What an airgap directory holds is seen later."""

    def known(host: str) -> Version | None:
        airgap = there.variable(host, "k3s_install_source") == "airgap"
        return None if airgap else version(str(there.variable(host, "k3s_version") or ""))

    servers = {host: known(host) for host in edge_servers(there.groups)}
    for host in there.edge_cluster:
        own = None if host in servers else known(host)
        older = next((server for server, its in servers.items() if own and its and own.newer_than(its)), "")
        if older:
            says, its = (there.variable(one, "k3s_version") for one in (host, older))
            found = f"is {says}, newer than {its} of the server {older}"
            yield Problem(f"hosts.{host}.k3s_version", found, "servers that are as new as their agents, or newer")


def _first_servers(groups: Said, hosts: Hosts) -> dict[str, str]:
    """The first server by the word of each of them; mostly none says anything."""
    return {host: str(hosts.get(host, {}).get("k3s_first_server") or "") for host in edge_servers(groups)}


def _first_server_problems(said: Mapping[str, str]) -> Iterator[Problem]:
    allowed = f"the same for all servers: one of {', '.join(sorted(said))}, or nothing"
    for host, first in said.items():
        if first and (first not in said or set(said.values()) != {first}):
            yield Problem(f"hosts.{host}.k3s_first_server", f"is {first}", allowed)


def _fleet_name_problems(hosts: Hosts) -> Iterator[Problem]:
    """Every cluster carries it, so an inventory has one."""
    first = next(iter(hosts), "")
    for host, own in hosts.items():
        if own.get("fleet_name") != hosts[first].get("fleet_name"):
            yield Problem(
                f"hosts.{host}.fleet_name",
                f"differs from the one of {first}",
                "one fleet_name for all hosts, in the group_vars of all",
            )


def _fleet(there: Inventory, drafts: Sequence[Draft]) -> Fleet:
    robots = {item.robot.name: item.robot for item in drafts}
    nodes = {host: str(said["k3s_node_name"]) for host, said in there.hosts.items() if said.get("k3s_node_name")}
    topology = fleet_topology(there.groups, {name: robot.mode for name, robot in robots.items()}, nodes)
    name = next((str(own["fleet_name"]) for own in there.hosts.values() if own.get("fleet_name")), "")
    return Fleet(robots, topology, tuple(topology[host].node for host in members(there.groups, "edge")), name)
