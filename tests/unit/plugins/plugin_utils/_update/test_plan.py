# SPDX-License-Identifier: GPL-3.0-or-later
"""Which steps an update takes, in which order, and what each one goes back to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.module_utils._step import words
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import app_of, name_of
from ansible_collections.rosops.fleet.plugins.module_utils._step.words import BACK_TO, SOAKING, UPDATING
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.common import (
    RECREATE_STRATEGY,
    config_map,
    pod_spec,
    workload,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.network import network_policies
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import PARTS, graph_conditions
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.plan import Plan, Request, placed
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.revisions import described, kept
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Live
from ansible_collections.rosops.fleet.tests.unit.robots import robot
from ansible_collections.rosops.fleet.tests.unit.simulated.objects import (
    app,
    applied,
    entry,
    marked,
    planned,
    update_map,
    versions,
)

PREVIOUS = Request(to="previous")


def step_names(plan: Plan) -> list[list[str]]:
    return [list(step.apps) for step in plan.steps]


def selector(item: dict[str, Any]) -> dict[str, str]:
    found: dict[str, str] = item["spec"]["template"]["spec"]["nodeSelector"]
    return found


OLD, NEW = {"rosops.fleet/robot": "robot1"}, {"node-restriction.kubernetes.io/rosops-robot": "robot1"}
REMOTE = {"node-restriction.kubernetes.io/rosops-placement": "remote"}


@pytest.mark.parametrize("handoff", ["overlap", "replace"])
def test_what_is_placed_by_the_labels_of_1_0_is_so_until_it_changes_anyway(handoff: str) -> None:
    """Its selector alone restarts no app, and the graph is asked for the node that runs, not for another revision's."""
    apps = [app("one", handoff=handoff, placement="local"), app("two"), app("three", placement="local")]
    before = placed(robot(*apps), Live(), unlabelled=True)
    assert [selector(item) for item in app_objects(before)] == [OLD, {"deploymentType": "remote"}, OLD]
    there = applied(before)
    assert planned(robot(*apps), there).steps == []
    wanted = placed(robot(*apps), there, unlabelled=False)
    assert graph_conditions(wanted) == graph_conditions(before)
    apps[1], apps[2] = ({**each, "image": "example.org/app:2.0"} for each in apps[1:])
    steps = planned(robot(*apps), there).steps
    assert [selector(item) for step in steps for item in step.workloads] == [REMOTE, NEW]
    assert [selector(step.previous[step.name]) for step in steps] == [{"deploymentType": "remote"}, OLD]


def test_where_nodes_lack_the_new_labels_new_versions_have_the_old_ones_and_what_runs_stays() -> None:
    new = robot(app("one", placement="local"))
    assert placed(new, applied(new), unlabelled=True).old_labels == ()
    changed = robot(app("one", "example.org/app:2.0", placement="local"))
    there = placed(changed, applied(new), unlabelled=True)
    assert [selector(item) for item in app_objects(there)] == [OLD]
    assert there.old_labels == ("one",)  # master and keeper are as they were


def test_a_changed_app_is_a_step_with_both_its_nodes_and_its_way_back() -> None:
    before = robot(app("one", env={"A": "1"}), app("two"))
    after = robot(app("one", "example.org/app:1.1"), app("two"), app("new", "example.org/app:1.1"))
    step, new = planned(after, applied(before)).steps
    (named,) = planned(after, applied(before), Request(only=["new"])).steps
    assert (named.apps, new.apps, new.previous, new.renames) == (["new"], ["new"], {}, {})
    assert [item["metadata"]["name"] for item in new.created] == ["new"]
    # without the API server's additions
    assert step.previous["one"] == app_objects(before)[0]
    assert step.apps == ["one"]
    assert step.handoff == "overlap"
    assert step.old_nodes["one"] != step.new_nodes["one"]
    assert step.renames == {step.old_nodes["one"]: step.new_nodes["one"]}
    assert step.before["one"]["image"] == "example.org/app:1.0"
    assert step.after["one"]["image"] == "example.org/app:1.1"
    assert step.created == []
    assert not step.resume


