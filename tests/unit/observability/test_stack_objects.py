# SPDX-License-Identifier: GPL-3.0-or-later
"""The observability stack's objects: golden files, the API's own schema, and the promises that no example shows."""

from __future__ import annotations

import base64
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.formats import quantity_value
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import stack as observability
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.configs import yaml_text
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.files import Files, stack_files
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.spec import images
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Object
from ansible_collections.rosops.fleet.tests.unit.api_schema import fits_the_api
from ansible_collections.rosops.fleet.tests.unit.observability import regenerate_stack as stack
from ansible_collections.rosops.fleet.tests.unit.observability.specs import full, templates

HERE = Path(__file__).resolve().parent
DATA = ("PersistentVolumeClaim", "Secret", "Namespace")
HASH = "rosops.fleet/config-hash"


def find(objects: list[Object], kind: str, name: str) -> Object:
    [found] = [one for one in objects if (one["kind"], one["metadata"]["name"]) == (kind, name)]
    return found


def hashes(spec: dict[str, Any], files: Files = stack.FILES) -> dict[str, str]:
    """The hash of every pod's configuration, by workload."""
    found = templates(observability.stack_objects(full(spec), files))
    return {name: one["metadata"]["annotations"][HASH] for name, one in found.items()}


def keys(objects: list[Object]) -> list[tuple[str, str]]:
    return [(one["kind"], one["metadata"]["name"]) for one in objects]


@pytest.mark.parametrize("name", stack.SPECS)
def test_what_is_applied(name: str) -> None:
    """As the golden file has it, and as the API takes it; all text is that of what it says.

    The images that are told are those that run, and what is to be deleted is never data, nor what is wanted.
    """
    text = (HERE / "golden" / f"{name}.yml").read_text("utf-8")
    assert stack.golden(name) == yaml.safe_load(text)
    made = stack.built(stack.SPECS[name])
    assert len(set(keys(made))) == len(made)
    for one in made:
        fits_the_api(one)
        for file, said in one["data"].items() if one["kind"] == "ConfigMap" else ():
            assert not file.endswith(".yml") or yaml_text(yaml.safe_load(said)) == said
    pods = [one["spec"] for one in templates(made).values()]
    used = {one["image"] for pod in pods for one in [*pod.get("initContainers", []), *pod["containers"]]}
    assert sorted(used) == images(full(stack.SPECS[name]))
    assert "subPath" not in json.dumps(made)  # by which changes would not arrive
    left = {*keys(observability.leftovers(full(stack.SPECS[name]), made))}
    assert not {*keys(made)} & left
    assert not {kind for kind, _name in left} & {*DATA}


@pytest.mark.parametrize("size", ["600Mi", "1Gi", "8Gi", "10G", "1Ti", "1500M", "2.5Gi"])
def test_retention_by_size_is_below_the_claim(size: str) -> None:
    objects = observability.stack_objects(full({"prometheus_size": size}), stack.FILES)
    args = templates(objects)["prometheus"]["spec"]["containers"][0]["args"]
    [found] = [one for one in args if one.startswith("--storage.tsdb.retention.size=")]
    assert 0 < int(found.partition("size=")[2].removesuffix("MB")) * 2**20 <= 0.85 * float(quantity_value(size) or 0)
    assert find(objects, "PersistentVolumeClaim", "prometheus")["spec"]["resources"]["requests"]["storage"] == size


def test_the_seeds_values_are_the_defaults() -> None:
    spec = full({})
    scrape = {"scrape_interval": "10s", "evaluation_interval": "10s"}
    assert spec["prometheus"] == {"enabled": True, "retention": "7d", **scrape}
    assert spec["loki"] == {"enabled": True, "retention": "7d", "persistence": {"enabled": True, "size": "5Gi"}}
    assert spec["grafana"]["service_type"] == "NodePort"
    assert spec["grafana"]["persistence"] == {"enabled": True, "size": "2Gi"}


def test_secrets_are_in_secrets_only() -> None:
    """And whole: a null in Alertmanager's file stays."""
    receiver = {"name": "x", "webhook_configs": [{"url": "https://hush.example.org"}]}
    config = {"receivers": [receiver], "route": {"receiver": "x", "routes": None}}
    spec = full({"alertmanager_config": config})
    assert "hush" not in json.dumps(observability.stack_objects(spec, stack.FILES))
    admin, alerts = observability.stack_secrets(spec, {"password": "hush", "version": "1"})
    assert (admin["metadata"]["name"], alerts["metadata"]["name"]) == ("grafana-admin", "alertmanager")
    assert base64.b64decode(admin["data"]["password"]) == b"hush"
    assert yaml.safe_load(base64.b64decode(alerts["data"]["alertmanager.yml"])) == config


@pytest.mark.parametrize(
    ("there", "given", "password"),
    [
        (None, "", "RANDOM-RANDOM-RANDOM-RANDOM-"),
        (None, "mine", "mine"),
        (("theirs", "v7"), "", "theirs"),
        (("theirs", "v7"), "theirs", "theirs"),
        (("theirs", "v7"), "mine", "mine"),
        (("theirs", ""), "", "theirs"),
    ],
)
def test_the_password_is_stable(there: tuple[str, str] | None, given: str, password: str) -> None:
    known = [base64.b64encode(text.encode()).decode() for text in there or ()]
    secret = {"data": dict(zip(("password", "version"), known))} if there else None
    admin = observability.grafana_admin(secret, given, "VERSION1" + "RANDOM-" * 4)
    kept = there is not None and there[1] != "" and given in ("", there[0])
    assert admin == {"password": password, "version": there[1] if kept and there else "VERSION1"}


