# SPDX-License-Identifier: GPL-3.0-or-later
"""What somebody changed by hand: what is suspected, and what is none of it."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._step.record import record_of
from ansible_collections.rosops.fleet.plugins.module_utils._step.words import BACK_TO
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import PARTS, workload_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.revisions import lost_services, suspects
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Live
from ansible_collections.rosops.fleet.tests.unit.robots import robot
from ansible_collections.rosops.fleet.tests.unit.simulated.objects import app, applied, marked

ROBOT = robot(app("sensor", resources={"limits": {"cpu": "1000m"}}, env={"A": "1", "EMPTY": ""}))


def found(change: Callable[[dict[str, Any]], Any]) -> list[str]:
    live = copy.deepcopy(applied(ROBOT))
    sensor = next(item for item in live.deployments if item["metadata"]["name"] == "sensor")
    change(sensor)  # type: ignore[arg-type]
    return [item["metadata"]["name"] for item in suspects(app_objects(ROBOT), live)]


@pytest.mark.parametrize("proven", [False, True])
def test_what_a_step_applies_again_anyway_is_not_suspected_and_a_mark_alone_is_no_step(proven: bool) -> None:
    live = marked(copy.deepcopy(applied(ROBOT)), "sensor")
    sensor = next(item for item in live.deployments if item["metadata"]["name"] == "sensor")
    sensor["spec"]["replicas"] = 0  # type: ignore[index] # of a copy
    (record,) = (record_of(item) for item in live.maps)
    if proven:
        live = replace(live, maps=[{**live.maps[0], "data": record.fulfilled().data()}])
    assert [item["metadata"]["name"] for item in suspects(app_objects(ROBOT), live)] == ["sensor"] * proven


def test_what_a_step_noted_is_no_change_by_hand() -> None:
    """A keeper of an earlier collection takes its mark off, and leaves what is beside it."""
    live, (wanted,) = copy.deepcopy(applied(ROBOT)), app_objects(ROBOT)
    sensor = next(item for item in live.deployments if item["metadata"]["name"] == "sensor")
    own, note = wanted["metadata"]["annotations"], {BACK_TO: "image ros-app image=a:1"}
    sensor["metadata"].update(annotations={**own, **note, "theirs": "x"})
    container(sensor).update(resources={"limits": {"cpu": "1"}})  # as the API server says the same
    (asked,) = suspects([wanted], live)
    assert asked == {**wanted, "metadata": {**wanted["metadata"], "annotations": {**own, **note}}}


def by(item: dict[str, Any], manager: str, fields: dict[str, Any], subresource: str = "") -> None:
    """An update as the API server keeps it: fields below `spec` in FieldsV1's form."""
    entry = {"manager": manager, "operation": "Update", "apiVersion": "apps/v1", "time": "2026-11-22T10:00:00Z"}
    more = {"subresource": subresource} if subresource else {}
    item["metadata"]["managedFields"].append(
        {**entry, "fieldsType": "FieldsV1", "fieldsV1": {"f:spec": fields}, **more}
    )


def in_pod(fields: dict[str, Any]) -> dict[str, Any]:
    return {"f:template": {"f:spec": fields}}


def in_container(fields: dict[str, Any]) -> dict[str, Any]:
    return in_pod({"f:containers": {'k:{"name":"ros-app"}': fields}})


