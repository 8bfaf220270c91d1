# SPDX-License-Identifier: GPL-3.0-or-later
"""Hosts' variables, by Ansible's own inventory: a value may lead to another host, and what is undefined says so."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from ansible.inventory.manager import InventoryManager
from ansible.parsing.dataloader import DataLoader
from ansible.vars.hostvars import HostVars
from ansible.vars.manager import VariableManager
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.host_variables import HostVariables
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.inventory import fleet_hosts

INVENTORY = """
all:
  vars:
    hub: "{{ hostvars['edge1'].ansible_host }}"
  hosts:
    edge1: {ansible_host: 192.0.2.1, place: "{{ 'ha' ~ 'll' }}"}
    robot1:
      observability_profile: robot
      observability_hub_url: "http://{{ hub }}"
      ros_apps: [{name: talker, image: i, env: {HUB: "{{ hub }}"}}]
    robot2: {observability_profile: robot, observability_hub_url: "http://{{ hostvars['edge1'].a_fact_not_gathered }}"}
"""


@pytest.fixture
def hostvars(tmp_path: Path) -> Any:
    source = tmp_path / "hosts.yml"
    source.write_text(INVENTORY, "utf-8")
    loader = DataLoader()
    inventory = InventoryManager(loader=loader, sources=[str(source)])
    return HostVars(inventory, VariableManager(loader=loader, inventory=inventory), loader)


def test_a_value_may_lead_to_another_host(hostvars: Any) -> None:
    hosts = HostVariables(hostvars)
    assert hosts["robot1"]["observability_hub_url"] == "http://192.0.2.1"
    assert fleet_hosts(hosts, ["robot1"], [])["robot1"]["ros_apps"][0]["env"] == {"HUB": "192.0.2.1"}
    assert hosts["edge1"]["place"] == "hall"
    assert set(hosts) == {"edge1", "robot1", "robot2"} and len(hosts) == 3
    assert "robot3" not in hosts and "missing" not in hosts["robot1"]


def test_a_plain_mapping_stays_what_it_is() -> None:
    plain = {"r": {"a": "{{ x }}"}}
    assert HostVariables(plain)["r"] is plain["r"]


def test_what_is_undefined_is_named(hostvars: Any) -> None:
    said = r"hosts\.robot2\.observability_hub_url: cannot be templated: .* has no attribute 'a_fact_not_gathered'"
    with pytest.raises(SpecError, match=said):
        fleet_hosts(HostVariables(hostvars), ["robot2"], [])