def test_a_new_password_restarts_grafana_alone() -> None:
    before, after = (templates(observability.stack_objects(full({}), stack.FILES, version)) for version in ("v1", "v2"))
    assert {name for name in before if before[name] != after[name]} == {"grafana"}


@pytest.mark.parametrize(
    ("change", "restarted"),
    [
        ({"prometheus": {"scrape_interval": "15s"}}, {"prometheus", "grafana"}),
        ({"prometheus": {"evaluation_interval": "15s"}}, {"prometheus"}),
        ({"loki": {"retention": "14d"}}, {"loki"}),
        ({"remote_nodes": ["edge1"]}, {"log-shipper"}),
        ({"allowed_networks": ["192.0.2.0/24"]}, set()),
    ],
)
def test_a_change_restarts_who_reads_it(change: dict[str, Any], restarted: set[str]) -> None:
    before, after = hashes({}), hashes(change)
    assert {name for name in before if before[name] != after[name]} == restarted


def test_a_rule_restarts_prometheus_and_a_dashboard_nobody() -> None:
    rule = replace(stack.FILES, rules={"ros.yml": "groups: [] # new\n"})
    assert {name for name, value in hashes({}, rule).items() if value != hashes({})[name]} == {"prometheus"}
    boards = replace(stack.FILES, dashboards={"Fleet": {"fleet.json": '{"new": 1}'}, "Own": {"my-robot.json": "{}"}})
    assert hashes({}, boards) == hashes({})


def test_dashboards_are_mounted_and_none_is_an_empty_directory() -> None:
    none, own = (observability.stack_objects(full({}), files) for files in (Files(), stack.FILES))
    assert find(none, "ConfigMap", "prometheus-rules")["data"] == {}
    sources = [{"configMap": {"name": "dashboard-fleet"}}]
    for objects, volume in ((none, {"emptyDir": {}}), (own, {"projected": {"sources": sources}})):
        assert {"name": "dashboards-fleet", **volume} in templates(objects)["grafana"]["spec"]["volumes"]
    for wanted in (True, False):  # the default ones can be left out
        objects = observability.stack_objects(full({}), stack_files([], "", wanted))
        assert ("dashboard-fleet" in [one["metadata"]["name"] for one in objects]) is wanted


def test_an_allow_list_that_nobody_wants_any_more_goes() -> None:
    assert ("NetworkPolicy", "grafana") in keys(observability.leftovers(full({}), stack.built({})))


def test_from_hub_to_robot_nothing_runs_on() -> None:
    hub, robot = (stack.built(stack.SPECS[name]) for name in ("hub", "robot"))
    gone = {*keys(hub)} - {*keys(robot), *keys(observability.leftovers(full(stack.SPECS["robot"]), robot))}
    assert [name for kind, name in gone if kind not in DATA and "dashboard" not in name] == []


def test_no_shipper_where_nobody_takes_lines_and_a_robots_profile_needs_a_hub() -> None:
    for spec in ({"loki": {"enabled": False}}, {"log_shipper": "none"}):
        assert "log-shipper" not in hashes(spec)
    with pytest.raises(SpecError, match="observability_hub_url"):
        observability.stack_objects(full({"profile": "robot", "robot": "r1"}), Files())


def reached(objects: list[Object]) -> dict[str, Any]:
    """Part -> who reaches its port."""
    policies = [one for one in objects if one["kind"] == "NetworkPolicy"]
    assert all(len(one["spec"]["ingress"]) == 1 for one in policies)
    return {one["metadata"]["name"]: one["spec"]["ingress"][0]["from"] for one in policies}


def test_open_ports_and_who_may_reach_them() -> None:
    plain, hub = observability.stack_objects(full({}), Files()), stack.built(stack.SPECS["hub"])
    services = {one["metadata"]["name"]: one["spec"] for one in hub if one["kind"] == "Service"}
    ports = {name: spec["ports"][0].get("nodePort") for name, spec in services.items()}
    assert ports == {"prometheus": 30090, "loki": 30100, "grafana": 30300}
    own, all_pods, named = {"podSelector": {}}, {"namespaceSelector": {}}, {"ipBlock": {"cidr": "192.0.2.0/24"}}
    allowed = observability.stack_objects(full({"allowed_networks": ["192.0.2.0/24"]}), Files())
    assert reached(plain) == {"prometheus": [own], "loki": [own]}  # and Grafana by whoever has its password
    assert reached(allowed) == {"prometheus": [own], "loki": [own], "grafana": [all_pods, named]}
    assert reached(hub) == {"prometheus": [own, named], "loki": [own, named], "grafana": [all_pods, named]}
    assert reached(stack.built(stack.SPECS["robot"])) == {"vmagent": [own]}
    # the caller's own address is what the policy is about
    assert {spec["externalTrafficPolicy"] for spec in services.values()} == {"Local"}


def test_overrides_come_last() -> None:
    more = {"name": "loki", "resources": {"limits": {"memory": "1Gi"}}}
    patch = {"spec": {"template": {"spec": {"containers": [more]}}}}
    objects = observability.stack_objects(full({"overrides": {"loki": patch}}), stack.FILES)
    container = templates(objects)["loki"]["spec"]["containers"][0]
    assert container["resources"]["limits"] == {"memory": "1Gi"}
    assert container["image"].startswith("grafana/loki")