@pytest.mark.parametrize("mode", ["robot", "shared"])
@pytest.mark.parametrize(("hooks", "steps"), [("gate", [["ros-keeper"], ["one"]]), ("app", [["one"]])])
def test_the_keeper_comes_before_a_pod_whose_gate_it_opens(hooks: str, steps: list[list[str]], mode: str) -> None:
    before = robot(app("one", hooks="app"), master={"mode": mode, "image": "x.org/ros:1"})
    after = robot(app("one", "example.org/app:1.1", hooks=hooks), master={"mode": mode, "image": "x.org/ros:2"})
    assert step_names(planned(after, applied(before), Request(only=["one"]))) == steps


def test_providers_come_before_their_users_and_the_master_before_all() -> None:
    def fleet(image: str) -> Robot:
        return robot(
            app("user", image, depends_on=["sensor", "map"]),
            app("map", image, depends_on=["sensor"]),
            app("sensor", image),
            master={"image": image},
        )

    plan = planned(fleet("example.org/app:2"), applied(fleet("example.org/app:1")))
    assert step_names(plan) == [["ros-keeper"], ["ros-master"], ["sensor"], ["map"], ["user"]]
    # never together: each is the other's record
    keeper, master = ((step.name, step.kind, step.handoff, step.rest, step.created) for step in plan.steps[:2])
    assert keeper == ("ros-keeper", "app", "replace", [], [])
    assert master == ("ros-master", "master", "replace", [], [])


def test_what_the_keeper_took_back_is_planned_anew() -> None:
    """It is as if the step had never been; how it came back is no part of the version."""
    before, after = robot(app("one", "x.org/a:1")), robot(app("one", "x.org/a:2"))
    live = applied(before)
    (there,) = [item for item in live.deployments if item["metadata"]["name"] == "one"]
    there["metadata"]["annotations"][words.WENT_BACK] = "{}"
    (step,) = planned(after, live).steps
    assert (step.apps, step.resume, step.unproven) == (["one"], False, [])
    assert words.WENT_BACK not in step.previous["one"]["metadata"]["annotations"]
    assert step.previous == planned(after, applied(before)).steps[0].previous


def test_neither_goes_back_unless_it_is_named() -> None:
    before, after = (robot(app("one"), master={"image": f"x.org/ros:{number}"}) for number in (1, 2))
    there = {name_of(item): [{"revision": "then", "deployment": item}] for item in applied(before).deployments}
    live = applied(after, *(update_map(name, there[name]) for name in ("ros-keeper", "ros-master")))
    assert step_names(planned(after, live, PREVIOUS)) == []
    assert step_names(planned(after, live, Request(to="previous", only=["ros-master"]))) == [["ros-master"]]


def test_apps_of_one_group_are_one_step_in_the_order_of_their_dependencies() -> None:
    before, after = versions(
        app("stats", depends_on=["sensor"], update={"group": "temperature"}),
        app("other"),
        app("sensor", update={"group": "temperature"}),
    )
    plan = planned(after, applied(before))
    assert step_names(plan) == [["sensor", "stats"], ["other"]]  # which waits for what any of its apps depends on
    assert plan.steps[0].name == "temperature"
    assert len(plan.steps[0].renames) == 2


@pytest.mark.parametrize(
    ("wanted", "words"),
    [
        (robot(app("one")), "no app a, b; it has ros-keeper, ros-master, one"),
        (robot(master={"mode": "external", "uri": "http://m:11311"}), "no app a, b; it has none"),
    ],
)
def test_an_unknown_app_is_an_error_that_names_those_there_are(wanted: Robot, words: str) -> None:
    with pytest.raises(SpecError, match=words):
        planned(wanted, applied(robot()), Request(["b", "a"]))


