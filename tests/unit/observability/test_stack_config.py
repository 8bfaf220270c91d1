# SPDX-License-Identifier: GPL-3.0-or-later
"""The configuration files of the stack: that they parse, and that series and lines get the fleet's labels."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.families import MOST
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.configs import (
    APP_OF_POD,
    PATH,
    STREAM_LABELS,
    config,
)
from ansible_collections.rosops.fleet.tests.unit.observability.specs import full

ROBOT = {"profile": "robot", "robot": "robot2", "hub_url": "http://192.0.2.10"}
ALERTS = {"route": {"receiver": "nobody"}}


def relabelled(rules: list[dict[str, Any]], labels: dict[str, str]) -> dict[str, str] | None:
    """What Prometheus makes of a target's labels (relabel.Process); None if it is dropped."""
    found = dict(labels)
    for rule in rules:
        value = rule.get("separator", ";").join(found.get(name, "") for name in rule.get("source_labels", []))
        match = re.fullmatch(str(rule.get("regex", "(.*)")), value, re.DOTALL)
        action = rule.get("action", "replace")
        if (action == "keep" and not match) or (action == "drop" and match):
            return None
        if action == "labeldrop":
            found = {name: text for name, text in found.items() if not re.fullmatch(rule["regex"], name)}
        if action == "replace" and match:
            text = match.expand(re.sub(r"\$(\d)", r"\\\1", rule.get("replacement", "$1")))
            found.pop(rule["target_label"], None)
            if text:
                found[rule["target_label"]] = text
    return found


def shown(labels: dict[str, str] | None) -> dict[str, str]:
    assert labels is not None
    return {name: value for name, value in labels.items() if not name.startswith("__")}


def job(name: str, **settings: Any) -> dict[str, Any]:
    return next(one for one in config("scrape", full(settings))["scrape_configs"] if one["job_name"] == name)


POD = {
    "__address__": "10.42.1.7",
    "__meta_kubernetes_namespace": "robot-robot1",
    "__meta_kubernetes_pod_name": "temperature-7d9f8b6c5d-x2x4z",
    "__meta_kubernetes_pod_phase": "Running",
    "__meta_kubernetes_pod_label_rosops_fleet_robot": "robot1",
    "__meta_kubernetes_pod_label_rosops_fleet_app": "temperature",
    "__meta_kubernetes_pod_annotation_prometheus_io_scrape": "true",
    "__meta_kubernetes_pod_annotation_prometheus_io_port": "9400",
    "__meta_kubernetes_node_label_deploymentType": "local",
}
WHOSE = {
    "robot": "robot1",
    "namespace": "robot-robot1",
    "app": "temperature",
    "pod": "temperature-7d9f8b6c5d-x2x4z",
    "placement": "local",
}


def test_intervals_and_jobs() -> None:
    """A robot reads nothing that Prometheus alone knows."""
    made = config("scrape", full({"alertmanager_config": ALERTS}))
    assert made["global"] == {"scrape_interval": "10s", "evaluation_interval": "10s"}
    assert [one["job_name"] for one in made["scrape_configs"]] == [
        "prometheus", "loki", "grafana", "alertmanager", "node-exporter", "log-shipper", "ros-exporter", "apps",
        "kubelet", "kubelet-probes", "cadvisor", "apiserver",
    ]  # fmt: skip
    made = config("scrape", full(ROBOT))
    assert (set(made), set(made["global"])) == ({"global", "scrape_configs"}, {"scrape_interval"})
    assert [one["job_name"] for one in made["scrape_configs"]] == [
        "vmagent", "node-exporter", "log-shipper", "ros-exporter", "apps", "kubelet-probes", "cadvisor",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("job_name", "change", "labels"),
    [
        ("apps", {}, WHOSE),
        ("apps", {"__meta_kubernetes_pod_annotation_prometheus_io_scrape": "false"}, None),
        ("apps", {"__meta_kubernetes_pod_phase": "Succeeded"}, None),
        ("apps", {"__meta_kubernetes_pod_label_rosops_fleet_app": "ros-keeper"}, None),
        ("ros-exporter", {}, None),
        *(
            ("ros-exporter", {"__meta_kubernetes_pod_label_rosops_fleet_app": pod}, {**WHOSE, "app": pod})
            for pod in ("ros-keeper", "ros-exporter")  # of an earlier collection, which no update has reached yet
        ),
    ],
)
def test_pods_by_their_annotations(job_name: str, change: dict[str, str], labels: dict[str, str] | None) -> None:
    found = job(job_name)
    made = relabelled(found["relabel_configs"], {**POD, **change})
    assert (None if made is None else shown(made)) == labels
    assert made is None or made["__address__"] == "10.42.1.7:9400"
    assert found.get("honor_labels", False) is (job_name == "ros-exporter")


