# SPDX-License-Identifier: GPL-3.0-or-later
"""Who reaches what, by the rules of NetworkPolicies (kubernetes.io, "Network Policies"), evaluated here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from ipaddress import ip_address, ip_network
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import Object
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.master import master_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.namespace import namespace_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.network import (
    Hosts,
    host_networks,
    network_policies,
)
from ansible_collections.rosops.fleet.tests.unit.robots import robot

MASTER, KEEPER, TCPROS = 11311, 11411, 40123
HOST1, HOST2, SERVER, LAPTOP, ANYBODY = "192.0.2.11", "192.0.2.12", "192.0.2.1", "198.51.100.7", "203.0.113.9"
# flannel's device, the bridge, and a pod of which nothing is known yet
OVERLAY0, BRIDGE0, NEW0 = (f"10.42.0.{number}" for number in (0, 1, 77))
OVERLAY1, NEW1, OVERLAY2 = "10.42.1.0", "10.42.1.77", "10.42.2.0"
EDGE, OF1, OF2 = ([f"{host}/32", f"10.42.{number}.0/24"] for number, host in enumerate((SERVER, HOST1, HOST2)))
EVERY = [*EDGE, *OF1, *OF2]
HOSTS = {"robot1": Hosts(OF1, EDGE, EDGE, EVERY), "robot2": Hosts(OF2, EDGE, EDGE, EVERY)}


def app(name: str, **more: Any) -> dict[str, Any]:
    return {"name": name, "image": "example.org/a:1", "args": ["x"], **more}


def scraped(port: str = "") -> dict[str, Any]:
    notes = {"prometheus.io/scrape": "true", **({"prometheus.io/port": port} if port else {})}
    return {"spec": {"template": {"metadata": {"annotations": notes}}}}


APPS = (
    app("talker"),
    app("bridge", ports=[{"name": "web", "port": 9090, "node_port": 30090}, {"name": "api", "port": 9091}]),
    app("driver", placement="local", ports=[{"name": "data", "port": 2368, "protocol": "UDP", "host_port": 2368}]),
    app("counter", overrides=scraped("9400")),
    app("shown", ports=[{"name": "metrics", "port": 9500}], overrides=scraped()),
)


@dataclass(frozen=True)
class Pod:
    namespace: str
    labels: Mapping[str, str]
    ports: Mapping[str, int]  # those that have names


class Cluster:
    def __init__(self, *robots: Robot, hosts: Mapping[str, Hosts] = HOSTS) -> None:
        self.policies = [one for made in robots for one in network_policies(made, hosts[made.name])]
        spaces = [one for made in robots for one in namespace_objects(made) if one["kind"] == "Namespace"]
        self.spaces = {one["metadata"]["name"]: dict(one["metadata"]["labels"]) for one in spaces}
        self.spaces |= {name: {} for name in ("observability", "shop")}  # which are no robot's
        for name, labels in self.spaces.items():
            labels["kubernetes.io/metadata.name"] = name
        self.pods: dict[str, Pod] = {}
        for made in robots:
            for one in [*master_objects(made), *app_objects(made)]:
                if one["kind"] == "Deployment":
                    self.pods[f"{one['metadata']['namespace']}/{one['metadata']['name']}"] = pod_of(one)

    def passes(self, sender: str, target: str, port: int, protocol: str = "TCP") -> bool:
        """From a pod by `namespace/name`, or from an address that is no pod's."""
        pod = self.pods[target]
        chosen = [
            one["spec"]
            for one in self.policies
            if one["metadata"]["namespace"] == pod.namespace and chooses(one["spec"]["podSelector"], pod.labels)
        ]
        rules = [rule for spec in chosen for rule in spec["ingress"]]
        return not chosen or any(
            self.is_source(rule.get("from"), sender, pod.namespace) and is_port(rule.get("ports"), pod, port, protocol)
            for rule in rules
        )

    def is_source(self, sources: Sequence[Object] | None, sender: str, own: str) -> bool:
        if not sources:  # an empty list, too, is everybody
            return True
        if "/" not in sender:
            blocks = [ip_network(one["ipBlock"]["cidr"]) for one in sources if "ipBlock" in one]
            return any(ip_address(sender) in block for block in blocks)
        space, _slash, name = sender.partition("/")
        labels = self.pods[sender].labels if sender in self.pods else {"app": name}
        peers = [one for one in sources if "ipBlock" not in one]
        return any(
            (chooses(one["namespaceSelector"], self.spaces[space]) if "namespaceSelector" in one else space == own)
            and chooses(one.get("podSelector", {}), labels)
            for one in peers
        )


def pod_of(deployment: Object) -> Pod:
    template = deployment["spec"]["template"]
    ports = [port for one in template["spec"]["containers"] for port in one.get("ports") or ()]
    named = {port["name"]: port["containerPort"] for port in ports}
    return Pod(deployment["metadata"]["namespace"], template["metadata"]["labels"], named)


