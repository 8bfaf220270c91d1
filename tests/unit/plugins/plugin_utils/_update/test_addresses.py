# SPDX-License-Identifier: GPL-3.0-or-later
"""Where pods find their master and its keeper: by address, for a name takes DNS, which a robot may be cut off from."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import revision_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import PARTS, workload_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.addresses import located, other_master
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Live
from ansible_collections.rosops.fleet.tests.unit.robots import robot
from ansible_collections.rosops.fleet.tests.unit.simulated.objects import ADDRESSES, addressed, app, applied

APPS = [app("one"), app("two", hooks="sidecar"), app("three", launch={"file": "/a.launch"})]
ROBOT = robot(*APPS)


def services(of: Robot, **addresses: str) -> list[dict[str, Any]]:
    """As the API shows them; `addresses` are other ones."""
    found = [item for item in workload_objects(of, PARTS) if item["kind"] == "Service"]
    told = {**ADDRESSES, **{name.replace("_", "-"): address for name, address in addresses.items()}}
    return [{**item, "spec": {**item["spec"], "clusterIP": told[item["metadata"]["name"]]}} for item in found]


@pytest.mark.parametrize("mode", ["robot", "shared"])
def test_no_pod_is_told_a_name(mode: str) -> None:
    made = located(robot(*APPS, master={"mode": mode}), Live(services=services(robot(master={"mode": mode}))))
    assert made.master.addresses == ADDRESSES
    text = json.dumps(workload_objects(made, PARTS))
    told = text.replace('"http://ros-master', "").replace('"http://ros-keeper', "")
    assert told == text
    assert text.count("http://10.43.0.17:11311") == 5  # keeper, three apps, and a sidecar
    assert text.count("http://10.43.0.18:11411") == 2  # hooks in apps' pods


def test_what_others_have_of_these_names_is_not_the_masters() -> None:
    (master, keeper) = services(ROBOT)
    elsewhere = {**master, "metadata": {**master["metadata"], "namespace": names.FLEET_NAMESPACE}}
    port = {**keeper, "metadata": {**keeper["metadata"], "name": "one"}}
    assert located(ROBOT, Live(services=[elsewhere, port])).master.addresses == {}


def test_an_external_master_is_where_the_inventory_says() -> None:
    external = robot(*APPS, master={"mode": "external", "uri": "http://192.0.2.5:11311"})
    made = located(external, Live(services=services(ROBOT)))
    text = json.dumps(workload_objects(made, PARTS))
    assert ("http://192.0.2.5:11311" in text, "10.43.0.1" in text) == (True, False)


def test_a_service_that_is_gone_gets_the_address_again_that_pods_know() -> None:
    live = applied(addressed(ROBOT))
    made = located(ROBOT, live)
    assert made == addressed(ROBOT)
    wanted = {item["metadata"]["name"]: item["spec"] for item in services(made)}
    assert {name: spec["clusterIP"] for name, spec in wanted.items()} == ADDRESSES


def test_a_service_that_somebody_made_anew_has_its_own_address() -> None:
    """Then each pod is told it, and is so another version."""
    there = services(ROBOT, ros_master="10.43.0.99")
    made = located(ROBOT, replace(applied(addressed(ROBOT)), services=there))
    assert made.master.addresses == {**ADDRESSES, "ros-master": "10.43.0.99"}
    before, after = (
        [revision_of(item) for item in workload_objects(one, PARTS) if item["kind"] == "Deployment"]
        for one in (addressed(ROBOT), made)
    )
    assert [one == other for one, other in zip(before, after, strict=True)] == [True, False, False, False, False]


def test_pods_that_know_names_and_those_of_another_master_tell_no_address() -> None:
    assert located(ROBOT, applied(ROBOT)).master.addresses == {}
    shared = robot(*APPS, master={"mode": "shared"})
    assert located(ROBOT, applied(addressed(shared))).master.addresses == {}


# --- another master than the one that the apps run with ---------------------------------------------------------------

URI = "http://192.0.2.5:11311"
MASTERS: dict[str, dict[str, Any]] = {
    "robot": {"mode": "robot"},
    "shared": {"mode": "shared"},
    "external": {"mode": "external", "uri": URI},
}
SEEN = {"enabled": True}  # then a keeper's pod is beside an external master, too, which says nothing of another one


def at_work(mode: str, *, by_name: bool = False, **addresses: str) -> tuple[Live, Live]:
    """A robot's apps with such a master: what the API shows in its own namespace, and in that of the fleet."""
    there = robot(*APPS, master=MASTERS[mode], observability=SEEN)
    live = applied(there if by_name else addressed(there))
    found = [] if mode == "external" else services(there, **addresses)

    def of(namespace: str) -> Live:
        inside = [
            [one for one in part if one["metadata"]["namespace"] == namespace] for part in (live.deployments, found)
        ]
        return Live(inside[0], (), inside[1])

    return of("robot-robot1"), of(names.FLEET_NAMESPACE)


@pytest.mark.parametrize("by_name", [False, True], ids=["by address", "by name"])
@pytest.mark.parametrize("now", MASTERS)
@pytest.mark.parametrize("wanted", MASTERS)
def test_a_mode_that_was_changed_while_the_apps_work_is_seen(now: str, wanted: str, by_name: bool) -> None:
    own, fleet = at_work(now, by_name=by_name)
    told = other_master(robot(*APPS, master=MASTERS[wanted]), own, lambda: fleet)
    assert told.partition(" (")[0] == ("" if now == wanted else f"ros_master_mode {now}")


def test_another_external_master_is_another_one() -> None:
    own, fleet = at_work("external")
    wanted = robot(*APPS, master={"mode": "external", "uri": "http://192.0.2.6:11311"})
    assert other_master(wanted, own, lambda: fleet) == f"ros_master_mode external ({URI})"


@pytest.mark.parametrize("mode", ["robot", "shared"])
def test_a_service_that_was_made_anew_is_no_other_master(mode: str) -> None:
    own, fleet = at_work(mode, ros_master="10.43.0.99")
    both = Live([*own.deployments, *fleet.deployments], (), [*own.services, *fleet.services])
    assert other_master(robot(*APPS, master=MASTERS[mode]), both, lambda: fleet) == ""


def test_a_robot_without_apps_may_have_any_master() -> None:
    there = robot(master=MASTERS["robot"])
    live = replace(applied(addressed(there)), services=services(there))
    assert other_master(robot(*APPS, master=MASTERS["shared"]), live, Live) == ""
