# SPDX-License-Identifier: GPL-3.0-or-later
"""The action over Ansible's own inventory: what a whole one may say, what is handed on, and what becomes of secrets."""

from __future__ import annotations

import bz2
import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from ansible.inventory.manager import InventoryManager
from ansible.parsing.dataloader import DataLoader
from ansible.vars.hostvars import HostVars
from ansible.vars.manager import VariableManager
from ansible_collections.rosops.fleet.plugins.action import _fleet_config
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.fleet import Fleet
from ansible_collections.rosops.fleet.tests.unit.bad_input import table
from ansible_collections.rosops.fleet.tests.unit.plugins.action import actions
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._images.archives import docker

# what the table of bad inputs is refused with, is said by the tests of the validation itself, and by tests/bad_input
GOOD: dict[str, Any] = {
    "groups": {**table.GROUPS, "all": ["edge1", "robot1"]},
    "hosts": {
        "edge1": {
            "k3s_token": "hush-token",
            "k3s_node_name": "{{ 'node-' ~ 1 }}",
            "k3s_registries": {"configs": {"r": {"auth": {"password": "hush-r"}}}},
        },
        "robot1": {
            "ros_apps": [{**table.GOOD_APP, "image": "example.org/talker", "env": {"API_TOKEN": "known", "N": 1}}],
            "robot_namespace_pull_secrets": [
                {"name": "login", "registry": "example.org", "username": "me", "password": "hush-password"}
            ],
        },
    },
}


def run(tmp_path: Path, fleet: dict[str, Any], check: bool = False) -> dict[str, Any]:
    """The task's result for an inventory of these groups and variables."""
    source = tmp_path / "hosts.yml"
    groups = {name: {"hosts": dict.fromkeys(hosts)} for name, hosts in fleet["groups"].items() if name != "all"}
    hosts = {name: fleet["hosts"].get(name, {}) for name in fleet["groups"]["all"]}
    source.write_text(yaml.safe_dump({"all": {"hosts": hosts, "children": groups}}, sort_keys=False), "utf-8")
    loader = DataLoader()
    inventory = InventoryManager(loader=loader, sources=[str(source)])
    hostvars = HostVars(inventory, VariableManager(loader=loader, inventory=inventory), loader)
    variables = {"hostvars": hostvars, "groups": inventory.get_groups_dict()}
    return actions.run(_fleet_config, {}, variables, check)


@pytest.mark.parametrize("check", [False, True])
def test_a_good_fleet_is_handed_on_without_secrets(check: bool, tmp_path: Path) -> None:
    result = run(tmp_path, GOOD, check)
    assert (result["changed"], "failed" in result) == (False, False)
    assert "may mean another image" in result["warnings"][0]
    assert "hush" not in json.dumps(result)
    fleet = Fleet.from_vars({"fleet": result})
    robot = fleet.robots["robot1"]
    assert robot.pull_secrets == ("login",)
    assert robot.apps[0].env == {"API_TOKEN": "known", "N": "1"}
    assert fleet.edge_nodes == ("node-1",) == (fleet.hosts["edge1"].node,)


def test_a_robot_has_the_apps_of_all_its_layers(tmp_path: Path) -> None:
    layers = {
        "ros_apps_model": [{"name": "talker", "env": {"N": "2"}}],
        "ros_apps_robot": [{**table.GOOD_APP, "name": "b"}],
    }
    result = run(tmp_path, {**GOOD, "hosts": {**GOOD["hosts"], "robot1": {**GOOD["hosts"]["robot1"], **layers}}})
    apps = Fleet.from_vars({"fleet": result}).robots["robot1"].apps
    assert {app.name: app.env for app in apps} == {"talker": {"API_TOKEN": "known", "N": "2"}, "b": {}}