def test_a_pod_of_others_has_its_owners_name_and_no_robot() -> None:
    other = {key: value for key, value in POD.items() if "_label_rosops" not in key}
    other["__meta_kubernetes_namespace"] = "kube-system"
    labels = shown(relabelled(job("apps")["relabel_configs"], other))
    assert labels["app"] == "temperature"
    assert "robot" not in labels
    assert shown(relabelled(job("apps", **ROBOT)["relabel_configs"], other))["robot"] == "robot2"


def test_a_host() -> None:
    node = {
        "__meta_kubernetes_namespace": "observability",
        "__meta_kubernetes_pod_name": "node-exporter-x2x4z",
        "__meta_kubernetes_pod_label_rosops_fleet_app": "node-exporter",
        "__meta_kubernetes_pod_container_port_name": "http",
        "__meta_kubernetes_pod_node_name": "robot1",
        "__meta_kubernetes_node_label_rosops_fleet_robot": "robot1",
        "__meta_kubernetes_node_label_deploymentType": "local",
    }
    found = relabelled(job("node-exporter")["relabel_configs"], node)
    assert shown(found) == {"node": "robot1", "instance": "robot1", "robot": "robot1", "placement": "local"}


TALKER = {"namespace": "robot-r1", "pod": "talker-7d9f8b6c5d-x2x4z"}
MAP = {"namespace": "fleet", "pod": "map-7d9f8b6c5d-x2x4z"}


@pytest.mark.parametrize(
    ("series", "robot", "wanted"),
    [
        ({**TALKER, "robot": "r1"}, "", {"robot": "r1", "app": "talker"}),
        (TALKER, "", {"robot": "r1", "app": "talker"}),
        ({**MAP, "robot": "r9"}, "", {"app": "map"}),  # a pod of the fleet that runs on robot r9
        ({**MAP, "robot": "r2"}, "r2", {"robot": "r2", "app": "map"}),
        ({"robot": "r1"}, "", {"robot": "r1"}),
    ],
)
def test_containers(series: dict[str, str], robot: str, wanted: dict[str, str]) -> None:
    rules = job("kubelet-probes", robot=robot)["metric_relabel_configs"]
    found = shown(relabelled(rules, {"__name__": "prober_probe_total", **series}))
    assert {name: value for name, value in found.items() if name in ("robot", "app")} == wanted


def test_cadvisor_keeps_pods_and_the_whole_host() -> None:
    rules = job("cadvisor")["metric_relabel_configs"]
    memory = {"__name__": "container_memory_working_set_bytes"}
    pod = {**memory, "namespace": "robot-r1", "pod": "a-1", "container": "", "id": "/kubepods/x"}
    assert relabelled(rules, pod) is not None
    assert relabelled(rules, {**memory, "id": "/"}) is not None
    assert relabelled(rules, {**memory, "id": "/system.slice/ssh.service"}) is None
    assert relabelled(rules, {**pod, "container": "a", "id": "/kubepods/x/a"}) is None  # else sums count twice
    assert relabelled(rules, {**pod, "__name__": "container_tasks_state"}) is None
    assert relabelled(rules, {**pod, "__name__": "container_network_receive_bytes_total"}) is not None
    assert relabelled(rules, {**pod, "__name__": "container_oom_events_total", "container": "a"}) is not None


@pytest.mark.parametrize(
    ("pod", "app"),
    [
        ("temperature-7d9f8b6c5d-x2x4z", "temperature"),
        ("temperature-stats-6c9d8f7b54-qwzxt", "temperature-stats"),
        ("add-2-7d9f8b6c5d-x2x4z", "add-2"),
        ("node-exporter-x2x4z", "node-exporter"),
        ("db-0", "db"),
        ("kube-apiserver-edge1", "kube-apiserver-edge1"),
        ("robot", "robot"),
    ],
)
def test_the_app_of_a_pods_name(pod: str, app: str) -> None:
    match = re.fullmatch(APP_OF_POD, pod)
    assert match and match["app"] == app


