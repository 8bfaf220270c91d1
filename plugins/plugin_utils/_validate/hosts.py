# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks between hosts, of what they are to their clusters, and of the archives that they get their images from."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence

from .._model.finding import Problem, each, taken
from .._model.fleet import Fleet
from .._model.formats import FORMS, quantity_value
from .._model.machines import Version, version
from .._model.role_specs import role_options
from .._model.topology import EDGE_CLUSTER, Groups, edge_servers, members
from .._objects.parts import images
from .._observability.spec import HUB, ROBOT
from .draft import Hosts, Inventory, Said

IMPLICIT_HOST = "localhost"
SERVER_COUNTS = (1, 3)
PORTS = ("observability_grafana_node_port", "observability_hub_metrics_port", "observability_hub_logs_port")
LEAST_STORE = "600Mi"  # vmagent takes no less than 500 MB for its queue
SLOWEST_SCRAPE = 20  # seconds, that rules/recording.yml counts on
DAY = 86400
_SECONDS = {"ms": 0.001, "s": 1, "m": 60, "h": 3600, "d": DAY, "w": 7 * DAY, "y": 365 * DAY}

# What archives hold in the place of an image; nothing where one has it, or nobody can see.
Instead = Callable[[Sequence[Said], str], Sequence[str]]


def host_problems(there: Inventory) -> Iterator[Problem]:
    """Everything that keeps hosts from making a fleet together."""
    for check in (_groups, _names, _agreement, _versions):
        yield from check(there)
    for path, given, alone in _watched(there):
        yield from _observability(path, given, alone)


def host_warnings(there: Inventory) -> Iterator[Problem]:
    """What is open of the clusters that are watched."""
    for path, given, _alone in _watched(there):
        interval = str((given["observability"].get("prometheus") or {}).get("scrape_interval") or "")
        if seconds(interval) > SLOWEST_SCRAPE:
            told = f"is {interval}: the alerts RosTopicRateDrop and RosTopicSilent never come"
            yield Problem(f"{path}.observability.prometheus.scrape_interval", told, f"at most {SLOWEST_SCRAPE}s")
        profile, place = given.get("observability_profile"), f"{path}.observability_tls_secret_name"
        if given.get("observability_tls_secret_name"):
            continue
        if profile == HUB and given.get("observability_allowed_networks"):
            told = "whoever is in observability_allowed_networks reads and writes at the hub, and nothing is encrypted"
            yield Problem(place, f"is empty: {told}; docs/observability.md, Certificates, has how to close it")
        if profile == ROBOT and _https(given):
            yield Problem(place, "is empty: the hub is shown no certificate, and has to have one of a public authority")


def _watched(there: Inventory) -> Iterator[tuple[str, Said, bool]]:
    """Of each cluster with the stack the host that carries its variables: its path, what is sound of them, and whether
    it is a robot alone."""
    alone = [robot for robot, mode in there.modes.items() if mode == "standalone"]
    for host in [*edge_servers(there.groups)[:1], *alone]:
        given = {name: value for name, value in there.hosts.get(host, {}).items() if there.sound(host, name)}
        if (given.get("observability") or {}).get("enabled"):
            yield f"hosts.{host}", given, host in alone


def _https(given: Said) -> bool:
    return str(given.get("observability_hub_url")).startswith("https://")


def _groups(there: Inventory) -> Iterator[Problem]:
    edge, robots = members(there.groups, "edge"), members(there.groups, "robots")
    if not edge and not robots:
        yield Problem("groups", "has no host in edge or robots", "hosts in the groups edge and robots")
    for host in robots:
        if host in edge:
            yield Problem(f"groups.robots.{host}", "is in edge too", "a host in edge or in robots, not in both")
        if host == EDGE_CLUSTER:
            yield Problem(f"groups.robots.{host}", "is the name of the shared cluster", "any other name")
    agents = [robot for robot in robots if there.modes[robot] == "agent"]
    if agents and not edge:
        found = f"is empty, but {', '.join(agents)} must join its cluster"
        yield Problem("groups.edge", found, "a host in edge, or robot_mode: standalone")
    # it would silently be left out of the fleet
    for host in [host for host in there.hosts if host not in (*edge, *robots)]:
        yield Problem(f"hosts.{host}", "is in neither of the groups edge and robots", "each host in one of them")
    named, servers = members(there.groups, "k3s_server"), edge_servers(there.groups)
    for host in [host for host in named if host not in edge]:
        yield Problem(f"groups.k3s_server.{host}", "is not in edge", "hosts of the group edge")
    # embedded etcd keeps its majority with an odd number of members; two are worse than one
    if servers and len(servers) not in SERVER_COUNTS:
        where = "groups.k3s_server" if named else "groups.edge"
        hint = "" if named else " (name them in the group k3s_server; the other edge hosts join as agents)"
        yield Problem(where, f"gives the cluster {len(servers)} servers", f"1 or 3 servers{hint}")


def _names(there: Inventory) -> Iterator[Problem]:
    """Names become Kubernetes nodes, labels and namespaces: lower case, and apart from each other there."""
    for group, form in (("robots", FORMS["robot-name"]), ("edge", FORMS["dns-name"])):
        for host in members(there.groups, group):
            if not form.test(host):
                yield Problem(f"groups.{group}.{host}", "is no name for a Kubernetes node", form.allowed)
            if host == IMPLICIT_HOST:  # whose variables are not looked at
                yield Problem(f"groups.{group}.{host}", "is the name of the control node", "any other name")
    names = dict.fromkeys([*members(there.groups, "edge"), *members(there.groups, "robots")])
    for host, _name, other in taken((name, name.lower().replace("_", "-")) for name in names):
        found = f"clashes with {other} once both are Kubernetes names"
        yield Problem(f"groups.{host}", found, "names that differ in more than case, - and _")
    # two hosts of one node name would take each other's place in the cluster
    for host, node, other in taken((host, str(own.get("k3s_node_name") or host)) for host, own in there.hosts.items()):
        yield Problem(f"hosts.{host}.k3s_node_name", f"is {node} as that of {other}", "a name of its own")