def chooses(selector: Object, labels: Mapping[str, str]) -> bool:
    assert {*selector} <= {"matchLabels", "matchExpressions"}
    said = all(labels.get(key) == value for key, value in selector.get("matchLabels", {}).items())
    for one in selector.get("matchExpressions", ()):
        said = said and (one["key"] in labels) is {"Exists": True, "DoesNotExist": False}[one["operator"]]
    return said


def is_port(ports: Sequence[Object] | None, pod: Pod, port: int, protocol: str) -> bool:
    if not ports:
        return True
    return any(pod.ports.get(one["port"], one["port"]) == port and one["protocol"] == protocol for one in ports)


OWN = Cluster(robot(*APPS), robot(app("talker"), name="robot2"))
LISTED = Cluster(robot(*APPS, admits=["198.51.100.0/24"]), robot(app("talker"), name="robot2"))


@pytest.mark.parametrize(
    ("sender", "target", "port", "passes"),
    [
        # another robot's pod: nothing
        ("robot-robot2/talker", "ros-master", MASTER, False),
        ("robot-robot2/talker", "ros-keeper", KEEPER, False),
        ("robot-robot2/talker", "bridge", 9091, False),
        # the robot's own: everything
        ("robot-robot1/talker", "ros-master", MASTER, True),
        ("robot-robot1/talker", "ros-keeper", KEEPER, True),
        # what watches the cluster: metrics alone
        ("observability/prometheus", "ros-keeper", KEEPER, True),
        ("observability/prometheus", "counter", 9400, True),
        ("observability/prometheus", "shown", 9500, True),
        ("observability/prometheus", "counter", TCPROS, False),
        ("observability/prometheus", "talker", 9400, False),
        # the user's other namespaces: ports that have a Service
        ("shop/till", "bridge", 9091, True),
        ("shop/till", "bridge", TCPROS, False),
        ("shop/till", "counter", 9400, False),
        ("shop/till", "ros-keeper", KEEPER, False),
        # ports of hosts: from everywhere, as they are asked for by name
        (ANYBODY, "bridge", 9090, True),
        ("robot-robot2/talker", "bridge", 9090, True),
        (ANYBODY, "bridge", 9091, False),
        # hosts: a server at the door, the robot's own everywhere, another robot's nowhere
        (SERVER, "ros-keeper", KEEPER, True),
        (OVERLAY0, "ros-keeper", KEEPER, True),
        (BRIDGE0, "ros-keeper", KEEPER, True),
        (NEW0, "ros-keeper", KEEPER, False),
        (SERVER, "ros-master", MASTER, False),
        (OVERLAY0, "talker", TCPROS, False),
        (HOST1, "ros-master", MASTER, True),
        (OVERLAY1, "talker", TCPROS, True),
        (NEW1, "talker", TCPROS, True),
        (OVERLAY2, "talker", TCPROS, False),
        (HOST2, "ros-master", MASTER, False),
        (HOST2, "ros-keeper", KEEPER, False),
    ],
)
def test_who_reaches_a_robot(sender: str, target: str, port: int, passes: bool) -> None:
    assert OWN.passes(sender, f"robot-robot1/{target}", port) is passes


@pytest.mark.parametrize(("target", "port"), [("ros-master", MASTER), ("ros-keeper", KEEPER), ("talker", TCPROS)])
def test_a_network_that_is_listed_reaches_everything(target: str, port: int) -> None:
    assert LISTED.passes(LAPTOP, f"robot-robot1/{target}", port)
    assert not LISTED.passes(LAPTOP, f"robot-robot2/{target}", port)
    assert not LISTED.passes(ANYBODY, f"robot-robot1/{target}", port)


@pytest.mark.parametrize(("placement", "passes"), [("remote", True), ("local", False)])
def test_an_app_on_an_edge_host_s_network_reaches_its_robot(placement: str, passes: bool) -> None:
    """By the host's addresses, and pods of that host do not."""
    cluster = Cluster(robot(app("talker"), app("planner", host_network=True, placement=placement)))
    for address in (SERVER, OVERLAY0):
        assert cluster.passes(address, "robot-robot1/talker", TCPROS) is passes
    assert not cluster.passes(NEW0, "robot-robot1/talker", TCPROS)


def test_a_port_of_a_host_is_open_by_its_own_protocol() -> None:
    assert OWN.passes(ANYBODY, "robot-robot1/driver", 2368, "UDP")
    assert not OWN.passes(ANYBODY, "robot-robot1/driver", 2368)


SHARED = {"mode": "shared"}
MAP = app("map-server", scope="fleet", ports=[{"name": "web", "port": 8080}])
FLEET = Cluster(*(robot(app("talker"), MAP, name=name, master=SHARED) for name in ("robot1", "robot2")))