def test_the_parts_of_a_log_files_path() -> None:
    path = "/var/log/pods/robot-robot1_talker-7d9f8b6c5d-x2x4z_0b1c-22/ros-app/0.log"
    match = re.fullmatch(PATH, path)
    parts = {"namespace": "robot-robot1", "pod": "talker-7d9f8b6c5d-x2x4z", "container": "ros-app"}
    assert match and match.groupdict() == parts


def test_shipper_and_loki_agree_on_the_labels() -> None:
    spec = full({"remote_nodes": ["edge1"]})
    limits = config("loki", spec)["limits_config"]
    indexed = limits["otlp_config"]["resource_attributes"]
    assert indexed["ignore_defaults"]
    assert indexed["attributes_config"][0]["attributes"] == list(STREAM_LABELS)
    assert limits["allow_structured_metadata"]
    assert limits["discover_service_name"] == []
    shipper = config("otelcol", spec)
    assert "$" not in json.dumps(shipper)  # which it would expand
    text = json.dumps(shipper["receivers"]["filelog"]["operators"])
    assert "resource.placement" in text
    for label in ("namespace", "pod", "container", "robot", "app"):
        assert f"(?P<{label}>" in text


def test_the_collector_loses_nothing() -> None:
    made = config("otelcol", full({}))
    exporter, receiver = made["exporters"]["otlphttp"], made["receivers"]["filelog"]
    assert exporter["sending_queue"]["storage"] in made["service"]["extensions"]
    assert receiver["storage"] in made["service"]["extensions"]
    assert exporter["retry_on_failure"]["max_elapsed_time"] == receiver["retry_on_failure"]["max_elapsed_time"] == "0s"
    # a batch, or a line, in memory alone would be lost with the process
    assert "container" not in [one["type"] for one in receiver["operators"]]
    assert made["service"]["pipelines"]["logs"]["processors"] == ["memory_limiter", "transform"]
    assert receiver["start_at"] == "beginning"


def test_a_robots_own_cluster_names_the_robot() -> None:
    made = config("otelcol", full(ROBOT))
    assert made["exporters"]["otlphttp"]["logs_endpoint"] == "http://192.0.2.10:30100/otlp/v1/logs"
    operators = made["receivers"]["filelog"]["operators"]
    assert {"type": "add", "field": "resource.robot", "value": "robot2"} in operators


@pytest.mark.parametrize(("profile", "window"), [("standalone", None), ("hub", "14d")])
def test_a_hub_takes_samples_as_old_as_it_keeps_them(profile: str, window: str | None) -> None:
    storage = config("scrape", full({"profile": profile, "prometheus": {"retention": "14d"}})).get("storage", {})
    assert storage.get("tsdb", {}).get("out_of_order_time_window") == window


def test_loki_keeps_and_takes_as_long_as_it_is_told() -> None:
    made = config("loki", full({"loki": {"retention": "14d"}}))
    assert made["compactor"]["retention_enabled"] is True
    limits = made["limits_config"]
    assert (limits["retention_period"], limits["reject_old_samples_max_age"]) == ("14d", "14d")


def test_data_sources_have_the_uids_that_dashboards_name() -> None:
    sources = config("grafana", full({"alertmanager_config": ALERTS}))["datasources.yml"]["datasources"]
    assert {one["uid"]: one["url"] for one in sources} == {
        "prometheus": "http://prometheus.observability:9090",
        "loki": "http://loki.observability:3100",
        "alertmanager": "http://alertmanager.observability:9093",
    }
    assert [one["name"] for one in sources if one.get("isDefault")] == ["Prometheus"]
    alone = config("grafana", full({"prometheus": {"enabled": False}}))["datasources.yml"]["datasources"]
    assert [(one["name"], one["isDefault"]) for one in alone] == [("Loki", True)]


def test_no_pod_can_fill_the_database() -> None:
    """A look at a pod has an end; the exporter's own bound is below it, so that what it shows is always taken."""
    for settings in ({}, ROBOT):
        assert job("ros-exporter", **settings)["sample_limit"] > MOST
        assert job("apps", **settings)["sample_limit"] > 0
    assert {job(name)["label_limit"] for name in ("ros-exporter", "apps")} == {64}