ONE_MACHINE: dict[str, Any] = {
    "groups": {"edge": ["edge1"], "robots": ["r1", "r2", "r3"], "all": ["edge1", "r1", "r2", "r3"]},
    "hosts": {name: {"ansible_host": "192.0.2.7"} for name in ("edge1", "r1", "r2")},
}
ONE_MACHINE["hosts"]["r1"]["ansible_port"] = 2201
LOCAL = {name: {**said, "ansible_connection": "local"} for name, said in ONE_MACHINE["hosts"].items() if name != "r2"}
WAVES = {**GOOD, "hosts": {"robot1": {"update_waves": [1, "100%"]}}}
ALLOWED = "allowed: numbers above 0 and percentages, such as 1, 25%, 100%"
SLICED = {"awx_job_template_name": "update", "awx_workflow_job_name": "update"}
# The fleet, what is given by -e, and the first problem, if there is any.
PROBLEMS: dict[str, tuple[dict[str, Any], dict[str, Any], str]] = {
    "what cannot be templated": (
        {**GOOD, "hosts": {"edge1": {}, "robot1": {"ros_apps": "{{ nobody_knows }}"}}},
        {},
        "hosts.robot1.ros_apps: cannot be templated: 'nobody_knows' is undefined",
    ),
    "one machine is no two hosts": (ONE_MACHINE, {}, "hosts.r2.ansible_host: is 192.0.2.7 as that of edge1"),
    "but where it is the control node": ({**ONE_MACHINE, "hosts": {**ONE_MACHINE["hosts"], **LOCAL}}, {}, ""),
    "waves of an inventory": (
        WAVES, {}, "hosts.robot1.update_waves: has no effect in an inventory; allowed: -e '{",
    ),
    "waves of the run": (WAVES, {"update_waves": [1]}, ""),
    "waves that no run understands": (GOOD, {"update_waves": "1, all"}, ALLOWED),
    "waves without a host": (GOOD, {"update_waves": [0]}, ALLOWED),
    "a slice of an AWX job": (GOOD, SLICED, "named as its job template, update"),
    "a job in a workflow": (GOOD, {**SLICED, "awx_workflow_job_name": "night"}, ""),
    "an AWX job": (GOOD, {"awx_job_template_name": "update"}, ""),
}  # fmt: skip


@pytest.mark.parametrize(("fleet", "given", "words"), PROBLEMS.values(), ids=PROBLEMS)
def test_what_a_whole_inventory_or_a_run_may_say(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fleet: dict[str, Any], given: dict[str, Any], words: str
) -> None:
    monkeypatch.setattr(_fleet_config, "load_extra_vars", lambda _loader: given)
    result = run(tmp_path, fleet)
    assert ("robots" in result, "failed" in result) == (not words, bool(words))
    assert words in result.get("msg", "") and not result.get("changed")
    assert bool(words) == len(result.get("msg", "").splitlines()[1:])
    assert "hush" not in json.dumps(result)


def test_the_order_of_errors_is_the_inventorys(tmp_path: Path) -> None:
    names = ["r3", "r1", "r2"]
    groups = {"edge": ["edge1"], "robots": names, "all": ["edge1", *names]}
    result = run(tmp_path, {"groups": groups, "hosts": {name: {"robot_mode": f"c{name}"} for name in names}})
    paths = [line.partition(": ")[0] for line in result["msg"].splitlines()[1:]]
    assert paths == [f"hosts.{name}.robot_mode" for name in names]


def test_a_group_s_mistake_is_told_once(tmp_path: Path) -> None:
    names = [f"r{number}" for number in range(1, 61)]
    groups = {"edge": ["edge1"], "robots": names, "all": ["edge1", *names]}
    apps = [{**table.GOOD_APP, "image": "example.org/talker"}, {**table.GOOD_APP, "name": "lidar", "placement": "moon"}]
    result = run(tmp_path, {"groups": groups, "hosts": {name: {"ros_apps": apps} for name in names}})
    (line,) = result["msg"].splitlines()[1:]
    assert line.startswith("hosts.r1.ros_apps[1].placement: is 'moon'; allowed: local or remote")
    assert line.endswith("(app lidar; so on r2, r3, r4, r5 and 55 more, too)")
    assert len(result["warnings"]) == 1