def _agreement(there: Inventory) -> Iterator[Problem]:
    """Servers with different tokens form no cluster; nor do agents whose agent token nobody knows.

    Every cluster carries the fleet's name, so an inventory has one.
    """
    of_cluster = f"for the cluster {EDGE_CLUSTER}, in the group_vars of its hosts"
    for name, sharers, allowed in (
        ("k3s_token", edge_servers(there.groups), of_cluster),
        ("k3s_agent_token", there.edge_cluster, of_cluster),
        ("fleet_name", there.hosts, "for all hosts, in the group_vars of all"),
    ):
        # a host that says nothing has the token from elsewhere; a name that it does not say is another name
        saying = [host for host in sharers if name == "fleet_name" or name in there.hosts.get(host, {})]
        for host in saying[1:]:
            if there.variable(host, name) != there.variable(saying[0], name):
                yield Problem(f"hosts.{host}.{name}", f"differs from the one of {saying[0]}", f"one {name} {allowed}")
    said = first_servers(there.groups, there.hosts)
    allowed = f"the same for all servers: one of {', '.join(sorted(said))}, or nothing"
    for host, first in said.items():
        if first and (first not in said or set(said.values()) != {first}):
            yield Problem(f"hosts.{host}.k3s_first_server", f"is {first}", allowed)


def _versions(there: Inventory) -> Iterator[Problem]:
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


def first_servers(groups: Groups, hosts: Hosts) -> dict[str, str]:
    """The first server by the word of each of them; mostly none says anything."""
    return {host: str(hosts.get(host, {}).get("k3s_first_server") or "") for host in edge_servers(groups)}


def _observability(path: str, given: Said, alone: bool) -> Iterator[Problem]:
    """Of the cluster of the host that carries its variables; what is malformed was reported as such."""
    if given.get("observability_profile") == ROBOT:
        if not alone:
            allowed = "standalone or hub; robot is for a robot with robot_mode: standalone"
            yield Problem(f"{path}.observability_profile", "is 'robot' for a cluster of several hosts", allowed)
        elif not given.get("observability_hub_url"):
            yield Problem(f"{path}.observability_hub_url", "is missing", "the hub's address, such as http://192.0.2.10")
        elif given.get("observability_tls_secret_name") and not _https(given):
            found = "is http, although observability_tls_secret_name is set"
            yield Problem(f"{path}.observability_hub_url", found, "https: a hub with certificates speaks nothing else")
    if given.get("observability_profile") == HUB and not given.get("observability_allowed_networks"):
        wanted = "the robots' networks: a hub takes what these send, and asks for no password (0.0.0.0/0: everybody's)"
        yield Problem(f"{path}.observability_allowed_networks", "is empty", wanted)
    store = quantity_value(str(given.get("observability_store_size", LEAST_STORE)))
    if store is not None and store < (quantity_value(LEAST_STORE) or 0):
        yield Problem(f"{path}.observability_store_size", "is too small for a queue", f"{LEAST_STORE} or more")
    retention = (given["observability"].get("loki") or {}).get("retention", "24h")
    if seconds(retention) < DAY:
        where = f"{path}.observability.loki.retention"
        yield Problem(where, f"is '{retention}'", "24h or more: Loki keeps its index by the day")
    defaults = role_options("observability")
    for name, port, other in taken((name, str(given.get(name, defaults[name]["default"]))) for name in PORTS):
        yield Problem(f"{path}.{name}", f"is {port} as {other}", "a port of its own")


def seconds(duration: str) -> float:
    """A duration as Prometheus writes it.

    >>> seconds("1d12h")
    129600.0
    """
    parts = re.findall(r"([0-9]+)(ms|[smhdwy])", duration)
    return float(sum(int(number) * _SECONDS[unit] for number, unit in parts))


def archive_problems(hosts: Hosts, unusable: Callable[[str], str]) -> Iterator[Problem]:
    """Archives of which it is seen here that no node can take them."""
    for host, variables in hosts.items():
        for where, item in each(f"hosts.{host}.images_archives", _archives(variables), ".path"):
            if wrong := unusable(item["path"]):
                yield Problem(where, wrong)


def image_warnings(fleet: Fleet, hosts: Hosts, instead: Instead) -> Iterator[Problem]:
    """Images that hosts with archives will pull all the same, though nobody says so in `images_refs`."""
    remote = sorted({image for robot in fleet.robots.values() for image in images(robot, "remote")})
    for host, variables in hosts.items():
        archives, meant = _archives(variables), variables.get("images_refs") or ()
        wanted = images(fleet.robots[host], "local") if host in fleet.robots else remote
        for image in wanted if archives else ():
            if image not in meant and (held := instead(archives, image)):
                told = f"none of them has {image}, so the node will pull it (images_refs says that this is meant)"
                yield Problem(f"hosts.{host}.images_archives", f"{told}; they hold {', '.join(held)}")


def _archives(variables: Said) -> list[Said]:
    """The items of `images_archives` that have a path; others may be wrong."""
    given = variables.get("images_archives")
    items = given if isinstance(given, list) else []
    return [item for item in items if isinstance(item, Mapping) and isinstance(item.get("path"), str)]
