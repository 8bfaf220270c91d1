# SPDX-License-Identifier: GPL-3.0-or-later
"""Who reaches a robot's pods: the NetworkPolicies of its namespace, and of the namespace `fleet`. Pure.

Within a robot everything is open, as ROS 1 takes any port. Other robots reach nothing. What pods send is not bounded.

What a host sends has an address of the host and is no pod's. That of the robot's own host may go anywhere (a look at
the graph over SSH, apps with host_network), that of the cluster's servers to the keeper's door (`_kube/door.py`). A
pod's own node reaches it in any case. Pods on the robot itself are let in by their network, too: whoever enforces this
learns a new one's address a moment after its process has begun, and what is refused then may not be tried again.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from ipaddress import ip_address, ip_network
from itertools import islice
from typing import Any
from urllib.parse import urlsplit

from ...module_utils._step.objects import Object
from .._model import context, names
from .._model.app import App
from .._model.context import Robot
from .app import app_deployment
from .belongings import owner_of
from .common import made, object_labels, owner_labels, pod_selector
from .namespace import needs_fleet_namespace
from .rights import NETWORK

KIND, API = "NetworkPolicy", f"{NETWORK}/v1"
SAME: Object = {"podSelector": {}}  # all of the policy's own namespace


@dataclass(frozen=True)
class Hosts:
    """Addresses of nodes and networks of their pods: the robot's own, servers, edge hosts, all of the cluster."""

    own: Sequence[str] = ()
    servers: Sequence[str] = ()
    edge: Sequence[str] = ()
    every: Sequence[str] = ()


UNKNOWN = Hosts()


def network_policies(robot: Robot, hosts: Hosts = UNKNOWN) -> list[Object]:
    """What a robot needs of them. Those of the fleet are the same from every robot, but for what it admits itself."""
    shared, labels = needs_fleet_namespace(robot), owner_labels(robot.name)
    # an external master calls the nodes that are registered with it
    admitted = [*robot.admits, *addresses([urlsplit(robot.master.uri).hostname or ""])]
    fleet = [_namespace(names.FLEET_NAMESPACE)] if shared else []
    at_edge = any(app.host_network and app.placement == "remote" for app in robot.apps)
    sources = [SAME, *fleet, *blocks([*hosts.own, *(_alone(hosts.edge) if at_edge else ()), *admitted])]
    found = [ingress_policy("robot", robot.namespace, labels, {}, [{"from": sources}])]
    if shared:
        sources = [SAME, _namespaces_of_robots("Exists"), *blocks(_alone(hosts.every))]
        found.append(ingress_policy("fleet", names.FLEET_NAMESPACE, owner_labels(None), {}, [{"from": sources}]))
    if shared and admitted:
        rules = [{"from": blocks(admitted)}]
        found.append(ingress_policy(robot.namespace, names.FLEET_NAMESPACE, labels, {}, rules))
    sources = [_namespace(names.OBSERVABILITY), *blocks(_alone(hosts.servers))]
    door: Object = {"from": sources, "ports": [tcp(names.KEEPER_PORT)]}
    labels = object_labels(names.KEEPER_NAME, context.master_owner(robot))
    selector = pod_selector(names.KEEPER_NAME)
    found.append(ingress_policy(names.KEEPER_NAME, context.master_namespace(robot), labels, selector, [door]))
    return [*found, *(one for app in robot.apps for one in _of_app(app, robot))]


def _of_app(app: App, robot: Robot) -> Iterator[Object]:
    """Its ports, by the names that each version has for its own ones, and those that show its metrics."""
    outside: list[Object] = []
    inside: list[Object] = []
    for port in app.ports:
        of_hosts = port.node_port or port.host_port
        (outside if of_hosts else inside).append({"port": port.name, "protocol": port.protocol})
    rules: list[Object] = [
        {"ports": outside},
        {"from": [_namespaces_of_robots("DoesNotExist")], "ports": inside},
        {"from": [_namespace(names.OBSERVABILITY)], "ports": [tcp(port) for port in _scraped(app, robot)]},
    ]
    rules = [rule for rule in rules if rule["ports"]]  # without a port it would be a rule for all ports
    if rules:
        labels = object_labels(app.name, owner_of(app, robot))
        name = f"{app.name}.ports"  # an app's name has no dot, so that no app is called as another policy
        yield ingress_policy(name, context.namespace_of(app, robot), labels, pod_selector(app.name), rules)


def _scraped(app: App, robot: Robot) -> list[int]:
    """Where its metrics are asked for, as `_observability/scrape.yml.j2` has it. Only overrides can say that."""
    if not app.overrides:
        return []
    template = app_deployment(app, robot)["spec"]["template"]
    notes = template["metadata"]["annotations"]
    if notes.get("prometheus.io/scrape") != "true":
        return []
    said = str(notes.get("prometheus.io/port", ""))
    ports = [port["containerPort"] for one in template["spec"]["containers"] for port in one.get("ports") or ()]
    return [int(said)] if said.isdecimal() else ports


# --- hosts ------------------------------------------------------------------------------------------------------------


def host_networks(node: Object) -> list[str]:
    """The node's addresses and its pods' networks, as far as it says what can be read."""
    told = (node.get("status") or {}).get("addresses") or ()
    own = (str(one.get("address")) for one in told if one.get("type") == "InternalIP")
    return [*addresses(own), *_networks((node.get("spec") or {}).get("podCIDRs") or ())]


def addresses(texts: Iterable[str]) -> list[str]:
    """Those that are addresses, each as a network."""
    return [*_networks(texts, ip_address)]


def _networks(texts: Iterable[str], parse: Callable[[str], Any] = str) -> Iterator[str]:
    """Those that can be parsed, each as a network."""
    for text in texts:
        with contextlib.suppress(ValueError):
            yield str(ip_network(parse(text)))


def _alone(networks: Iterable[str]) -> Iterator[str]:
    """Hosts without their pods, by whose networks hosts send, too: flannel's device has the first address, the bridge
    the second."""
    return _networks(str(one) for network in networks for one in islice(ip_network(network), 2))


# --- the parts of a policy --------------------------------------------------------------------------------------------


def ingress_policy(
    name: str, namespace: str, labels: dict[str, str], pods: dict[str, str], rules: Sequence[Object]
) -> Object:
    """Who reaches those pods of a namespace that have these labels; without labels, all of its pods."""
    selector = {"matchLabels": pods} if pods else {}
    spec = {"podSelector": selector, "policyTypes": ["Ingress"], "ingress": [*rules]}
    return made(API, KIND, name, namespace, labels, spec=spec)


def _namespace(name: str) -> Object:
    return {"namespaceSelector": {"matchLabels": {"kubernetes.io/metadata.name": name}}}


def _namespaces_of_robots(operator: str) -> Object:
    return {"namespaceSelector": {"matchExpressions": [{"key": names.LABEL_ROBOT, "operator": operator}]}}


def blocks(networks: Iterable[str]) -> list[Object]:
    return [{"ipBlock": {"cidr": one}} for one in dict.fromkeys(networks)]


def tcp(port: int) -> Object:
    return {"port": port, "protocol": "TCP"}