def test_what_belongs_to_the_fleet_is_left_to_the_robot_whose_it_is() -> None:
    before, after = versions(app("planner", scope="fleet"), app("one"), master=SHARED)
    assert step_names(planned(after, applied(before), Request(shared=False))) == [["one"]]
    assert step_names(planned(after, applied(before), Request(shared=True))) == [["planner"], ["one"]]


EXTERNAL = {"mode": "external", "uri": "http://192.0.2.5:11311"}
SHARED = {"mode": "shared"}


def test_what_is_the_fleets_and_at_work_waits_for_what_it_says_though_the_robot_has_no_app_yet() -> None:
    docked, charged = ({"topic": topic, "quiet": 1} for topic in ("/dock", "/battery"))
    night = {"update_when": [charged], "update_windows": [{"from": "01:00", "to": "02:00"}]}
    chart = app("chart", scope="fleet", update={"when": [docked]})
    there, wanted = versions(chart, app("one"), master=SHARED, **night)
    live = applied(there)
    of_fleets = [item for item in live.deployments if item["metadata"]["namespace"] == "fleet"]
    step, install = planned(wanted, replace(live, deployments=of_fleets)).steps
    assert (step.apps, step.when, bool(step.windows)) == (["chart"], [docked], True)
    assert (install.apps, install.kind) == (["one"], "install")


def test_the_keeper_beside_an_external_master_is_no_step_and_no_orphan() -> None:
    seen = robot(app("one"), master=EXTERNAL)
    live = applied(seen)
    assert [item["metadata"]["name"] for item in live.deployments] == ["ros-keeper", "one"]
    plan = planned(seen, live)
    assert (plan.steps, plan.orphans, plan.remnants) == ([], [], [])
    assert step_names(planned(seen, Live())) == [["one"]]


@pytest.mark.parametrize(
    ("space", "request_", "goes"),
    [
        ("robot-robot1", Request(), True),
        ("robot-robot1", Request(only=["ros-master"]), True),
        ("robot-robot1", Request(only=["one"]), False),
        ("robot-robot1", Request(parts=["apps"]), False),
        ("robot-robot1", Request(own=False), False),
        ("robot-robot1", Request(to="previous"), False),
        ("fleet", Request(own=False), True),
        ("fleet", Request(shared=False), False),
    ],
)
def test_an_exporter_of_an_earlier_collection_goes_with_what_its_keeper_brings(
    space: str, request_: Request, goes: bool
) -> None:
    wanted = robot(app("one"))
    beside = workload("ros-exporter", space, "robot1", pod_spec([]), {}, RECREATE_STRATEGY)
    code = config_map("ros-exporter", space, {}, {})
    live = applied(wanted)
    plan = planned(wanted, Live([*live.deployments, beside], [code]), request_)
    assert [*plan.orphans] == []
    assert [item["kind"] for item in plan.remnants] == (["Deployment", "ConfigMap"] if goes else [])


def test_a_step_that_was_cut_off_is_taken_up_again_and_goes_back_to_the_last_proven_version() -> None:
    proven, wanted = robot(app("one")), robot(app("one", "x.org/a:2"))
    live = marked(applied(wanted, update_map("one", [entry(proven, "one")])), "one")
    (step,) = planned(wanted, live).steps
    assert step.resume
    assert step.previous["one"] == entry(proven, "one")["deployment"]
    assert step.before["one"]["image"] == "example.org/app:1.0"
    assert step.unproven == ["one"]
    proven_node = step.previous["one"]["spec"]["template"]["metadata"]["annotations"][names.ANNOTATION_NODE]
    assert step.renames == {proven_node: step.new_nodes["one"]}


def test_back_to_the_previous_version() -> None:
    old, new = robot(app("one"), app("two")), robot(app("one", "x.org/a:2"), app("two"))
    live = applied(new, update_map("one", [entry(old, "one")]))
    plan = planned(new, live, PREVIOUS)
    both = update_map("one", [entry(old, "one"), entry(new, "one")])
    (newer,) = planned(new, applied(old, both), PREVIOUS).steps  # what runs is no way back
    assert newer.after["one"]["image"] == "x.org/a:2"
    named = planned(new, live, Request(["one"], entry(old, "one")["revision"]))
    assert step_names(plan) == step_names(named) == [["one"]]
    assert plan.steps[0].after["one"]["image"] == "example.org/app:1.0"
    assert plan.steps[0].before["one"]["image"] == "x.org/a:2"
    assert plan.steps[0].conditions == {}  # today's inventory says nothing about a version of then
    assert plan.steps[0].histories == {"one": (entry(old, "one"),)}


