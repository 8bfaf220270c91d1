# SPDX-License-Identifier: GPL-3.0-or-later
"""Which host plays which part, and where it is."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.topology import (
    ClusterPart,
    address,
    edge_ordered,
    fleet_topology,
)


def agent(host: str, *servers: str) -> ClusterPart:
    return ClusterPart("agent", "edge", servers, False, host)


def server(host: str, *servers: str, cluster: str = "edge") -> ClusterPart:
    return ClusterPart("server", cluster, servers, host == servers[0], host)


@pytest.mark.parametrize(
    ("groups", "modes", "expected"),
    [
        ({"edge": ["e"], "robots": ["r1", "r2"]}, {}, [server("e", "e"), agent("r1", "e"), agent("r2", "e")]),
        # all are servers, and the first starts the cluster
        ({"edge": ["e2", "e1", "e3"]}, {}, [server(host, "e2", "e1", "e3") for host in ("e2", "e1", "e3")]),
        # those that are named make agents of the others
        (
            {"edge": ["e1", "e2"], "k3s_server": ["e2"], "robots": ["r1"]},
            {},
            [agent("e1", "e2"), server("e2", "e2"), agent("r1", "e2")],
        ),
        # a cluster of its own, which needs no edge
        (
            {"edge": ["e"], "robots": ["r1", "r2"]},
            {"r1": "standalone"},
            [server("e", "e"), server("r1", "r1", cluster="r1"), agent("r2", "e")],
        ),
        ({"robots": ["r1"]}, {"r1": "standalone"}, [server("r1", "r1", cluster="r1")]),
        # the groups of these names alone count
        ({"all": ["x", "e"], "edge": ["e"], "robots": [], "reachable": ["x"]}, {}, [server("e", "e")]),
    ],
)
def test_each_hosts_part(groups: dict[str, Any], modes: dict[str, str], expected: list[ClusterPart]) -> None:
    assert list(fleet_topology(groups, modes).items()) == [(part.node, part) for part in expected]


@pytest.mark.parametrize("first", ["", "e2"])
def test_the_edge_s_order_is_that_of_names(first: str) -> None:
    """But for the server that is named as the first; robots stay as they are."""
    groups = {"edge": ["e4", "e2", "e1", "e3"], "k3s_server": ["e3", "e2", "e1"], "robots": ["r2", "r1"]}
    servers = [*filter(None, [first]), *(name for name in ("e1", "e2", "e3") if name != first)]
    assert edge_ordered(groups, first) == {**groups, "edge": [*servers, "e4"], "k3s_server": servers}


@pytest.mark.parametrize(
    ("known", "expected"),
    [
        ({}, "edge1"),
        ({"ansible_host": "10.0.0.1"}, "10.0.0.1"),
        ({"ansible_host": "10.0.0.1", "k3s_node_ip": "192.168.1.1,fd00::1"}, "192.168.1.1"),
        ({"ansible_host": "fd00::1"}, "[fd00::1]"),
    ],
)
def test_address(known: dict[str, str], expected: str) -> None:
    assert address("edge1", {"edge1": known}) == expected