def test_no_part_of_the_fleet_depends_on_the_order_of_hosts(tmp_path: Path) -> None:
    """An inventory of AWX has another one in every job."""
    names = ["edge1", "edge2", "edge3", "robot1", "robot2"]

    def fleet(order: list[str]) -> dict[str, Any]:
        groups = {kind: [name for name in order if name.startswith(kind[:4])] for kind in ("edge", "robots")}
        hosts = {name: {"ros_apps": [table.GOOD_APP]} for name in names if name.startswith("robot")}
        return run(tmp_path, {"groups": {**groups, "all": order}, "hosts": hosts})

    found = fleet(names)
    assert [name for name, host in found["hosts"].items() if host["init"]] == ["edge1"]
    assert fleet(names[::-1]) == found == fleet(["edge2", "robot2", "edge1", "robot1", "edge3"])
    assert fleet(names[::-1])["edge_nodes"] == found["edge_nodes"] == ["edge1", "edge2", "edge3"]


@pytest.mark.parametrize("first", ["edge2", "robot1", "edge9"])
def test_another_server_may_be_the_first(tmp_path: Path, first: str) -> None:
    groups = {"edge": ["edge1", "edge2", "edge3"], "robots": ["robot1"], "all": ["edge1", "edge2", "edge3", "robot1"]}
    said = {name: {"k3s_first_server": first} for name in groups["edge"]}
    found = run(tmp_path, {"groups": groups, "hosts": said})
    if first == "edge2":
        assert [name for name, host in found["hosts"].items() if host["init"]] == [first]
        assert tuple(found["hosts"]["robot1"]["servers"]) == ("edge2", "edge1", "edge3")
    else:
        assert f"k3s_first_server: is {first}; allowed: the same for all servers: one of edge1, " in found["msg"]
    one_alone = run(tmp_path, {"groups": groups, "hosts": {"edge3": {"k3s_first_server": "edge2"}}})
    assert "hosts.edge3.k3s_first_server" in one_alone["msg"]


def archived(tmp_path: Path, place: str, **more: Any) -> dict[str, Any]:
    """The good fleet, whose app's host has an archive with the app's image in another version."""
    path = docker(tmp_path / "apps.tar", ["example.org/talker:1.0"])
    app = {**table.GOOD_APP, "image": "example.org/talker:1.0.1", "placement": place}
    hosts: dict[str, Any] = {"edge1": {}, "robot1": {"ros_apps": [app], "ros_master_image": "example.org/talker:1.0"}}
    hosts["robot1" if place == "local" else "edge1"].update({"images_archives": [{"path": path}], **more})
    return {**GOOD, "hosts": hosts}


@pytest.mark.parametrize(("place", "host"), [("local", "robot1"), ("remote", "edge1")])
def test_an_image_that_no_archive_has_is_said_before_a_host_is_touched(place: str, host: str, tmp_path: Path) -> None:
    result = run(tmp_path, archived(tmp_path, place))
    assert result["warnings"] == [
        f"hosts.{host}.images_archives: none of them has example.org/talker:1.0.1, so the node will pull it "
        "(images_refs says that this is meant); they hold example.org/talker:1.0"
    ]
    assert run(tmp_path, archived(tmp_path, place, images_refs=["example.org/talker:1.0.1"]))["warnings"] == []
    assert run(tmp_path, archived(tmp_path, place, images_archives=[{"path": "/away.tar"}]))["warnings"] == []


def test_an_archive_that_no_node_can_take_is_refused(tmp_path: Path) -> None:
    packed = tmp_path / "apps.tar.bz2"
    packed.write_bytes(bz2.compress(b"whatever"))
    result = run(tmp_path, archived(tmp_path, "local", images_archives=[{"path": str(packed)}]))
    told = f"hosts.robot1.images_archives[0].path: {packed} is compressed by bzip2: unpack it, or compress it by gzip"
    assert result["msg"].splitlines()[1:] == [told]