def test_no_way_back_is_unchanged_for_a_fleet_and_an_error_for_a_named_app() -> None:
    wanted = robot(app("one"))
    assert planned(wanted, applied(wanted), PREVIOUS).steps == []
    with pytest.raises(SpecError, match="app one has no previous revision to go back to; kept: none"):
        planned(wanted, applied(wanted), Request(["one"], "previous"))


def test_an_unknown_revision_is_an_error_that_names_those_there_are() -> None:
    first, second, third = (robot(app("one", f"x.org/a:{number}")) for number in (1, 2, 3))
    bare = {key: value for key, value in entry(first, "one").items() if key != "image"}
    history = update_map("one", [{**entry(second, "one"), "image": "x.org/a:2"}, bare])
    with pytest.raises(SpecError) as error:
        planned(third, applied(third, history), Request(["one"], "12345678"))
    there = f"{entry(second, 'one')['revision']} (x.org/a:2), {bare['revision']} (?)"
    assert str(error.value) == f"robot1: app one has no revision 12345678 to go back to; kept: {there}"


def test_what_somebody_else_set_and_set_back_belongs_to_what_is_kept() -> None:
    """`kubectl set image`, then `rollout undo`: the image is kubectl's, and without it nothing could be applied."""
    item = applied(robot(app("one"))).deployments[-1]
    [ours] = item["metadata"]["managedFields"]
    [container] = ours["fieldsV1"]["f:spec"]["f:template"]["f:spec"]["f:containers"].items()
    key, fields = container
    theirs = {key: {"f:image": fields.pop("f:image")}}
    pods = {"f:spec": {"f:template": {"f:spec": {"f:containers": theirs}}}}
    item["metadata"]["managedFields"].append({"manager": "kubectl", "operation": "Update", "fieldsV1": pods})
    assert kept(item)["spec"]["template"]["spec"]["containers"] == item["spec"]["template"]["spec"]["containers"]


def test_the_way_back_is_never_paused_and_has_nothing_of_the_step_that_brought_it() -> None:
    item = applied(robot(app("one"))).deployments[-1]
    own = dict(item["metadata"]["annotations"])
    item["metadata"]["annotations"] |= {UPDATING: "1", SOAKING: "1", BACK_TO: "image ros-app image=a:1"}
    item["spec"]["paused"] = True
    assert "paused" not in kept(item, whole=True)["spec"]
    assert kept(item, whole=True)["metadata"]["annotations"] == own


def test_a_step_says_all_that_its_phases_need() -> None:
    group, drain = {"group": "motion"}, {"pattern": "action", "readiness": {"actions": ["plan", "~go"]}}
    before, wanted = versions(
        app("light"),
        app("map", readiness={"actions": ["scan"]}, update={**group, "idle": ["dock", "~lift"], "on_busy": "force"}),
        app("drive", **drain, update={**group, "idle": ["dock", "charge"], "on_busy": "defer"}),
        app("arm", **drain, update=group),
    )
    step = planned(wanted, applied(before, update_map("map", []))).steps[-1]
    assert (step.name, step.kind, step.apps, step.handoff) == ("motion", "app", ["map", "drive", "arm"], "drain")
    assert step.rest == ["/dock", "/map/lift", "/plan", "/drive/go", "/charge", "/arm/go"]
    assert step.on_busy == "defer"
    assert step.conditions["nodes"] == list(step.new_nodes.values())
    assert step.objects == [item for item in app_objects(wanted) if app_of(item) in step.apps]
    assert (step.histories, step.unproven, step.resume) == ({"map": ()}, [], False)


