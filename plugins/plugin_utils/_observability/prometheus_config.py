# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""prometheus.yml, and what of it vmagent reads: jobs that find their targets through the Kubernetes API. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._exporter import bounds
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import names as obs
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import prometheus_keep as kept
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.prometheus_relabel import (
    Rule,
    annotation,
    meta_label,
    of_container,
    of_node,
    of_pod,
    take,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.spec import runs

Spec = Mapping[str, Any]
Job = dict[str, Any]

RULES_DIR = "/etc/prometheus-rules"
ACCOUNT = "/var/run/secrets/kubernetes.io/serviceaccount"
# What a pod may show in one look, by job: more than the exporter does (`bounds.MOST`, and a claim or update here and
# there), and more than an app has a use for. A pod with more is one whose look failed, and not the end of the database.
SAMPLES = {obs.ROS_EXPORTER: bounds.MOST + 5_000, "apps": 50_000}
LABELS = {"label_limit": 64, "label_name_length_limit": 256, "label_value_length_limit": 2048}
# Jobs of one and the same discovery share its watches.
PODS = {"role": "pod", "attach_metadata": {"node": True}}
NODES = {"role": "node"}
GONE = {"source_labels": ["__meta_kubernetes_pod_phase"], "regex": "Succeeded|Failed", "action": "drop"}
SCRAPED = {"source_labels": [annotation("prometheus.io/scrape")], "regex": "true", "action": "keep"}


def prometheus_config(spec: Spec) -> dict[str, Any]:
    """prometheus.yml; spec is complete."""
    prometheus = spec["prometheus"]
    config: dict[str, Any] = {
        "global": {
            "scrape_interval": prometheus["scrape_interval"],
            "evaluation_interval": prometheus["evaluation_interval"],
        },
        "rule_files": [f"{RULES_DIR}/*.yml"],
    }
    if runs(spec)[obs.ALERTMANAGER]:
        target = f"{obs.ALERTMANAGER}.{obs.NAMESPACE}:{obs.PORTS[obs.ALERTMANAGER]}"
        config["alerting"] = {"alertmanagers": [{"static_configs": [{"targets": [target]}]}]}
    if spec["profile"] == obs.HUB:
        # robots send what they kept while their link was down
        config["storage"] = {"tsdb": {"out_of_order_time_window": spec["out_of_order_window"]}}
    parts = (obs.PROMETHEUS, obs.LOKI, obs.GRAFANA, obs.ALERTMANAGER)
    config["scrape_configs"] = [*_own_jobs(spec, parts), *_pod_jobs(spec, LABELS), *_node_jobs(spec), _apis(spec)]
    return config


def vmagent_config(spec: Spec) -> dict[str, Any]:
    """What vmagent scrapes on a robot. Not the kubelet's and the API server's own series: each look at them makes
    several megabytes of text on k3s, which has all of its parts in one registry. Labels are limited where they are sent
    to: not every vmagent knows how."""
    return {
        "global": {"scrape_interval": spec["prometheus"]["scrape_interval"]},
        "scrape_configs": [*_own_jobs(spec, (obs.VMAGENT,)), *_pod_jobs(spec, {}), _probes(spec), _cadvisor(spec)],
    }


def _own_jobs(spec: Spec, parts: tuple[str, ...]) -> list[Job]:
    wanted = runs(spec)
    jobs = [_part_job(name, of_pod(spec["robot"])) for name in parts if wanted[name]]
    by_node = {"source_labels": ["__meta_kubernetes_pod_node_name"], "target_label": "node"}
    if wanted[obs.NODE_EXPORTER]:
        instance = {"source_labels": ["__meta_kubernetes_pod_node_name"], "target_label": "instance"}
        jobs.append(_part_job(obs.NODE_EXPORTER, [*of_node(spec["robot"]), by_node, instance]))
    if wanted[obs.SHIPPER]:
        jobs.append(_part_job(obs.SHIPPER, [*of_pod(spec["robot"]), by_node]))
    return jobs


def _part_job(name: str, labels: list[Rule]) -> Job:
    """A part of the stack, by its pods' label and the one port that they name."""
    return {
        "job_name": name,
        "kubernetes_sd_configs": [PODS],
        "relabel_configs": [
            {
                "source_labels": ["__meta_kubernetes_namespace", meta_label("pod", names.LABEL_APP)],
                "separator": "/",
                "regex": f"{obs.NAMESPACE}/{name}",
                "action": "keep",
            },
            {"source_labels": ["__meta_kubernetes_pod_container_port_name"], "regex": obs.HTTP, "action": "keep"},
            GONE,
            *labels,
        ],
    }


def _pod_jobs(spec: Spec, limits: Mapping[str, int]) -> list[Job]:
    """The ROS exporters, and every other pod whose annotations ask for it. `limits` of what their labels may be."""
    app = meta_label("pod", names.LABEL_APP)
    where = [
        take(annotation("prometheus.io/scheme"), "__scheme__"),
        take(annotation("prometheus.io/path"), "__metrics_path__"),
        {
            # a pod that declares no port has an address without one
            "source_labels": ["__address__", annotation("prometheus.io/port")],
            "regex": r"(.+?)(?::\d+)?;(\d+)",
            "target_label": "__address__",
            "replacement": "$1:$2",
        },
    ]
    return [
        {
            "job_name": job,
            "sample_limit": SAMPLES[job],
            **limits,
            **({"honor_labels": True} if action == "keep" else {}),
            "kubernetes_sd_configs": [PODS],
            "relabel_configs": [
                SCRAPED,
                {"source_labels": [app], "regex": obs.ROS_EXPORTER, "action": action},
                GONE,
                *where,
                *of_pod(spec["robot"]),
            ],
        }
        # the exporter's series about an update carry the updated app's name as `app`
        for job, action in ((obs.ROS_EXPORTER, "keep"), ("apps", "drop"))
    ]


def _node_jobs(spec: Spec) -> list[Job]:
    return [_kubelet(spec), _probes(spec), _cadvisor(spec)]


def _node_job(name: str, spec: Spec, metrics: list[Rule]) -> Job:
    node = "__meta_kubernetes_node_name"
    return {
        "job_name": name,
        **_secured(),
        "kubernetes_sd_configs": [NODES],
        "relabel_configs": [
            *of_node(spec["robot"]),
            {"source_labels": [node], "target_label": "node"},
            {"source_labels": [node], "target_label": "instance"},
        ],
        "metric_relabel_configs": metrics,
    }


def _kubelet(spec: Spec) -> Job:
    return _node_job("kubelet", spec, [kept.keep(kept.KUBELET)])


def _probes(spec: Spec) -> Job:
    """The kubelet's counts of readiness probes, pod by pod; a path of its own, the same job."""
    job = _node_job("kubelet-probes", spec, [kept.keep(kept.PROBES), *of_container(spec["robot"])])
    job["relabel_configs"].append({"target_label": "job", "replacement": "kubelet"})
    return {**job, "metrics_path": "/metrics/probes"}


def _cadvisor(spec: Spec) -> Job:
    metrics = [
        kept.keep(kept.CADVISOR),
        # of the host's own cgroups the whole host's is kept
        {"source_labels": ["pod", "id"], "separator": "@", "regex": "@/.+", "action": "drop"},
        # a pod's own cgroup says the sum of its containers, which most pods have one of
        {
            "source_labels": ["__name__", "pod", "container"],
            "separator": "/",
            "regex": "container_(?:cpu|memory)_.*/.+/.+",
            "action": "drop",
        },
        {"regex": "name|image", "action": "labeldrop"},
        *of_container(spec["robot"]),
    ]
    return {**_node_job("cadvisor", spec, metrics), "metrics_path": "/metrics/cadvisor"}


def _apis(spec: Spec) -> Job:
    secured = _secured()
    secured["tls_config"]["server_name"] = "kubernetes.default.svc"
    return {
        "job_name": "apiserver",
        **secured,
        "kubernetes_sd_configs": [{"role": "endpoints", "namespaces": {"names": ["default"]}}],
        "relabel_configs": [
            {
                "source_labels": ["__meta_kubernetes_service_name", "__meta_kubernetes_endpoint_port_name"],
                "regex": "kubernetes;https",
                "action": "keep",
            },
            *([{"target_label": "robot", "replacement": spec["robot"]}] if spec["robot"] else []),
        ],
        "metric_relabel_configs": [kept.keep(kept.APISERVER)],
    }


def _secured() -> dict[str, Any]:
    return {
        "scheme": "https",
        "authorization": {"credentials_file": f"{ACCOUNT}/token"},
        "tls_config": {"ca_file": f"{ACCOUNT}/ca.crt"},
    }
