# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which steps an update takes, in which order, and what each one goes back to."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.plan import Plan, Request, kept, update_plan
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.update_objects import (
    app,
    applied,
    entry,
    marked,
    update_map,
)
from ansible_collections.rosops.fleet.tests.unit.robots import robot

PREVIOUS = Request(to="previous")


def step_names(plan: Plan) -> list[list[str]]:
    return [list(step.apps) for step in plan.steps]


def test_what_is_as_it_should_be_is_no_step() -> None:
    wanted = robot(app("one"), app("two"))
    plan = update_plan(wanted, applied(wanted))
    assert plan.steps == []
    assert sorted(plan.unchanged) == ["one", "ros-master", "two"]


def test_a_changed_app_is_a_step_with_both_its_nodes_and_its_way_back() -> None:
    before, after = robot(app("one"), app("two")), robot(app("one", "example.org/app:1.1"), app("two"))
    (step,) = update_plan(after, applied(before)).steps
    assert step.apps == ["one"]
    assert step.handoff == "overlap"
    assert step.old_nodes["one"] != step.new_nodes["one"]
    assert step.renames == {step.old_nodes["one"]: step.new_nodes["one"]}
    assert step.before["one"]["image"] == "example.org/app:1.0"
    assert step.after["one"]["image"] == "example.org/app:1.1"
    assert step.created == []
    assert not step.resume


def test_the_way_back_is_what_was_applied_without_the_servers_additions() -> None:
    before = robot(app("one", env={"A": "1"}))
    (step,) = update_plan(robot(app("one", env={"A": "2"})), applied(before)).steps
    (was,) = [item for item in app_objects(before) if item["kind"] == "Deployment"]
    assert step.previous["one"] == was


def test_an_app_that_is_not_there_yet_is_deleted_on_the_way_back() -> None:
    (step,) = update_plan(robot(app("one"), app("two")), applied(robot(app("one")))).steps
    assert step.apps == ["two"]
    assert step.previous == {}
    assert [item["metadata"]["name"] for item in step.created] == ["two"]
    assert step.renames == {}


def test_providers_come_before_their_users_and_the_master_before_all() -> None:
    def fleet(image: str) -> Robot:
        return robot(
            app("user", image, depends_on=["sensor", "map"]),
            app("map", image, depends_on=["sensor"]),
            app("sensor", image),
            master={"image": image},
        )

    plan = update_plan(fleet("example.org/app:2"), applied(fleet("example.org/app:1")))
    assert step_names(plan) == [["ros-master"], ["sensor"], ["map"], ["user"]]


def test_the_keeper_goes_back_with_its_master() -> None:
    before, after = (robot(app("one"), master={"image": f"x.org/ros:{number}"}) for number in (1, 2))
    (step,) = update_plan(after, applied(before)).steps
    assert set(step.previous) == {"ros-master", "ros-keeper"}
    assert (set(step.before), step.created) == ({"ros-master"}, [])


def test_apps_of_one_group_are_one_step_in_the_order_of_their_dependencies() -> None:
    def fleet(image: str) -> Robot:
        return robot(
            app("stats", image, depends_on=["sensor"], update={"group": "temperature"}),
            app("other", image),
            app("sensor", image, update={"group": "temperature"}),
        )

    plan = update_plan(fleet("example.org/app:2"), applied(fleet("example.org/app:1")))
    assert step_names(plan) == [["sensor", "stats"], ["other"]]
    assert plan.steps[0].name == "temperature"
    assert len(plan.steps[0].renames) == 2


def test_only_the_changed_apps_of_a_group_take_part() -> None:
    def fleet(image: str) -> Robot:
        return robot(app("a", image, update={"group": "g"}), app("b", update={"group": "g"}))

    plan = update_plan(fleet("example.org/app:2"), applied(fleet("example.org/app:1.0")))
    assert step_names(plan) == [["a"]]
    assert plan.unchanged == ["ros-master", "b"]


def test_an_unknown_app_is_an_error_that_names_those_there_are() -> None:
    wanted = robot(app("one"))
    with pytest.raises(SpecError, match="no app nine; it has ros-master, one"):
        update_plan(wanted, applied(wanted), Request(only=["nine"]))


def test_only_limits_the_plan() -> None:
    before, after = robot(app("a"), app("b")), robot(app("a", "x.org/a:2"), app("b", "x.org/a:2"))
    assert step_names(update_plan(after, applied(before), Request(only=["b"]))) == [["b"]]