def test_an_app_that_moves_to_another_namespace_is_a_new_one() -> None:
    plan = planned(robot(app("planner")), applied(robot(app("planner", scope="fleet"))))
    (created,) = plan.steps[0].created
    metadata = {"name": "planner", "namespace": "robot-robot1"}
    assert created == {"apiVersion": "apps/v1", "kind": "Deployment", "metadata": metadata}
    assert plan.orphans == []  # other robots may have the fleet's


def test_a_node_that_cannot_be_known_is_not_renamed() -> None:
    live = applied(robot(app("one")))
    live.deployments[-1]["spec"]["template"]["metadata"]["annotations"].pop(names.ANNOTATION_NODE)
    (step,) = planned(robot(app("one", "x.org/a:2")), live).steps
    assert (step.old_nodes, step.renames) == ({"one": ""}, {})


@pytest.mark.parametrize(
    ("labels", "containers", "found"),
    [
        ({names.LABEL_REVISION: "abc"}, [{"image": "a:1"}, {"image": "b:1"}], ("a:1", "abc")),
        (None, [{"name": "a"}], ("", "01234567")),
        ({}, [], ("", "01234567")),
    ],
)
def test_a_version_is_told_by_its_image_and_revision(labels: Any, containers: Any, found: tuple[str, str]) -> None:
    metadata = {"labels": labels, "annotations": {names.ANNOTATION_HASH: "0123456789"}}
    template = {"metadata": metadata, "spec": {"containers": containers}}
    assert (*described({"spec": {"template": template}}).values(),) == found


# --- NetworkPolicies that nobody wants any more -----------------------------------------------------------------------

WEB = app("web", ports=[{"name": "http", "port": 80}])
MAP = app("map", scope="fleet", ports=[{"name": "http", "port": 80}])


def gone(before: Robot, now: Robot, running: Robot | None, parts: Sequence[str]) -> list[str]:
    """What goes of the policies that this robot and another one had, while the apps of a third description run."""
    other = network_policies(replace(before, name="robot2", namespace="robot-robot2"))
    there = {(one["metadata"]["namespace"], one["metadata"]["name"]): one for one in other + network_policies(before)}
    read = [one for (namespace, _name), one in there.items() if namespace != "robot-robot2"]
    live = replace(applied(running or now), policies=read)
    plan = planned(now, live, Request(parts=parts))
    return [f"{one['metadata']['namespace']}/{one['metadata']['name']}" for one in plan.remnants]


@pytest.mark.parametrize(
    ("before", "now", "running", "parts", "unwanted"),
    [
        (robot(WEB), robot(WEB), None, PARTS[:-1], []),
        (robot(WEB), robot(app("web")), None, PARTS[:-1], ["robot-robot1/web.ports"]),
        (robot(WEB), robot(), None, PARTS[:-1], ["robot-robot1/web.ports"]),
        (robot(WEB), robot(), None, ["storage"], []),  # a part that has no policies
        (robot(WEB), robot(), robot(WEB), PARTS[:-1], []),  # an app that nobody has taken away stays open
        (robot(WEB, MAP, master=SHARED), robot(WEB, MAP, master=SHARED), None, PARTS[:-1], []),
        # which another robot may have
        (robot(WEB, MAP, master=SHARED), robot(WEB, master=SHARED), None, PARTS[:-1], []),
        (
            robot(MAP, master=SHARED),
            robot(app("map", scope="fleet"), master=SHARED),
            None,
            PARTS[:-1],
            ["fleet/map.ports"],
        ),
        # of two robots, what one admits
        (robot(master=SHARED, admits=["192.0.2.0/24"]), robot(master=SHARED), None, PARTS[:-1], ["fleet/robot-robot1"]),
    ],
)
def test_policies_that_are_not_wanted_any_more(
    before: Robot, now: Robot, running: Robot | None, parts: Sequence[str], unwanted: list[str]
) -> None:
    assert gone(before, now, running, parts) == unwanted