@pytest.mark.parametrize(
    ("sender", "target", "port", "passes"),
    [
        ("robot-robot1/talker", "fleet/ros-master", MASTER, True),
        ("robot-robot2/talker", "fleet/ros-keeper", KEEPER, True),
        ("fleet/ros-master", "robot-robot1/talker", TCPROS, True),
        ("fleet/map-server", "fleet/ros-master", MASTER, True),
        ("robot-robot2/talker", "robot-robot1/talker", TCPROS, False),
        ("shop/till", "fleet/ros-master", MASTER, False),
        ("shop/till", "fleet/map-server", 8080, True),
        ("observability/prometheus", "fleet/ros-keeper", KEEPER, True),
        ("observability/prometheus", "fleet/ros-master", MASTER, False),
        (SERVER, "fleet/ros-keeper", KEEPER, True),
        # whatever asks for the graph over SSH, and drivers with host_network
        (HOST2, "fleet/ros-master", MASTER, True),
        (OVERLAY2, "fleet/ros-master", MASTER, True),
        (NEW0, "fleet/ros-master", MASTER, False),
        (HOST2, "robot-robot1/talker", TCPROS, False),
        (ANYBODY, "fleet/ros-master", MASTER, False),
    ],
)
def test_who_reaches_what_is_the_whole_fleet_s(sender: str, target: str, port: int, passes: bool) -> None:
    assert FLEET.passes(sender, target, port) is passes


def test_a_laptop_reaches_the_shared_master_of_a_robot_that_lists_it() -> None:
    cluster = Cluster(robot(app("talker"), master=SHARED, admits=[f"{LAPTOP}/32"]))
    assert cluster.passes(LAPTOP, "fleet/ros-master", MASTER)
    assert not cluster.passes(ANYBODY, "fleet/ros-master", MASTER)


def test_robots_of_another_master_do_not_reach_the_fleet_s_namespace_more_than_others() -> None:
    mixed = Cluster(robot(app("talker"), name="robot1", master=SHARED), robot(app("talker"), name="robot2"))
    assert not mixed.passes("fleet/ros-master", "robot-robot2/talker", TCPROS)


@pytest.mark.parametrize(
    ("uri", "passes"), [("http://203.0.113.9:11311", True), ("http://master.example.org:11311", False)]
)
def test_an_external_master_calls_the_nodes(uri: str, passes: bool) -> None:
    """By the address that is told; nobody knows that of a name."""
    cluster = Cluster(robot(app("talker"), master={"mode": "external", "uri": uri}))
    assert cluster.passes(ANYBODY, "robot-robot1/talker", TCPROS) is passes
    assert not cluster.passes(LAPTOP, "robot-robot1/talker", TCPROS)


def test_hosts_of_which_nobody_knows_the_address() -> None:
    """The door is closed to servers, so that a run asks over SSH: on the robot's host, a pod's own node."""
    cluster = Cluster(robot(*APPS), hosts={"robot1": Hosts()})
    assert not cluster.passes(SERVER, "robot-robot1/ros-keeper", KEEPER)
    assert cluster.passes("observability/prometheus", "robot-robot1/ros-keeper", KEEPER)
    shared = network_policies(robot(app("talker"), master=SHARED))
    assert "robot-robot1" not in [one["metadata"]["name"] for one in shared]  # of nobody, which would be of everybody


def test_no_rule_is_for_everybody_by_mistake() -> None:
    """Neither an empty list of sources nor one of ports, and no two policies of one name."""
    named = [app(name, ports=[{"name": "web", "port": 1}], overrides=scraped()) for name in ("robot", "fleet")]
    made = network_policies(robot(*APPS, *named, master=SHARED), HOSTS["robot1"])
    places = [(one["metadata"]["namespace"], one["metadata"]["name"]) for one in made]
    assert len(places) == len({*places})
    for one in made:
        assert one["spec"]["policyTypes"] == ["Ingress"]
        for rule in one["spec"]["ingress"]:
            assert all(rule.values()), one
            assert "from" in rule or one["metadata"]["name"] in ("bridge.ports", "driver.ports")


@pytest.mark.parametrize(
    ("node", "found"),
    [
        ({"status": {"addresses": [{"type": "InternalIP", "address": "192.0.2.1"}, {"type": "Hostname", "address": "e"},
                                   {"type": "ExternalIP", "address": "203.0.113.1"}]},
          "spec": {"podCIDRs": ["10.42.0.0/24", "2001:db8:42::/64"]}},
         ["192.0.2.1/32", "10.42.0.0/24", "2001:db8:42::/64"]),
        ({"status": {"addresses": [{"type": "InternalIP", "address": "2001:db8::1"}]}}, ["2001:db8::1/128"]),
        # what a node says of its own addresses is never more than one of them
        ({"status": {"addresses": [{"type": "InternalIP", "address": "0.0.0.0/0"}, {"type": "InternalIP"}]},
          "spec": {"podCIDRs": ["all of them", "10.42.3.4/32"]}}, ["10.42.3.4/32"]),
        ({}, []),
    ],
)  # fmt: skip
def test_what_a_node_says(node: Object, found: list[str]) -> None:
    assert host_networks(node) == found
