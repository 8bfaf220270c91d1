# SPDX-License-Identifier: GPL-3.0-or-later
"""The variables of ours among all of an inventory, and what does nothing there."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.fleet import check_fleet
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.inventory import RIGEL, fleet_hosts


class Templated(dict[str, Any]):
    """Like hostvars: a value is made when it is read, and that may fail."""

    def __getitem__(self, key: str) -> Any:
        value = super().__getitem__(key)
        if isinstance(value, Exception):
            raise value
        return value


def test_fleet_hosts_picks_ours_and_what_is_misspelt() -> None:
    hostvars = {
        "r": {
            "ros_apps": [], "robot_mode": "agent", "k3s_tokn": "x", "ros_app": [], "ansible_host": "h",
            "robot_model": "m", "ros_distro": "noetic", "node_exporter": True, "k3s_ansible_things": 1,
        }
    }  # fmt: skip
    assert set(fleet_hosts(hostvars, ["r", "unknown"], [])["r"]) == {"ros_apps", "robot_mode", "k3s_tokn", "ros_app"}


def test_fleet_hosts_hides_secrets_but_keeps_them_comparable() -> None:
    login = {"name": "n", "registry": "r", "username": "u", "password": "hush3"}
    hostvars: dict[str, Any] = {
        "e1": {"k3s_token": "hush1", "k3s_registries": {"configs": {"x": {"auth": {"password": "hush"}}}}},
        "e2": {"k3s_token": "hush2", "k3s_environment": {"HTTP_PROXY": "http://hush@proxy"}},
        "e3": {"k3s_token": "hush1", "robot_namespace_pull_secrets": [login]},
        "e4": {"k3s_token": ["hush"], "ros_apps": [{"env": {"PASSWORD": "known", "MODE": "fast"}}]},
        "e5": {"k3s_token": 5, "k3s_config": "hush"},
        "e6": {"k3s_token": "", "k3s_agent_token": None},
    }
    found = fleet_hosts(hostvars, hostvars, [])
    assert "hush" not in str(found)
    assert found["e1"]["k3s_token"] == found["e3"]["k3s_token"] != found["e2"]["k3s_token"]
    assert found["e4"]["ros_apps"][0]["env"] == {"PASSWORD": "known", "MODE": "fast"}
    assert (found["e5"]["k3s_token"], found["e6"]["k3s_token"], found["e6"]["k3s_agent_token"]) == (0, "", None)
    assert [problem.path for problem in check_fleet({"edge": ["e1", "e2", "e3"]}, hostvars).problems] == [
        "hosts.e2.k3s_token"
    ]


def test_fleet_hosts_reports_templates_that_fail_all_at_once() -> None:
    broken = ValueError("'site' is undefined\nmore")
    hostvars = {
        "r1": Templated({"ros_apps": broken, "robot_mode": "agent"}),
        "r2": Templated({"persistent_storage": broken}),
        "r3": Templated({"k3s_kubeconfig_path": broken, "unrelated": broken}),
    }
    with pytest.raises(SpecError) as caught:
        fleet_hosts(hostvars, hostvars, [])
    assert str(caught.value).splitlines()[1:] == [
        "hosts.r1.ros_apps: cannot be templated: 'site' is undefined; allowed: a value that is defined",
        "hosts.r2.persistent_storage: cannot be templated: 'site' is undefined; allowed: a value that is defined",
    ]


def test_keys_of_a_rigelfile_are_refused_all_at_once_whatever_their_values() -> None:
    said = Templated({name: ValueError("it rests on what is not there") for name in RIGEL})
    found = check_fleet({"edge": ["edge1"], "robots": ["robot1"]}, {"robot1": said}).problems
    assert [problem.path for problem in found] == [f"hosts.robot1.{name}" for name in RIGEL]
    assert [problem.allowed for problem in found] == [*RIGEL.values()]
    assert {problem.problem for problem in found} == {"is a key of a Rigelfile and has no effect here"}