def container(item: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = pod(item)["containers"][0]
    return found


def pod(item: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = item["spec"]["template"]["spec"]
    return found


VARIABLE = {"f:env": {'k:{"name":"DEBUG"}': {".": {}, "f:name": {}, "f:value": {}}}}
SIDECAR = {"f:containers": {'k:{"name":"shell"}': {".": {}, "f:image": {}, "f:name": {}, "f:resources": {}}}}
TEAM = {"f:template": {"f:metadata": {"f:labels": {"f:team": {}}}}}
RESTARTED = {"f:template": {"f:metadata": {"f:annotations": {"f:kubectl.kubernetes.io/restartedAt": {}}}}}


def unchanged(_item: dict[str, Any]) -> None:
    """Fields alone."""


def taken_over(item: dict[str, Any]) -> None:
    """By a run that did not come to apply it."""
    item["spec"]["paused"] = True
    item["metadata"]["managedFields"][0]["fieldsV1"]["f:spec"]["f:paused"] = {}


@pytest.mark.parametrize(
    ("manager", "fields", "change"),
    [
        # beside what is ours
        ("kubectl-set", in_container(VARIABLE), lambda item: container(item)["env"].append({"name": "DEBUG"})),
        ("kubectl-edit", in_pod(SIDECAR), lambda item: pod(item)["containers"].append({"name": "shell"})),
        ("kubectl-rollout", {"f:paused": {}}, lambda item: item["spec"].update(paused=True)),
        ("kubectl-patch", in_pod({"f:hostNetwork": {}}), lambda item: pod(item).update(hostNetwork=True)),
        # a selector of nodes is one field
        ("rancher", in_pod({"f:nodeSelector": {}}), lambda item: pod(item)["nodeSelector"].update(disk="ssd")),
        ("kubectl-label", TEAM, lambda item: item["spec"]["template"]["metadata"]["labels"].update(team="a")),
        # what is ours, by its value
        ("", {}, taken_over),
        ("", {}, lambda item: item["spec"].update(replicas=0)),
        ("", {}, lambda item: container(item).update(image="x.org/by-hand:1")),
        ("", {}, lambda item: container(item).update(args=["other"])),
        ("", {}, lambda item: container(item)["env"].pop(0)),
        ("", {}, lambda item: container(item)["env"][-1].update(value="other")),
        ("", {}, lambda item: pod(item).pop("readinessGates")),
    ],
)
def test_what_somebody_changed_by_hand_is_suspected(
    manager: str, fields: dict[str, Any], change: Callable[[dict[str, Any]], Any]
) -> None:
    assert found(lambda item: (change(item), by(item, manager, fields) if manager else None)) == ["sensor"]


def told_by_the_controller(item: dict[str, Any]) -> None:
    fields = {
        "f:metadata": {"f:annotations": {"f:deployment.kubernetes.io/revision": {}}},
        "f:status": {"f:availableReplicas": {}, "f:conditions": {".": {}}},
    }
    entry = {"manager": "k3s", "operation": "Update", "subresource": "status", "fieldsV1": fields}
    item["metadata"]["managedFields"].append(entry)


@pytest.mark.parametrize(
    ("manager", "fields", "subresource", "change"),
    [
        # whoever has set what is ours to what it is
        ("kubectl-set", in_container({"f:image": {}, "f:env": {'k:{"name":"A"}': {"f:value": {}}}}), "", unchanged),
        ("k3s", {"f:replicas": {}}, "scale", unchanged),  # an autoscaler
        ("", {}, "", told_by_the_controller),
        ("kubectl-edit", in_container({"f:env": {".": {}}}), "", unchanged),  # of entries that are gone again
        ("kubectl-rollout", RESTARTED, "", unchanged),  # restart
        # defaults, and what others add
        ("", {}, "", lambda item: item.update(status={})),
        ("", {}, "", lambda item: container(item).update(terminationMessagePath="/dev/termination-log")),
        ("", {}, "", lambda item: container(item)["env"].append({"name": "INJECTED", "value": "1"})),
        ("", {}, "", lambda item: [one.pop("value") for one in container(item)["env"] if one.get("value") == ""]),
        ("", {}, "", lambda item: item["metadata"]["annotations"].update({names.ANNOTATION_HASH: "another version"})),
    ],
)
def test_what_others_write_and_what_is_well_again_is_not(
    manager: str, fields: dict[str, Any], subresource: str, change: Callable[[dict[str, Any]], Any]
) -> None:
    assert found(lambda item: (change(item), by(item, manager, fields, subresource) if manager else None)) == []


def services(change: Callable[[dict[str, Any]], Any]) -> list[str]:
    """Names of Services to apply again; the change is of `ros-master`, or of the lists of what is there."""
    wanted = workload_objects(ROBOT, PARTS)
    there = {
        item["metadata"]["name"]: {
            **item,
            "metadata": {**item["metadata"], "managedFields": []},
            "spec": {**copy.deepcopy(item["spec"]), "clusterIP": "10.43.0.1", "sessionAffinity": "None"},
        }
        for item in wanted
        if item["kind"] == "Service"
    }
    change(there)
    live = Live(applied(ROBOT).deployments, (), list(there.values()))
    return [item["metadata"]["name"] for item in lost_services(wanted, live)]


def test_a_service_that_is_gone_or_leads_elsewhere_is_lost() -> None:
    assert services(lambda _there: None) == []
    assert services(lambda there: there.pop("ros-master")) == ["ros-master"]
    assert services(lambda there: there["ros-master"]["spec"]["selector"].clear()) == ["ros-master"]
    assert services(lambda there: there["ros-keeper"]["spec"]["ports"][0].update(port=1)) == ["ros-keeper"]

    def selects_less(there: dict[str, Any]) -> None:
        there["ros-master"]["spec"]["selector"]["by"] = "hand"
        by(there["ros-master"], "kubectl-edit", {"f:selector": {}})

    assert services(selects_less) == ["ros-master"]


def test_services_of_what_does_not_run_come_with_it() -> None:
    assert lost_services(workload_objects(ROBOT, PARTS), Live()) == []