def test_what_belongs_to_the_fleet_is_left_to_the_robot_whose_it_is() -> None:
    def fleet(image: str) -> Robot:
        return robot(
            app("planner", image, scope="fleet"), app("one", image), master={"mode": "shared", "image": "x.org/ros:1"}
        )

    live = applied(fleet("x.org/a:1"))
    assert step_names(update_plan(fleet("x.org/a:2"), live, Request(shared=False))) == [["one"]]
    assert step_names(update_plan(fleet("x.org/a:2"), live, Request(shared=True))) == [["planner"], ["one"]]


def test_a_deployment_that_the_inventory_does_not_know_is_named_and_left() -> None:
    plan = update_plan(robot(app("one")), applied(robot(app("one"), app("old"))))
    assert plan.orphans == ["old"]
    assert plan.steps == []


def test_a_step_that_was_cut_off_is_taken_up_again_and_goes_back_to_the_last_proven_version() -> None:
    proven, wanted = robot(app("one")), robot(app("one", "x.org/a:2"))
    live = marked(applied(wanted, update_map("one", [entry(proven, "one")])), "one")
    (step,) = update_plan(wanted, live).steps
    assert step.resume
    assert step.previous["one"] == entry(proven, "one")["deployment"]
    assert step.before["one"]["image"] == "example.org/app:1.0"
    assert step.renames == {step.old_nodes["one"]: step.new_nodes["one"]}


def test_a_third_version_after_a_cut_off_step_is_a_new_step_from_the_proven_one() -> None:
    proven, cut_off = robot(app("one")), robot(app("one", "x.org/a:2"))
    live = marked(applied(cut_off, update_map("one", [entry(proven, "one")])), "one")
    (step,) = update_plan(robot(app("one", "x.org/a:3")), live).steps
    assert not step.resume
    assert step.previous["one"] == entry(proven, "one")["deployment"]


def test_back_to_the_previous_version() -> None:
    old, new = robot(app("one"), app("two")), robot(app("one", "x.org/a:2"), app("two"))
    plan = update_plan(new, applied(new, update_map("one", [entry(old, "one")])), PREVIOUS)
    assert step_names(plan) == [["one"]]
    assert plan.steps[0].after["one"]["image"] == "example.org/app:1.0"
    assert plan.steps[0].before["one"]["image"] == "x.org/a:2"


def test_back_to_a_named_version() -> None:
    first, second, third = (robot(app("one", f"x.org/a:{number}")) for number in (1, 2, 3))
    history = update_map("one", [entry(second, "one"), entry(first, "one")])
    wanted = entry(first, "one")["revision"]
    plan = update_plan(third, applied(third, history), Request(to=wanted))
    assert plan.steps[0].after["one"] == {"image": "x.org/a:1", "revision": wanted}


def test_back_from_an_old_version_is_the_newer_one_not_itself() -> None:
    old, new = robot(app("one")), robot(app("one", "x.org/a:2"))
    history = update_map("one", [entry(new, "one"), entry(old, "one")])
    plan = update_plan(new, applied(old, history), PREVIOUS)
    assert plan.steps[0].after["one"]["image"] == "x.org/a:2"


def test_no_way_back_is_unchanged_for_a_fleet_and_an_error_for_a_named_app() -> None:
    wanted = robot(app("one"))
    assert update_plan(wanted, applied(wanted), PREVIOUS).steps == []
    with pytest.raises(SpecError, match="app one has no previous revision to go back to; kept: none"):
        update_plan(wanted, applied(wanted), Request(["one"], "previous"))


def test_an_unknown_revision_is_an_error_that_names_those_there_are() -> None:
    old, new = robot(app("one")), robot(app("one", "x.org/a:2"))
    history = update_map("one", [entry(old, "one")])
    with pytest.raises(SpecError, match=rf"no revision 12345678 .* kept: {entry(old, 'one')['revision']} "):
        update_plan(new, applied(new, history), Request(["one"], "12345678"))


def test_what_somebody_else_applied_is_kept_without_the_servers_bookkeeping() -> None:
    item = applied(robot(app("one"))).deployments[-1]
    item["metadata"]["managedFields"][0]["manager"] = "kubectl"
    assert set(kept(item)["metadata"]) == {"name", "namespace", "labels", "annotations"}
    assert "status" not in kept(item)
