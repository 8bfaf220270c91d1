# SPDX-License-Identifier: GPL-3.0-or-later
"""The fleet's way from the validation to the actions that read it."""

from __future__ import annotations

import json
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.fleet import (
    Fleet,
    Home,
    home_from_vars,
    home_of,
    robot_from_vars,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.topology import fleet_topology
from ansible_collections.rosops.fleet.tests.unit.robots import robot

GROUPS = {"edge": ["e1", "e2"], "k3s_server": ["e2"], "robots": ["r1", "r2"]}
FLEET = Fleet(
    {name: robot({"name": "a", "image": "a:1"}, name=name) for name in GROUPS["robots"]},
    fleet_topology(GROUPS, {"r2": "standalone"}, {"e1": "node-1"}),
    ("node-1", "e2"),
    "production",
)
VARIABLES = {"fleet": {**json.loads(json.dumps(FLEET.as_dict())), "changed": False}, "inventory_hostname": "r2"}


def test_it_survives_its_way_through_a_variable() -> None:
    assert Fleet.from_vars(VARIABLES) == FLEET
    assert VARIABLES["fleet"]["hosts"]["e1"] == {
        "role": "agent", "cluster": "edge", "servers": ["e2"], "init": False, "node": "node-1",
    }  # fmt: skip


def test_a_task_finds_where_its_host_belongs() -> None:
    assert home_from_vars(VARIABLES) == Home(FLEET.hosts["r2"], "production")
    assert home_from_vars({**VARIABLES, "inventory_hostname": "localhost"}) is None
    assert home_from_vars({"inventory_hostname": "r2", "fleet": {"failed": True}}) is None


def test_a_task_finds_its_robot() -> None:
    assert robot_from_vars(VARIABLES) == FLEET.robots["r2"]
    with pytest.raises(SpecError, match="e1 is no robot of this fleet"):
        robot_from_vars({**VARIABLES, "inventory_hostname": "e1"})


@pytest.mark.parametrize("variables", [{}, {"fleet": "mine"}, {"fleet": {"failed": True, "msg": "no"}}])
@pytest.mark.parametrize("read", [Fleet.from_vars, robot_from_vars, home_of])
def test_without_the_validation_it_says_what_to_do(read: Any, variables: Any) -> None:
    with pytest.raises(SpecError, match=r"import the playbook rosops[.]fleet[.]validate"):
        read(variables)
