# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What Prometheus, or vmagent on a robot, scrapes. Pure.

Jobs find their targets through the Kubernetes API. What that says about a target becomes the fleet's labels: robot,
namespace, app, pod, placement, node.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping, Sequence

from ...module_utils._exporter import families
from .._model import names
from . import names as obs
from .pod_labels import APP_OF_POD, ROBOT_OF_NAMESPACE
from .spec import Spec, runs
from .templates import Config, filled

ACCOUNT = "/var/run/secrets/kubernetes.io/serviceaccount"
# What a pod may show in one look, by job: more than the exporter does (`families.MOST`, and a claim or update here and
# there), and more than an app has a use for. A pod with more is one whose look failed, and not the end of the database.
SAMPLES = {obs.ROS_EXPORTER: families.MOST + 5_000, "apps": 50_000}
LABELS = {"label_limit": 64, "label_name_length_limit": 256, "label_value_length_limit": 2048}
# Jobs of one and the same discovery share its watches.
PODS = {"role": "pod", "attach_metadata": {"node": True}}
NODES = {"role": "node"}


def prometheus_config(spec: Spec) -> Config:
    """prometheus.yml."""
    prometheus = spec["prometheus"]
    intervals = {key: prometheus[key] for key in ("scrape_interval", "evaluation_interval")}
    config: Config = {"global": intervals, "rule_files": ["/etc/prometheus-rules/*.yml"]}
    if runs(spec)[obs.ALERTMANAGER]:
        target = obs.URLS[obs.ALERTMANAGER].removeprefix("http://")
        config["alerting"] = {"alertmanagers": [{"static_configs": [{"targets": [target]}]}]}
    if spec["profile"] == obs.HUB:
        # robots send what they kept while their link was down
        config["storage"] = {"tsdb": {"out_of_order_time_window": spec["out_of_order_window"]}}
    own = _own_jobs(spec, (obs.PROMETHEUS, obs.LOKI, obs.GRAFANA, obs.ALERTMANAGER))
    node_jobs = (_node_job("kubelet", spec), _probes(spec), _cadvisor(spec))
    config["scrape_configs"] = [*own, *_pod_jobs(spec, LABELS), *node_jobs, _apis(spec)]
    return config


def vmagent_config(spec: Spec) -> Config:
    """What vmagent scrapes on a robot. Not the kubelet's and the API server's own series: each look at them makes
    several megabytes of text on k3s, which has all of its parts in one registry. Labels are limited where they are sent
    to: not every vmagent knows how."""
    jobs = [*_own_jobs(spec, (obs.VMAGENT,)), *_pod_jobs(spec, {}), _probes(spec), _cadvisor(spec)]
    return {"global": {"scrape_interval": spec["prometheus"]["scrape_interval"]}, "scrape_configs": jobs}


def _own_jobs(spec: Spec, parts: Sequence[str]) -> list[Config]:
    wanted = runs(spec)
    jobs = [_part_job(name, of_pod(spec["robot"])) for name in parts if wanted[name]]
    node, instance = (_same("__meta_kubernetes_pod_node_name", label) for label in ("node", "instance"))
    if wanted[obs.NODE_EXPORTER]:
        jobs.append(_part_job(obs.NODE_EXPORTER, [*of_node(spec["robot"]), node, instance]))
    if wanted[obs.SHIPPER]:
        jobs.append(_part_job(obs.SHIPPER, [*of_pod(spec["robot"]), node]))
    return jobs


def _part_job(name: str, labels: list[Config]) -> Config:
    """A part of the stack, by its pods' label and the one port that they name."""
    whose = ("__meta_kubernetes_namespace", meta_label("pod", names.LABEL_APP))
    return {
        "job_name": name,
        "kubernetes_sd_configs": [PODS],
        "relabel_configs": [
            {"source_labels": [*whose], "separator": "/", "regex": f"{obs.NAMESPACE}/{name}", "action": "keep"},
            _where("__meta_kubernetes_pod_container_port_name", obs.HTTP),
            _where("__meta_kubernetes_pod_phase", "Succeeded|Failed", "drop"),
            *labels,
        ],
    }


def _pod_jobs(spec: Spec, limits: Mapping[str, int]) -> list[Config]:
    """The ROS exporters, and every other pod whose annotations ask for it. `limits` of what their labels may be."""
    # the exporter's series about an update carry the updated app's name as `app`
    exporter = _pod_job(obs.ROS_EXPORTER, "keep", spec, {**limits, "honor_labels": True})
    return [exporter, _pod_job("apps", "drop", spec, limits)]


def _pod_job(job: str, action: str, spec: Spec, more: Mapping[str, int]) -> Config:
    """`action` on the exporters' pods."""
    return {
        "job_name": job,
        "sample_limit": SAMPLES[job],
        **more,
        "kubernetes_sd_configs": [PODS],
        "relabel_configs": [
            _where(annotation("scrape"), "true"),
            _where(meta_label("pod", names.LABEL_APP), obs.ROS_EXPORTER, action),
            _where("__meta_kubernetes_pod_phase", "Succeeded|Failed", "drop"),
            take(annotation("scheme"), "__scheme__"),
            take(annotation("path"), "__metrics_path__"),
            {
                # a pod that declares no port has an address without one
                "source_labels": ["__address__", annotation("port")],
                "regex": r"(.+?)(?::\d+)?;(\d+)",
                "target_label": "__address__",
                "replacement": "$1:$2",
            },
            *of_pod(spec["robot"]),
        ],
    }


def _node_job(name: str, spec: Spec, *more: Config) -> Config:
    """`more` is done to what was kept of its metrics."""
    return {
        "job_name": name,
        **_secured(),
        "kubernetes_sd_configs": [NODES],
        "relabel_configs": [
            *of_node(spec["robot"]),
            *(_same("__meta_kubernetes_node_name", label) for label in ("node", "instance")),
        ],
        "metric_relabel_configs": [_kept(name), *more],
    }


def _probes(spec: Spec) -> Config:
    """The kubelet's counts of readiness probes, pod by pod; a path of its own, the same job."""
    job = _node_job("kubelet-probes", spec, *of_container(spec["robot"]))
    job["relabel_configs"].append({"target_label": "job", "replacement": "kubelet"})
    return {**job, "metrics_path": "/metrics/probes"}


def _cadvisor(spec: Spec) -> Config:
    more: list[Config] = [
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
    return {**_node_job("cadvisor", spec, *more), "metrics_path": "/metrics/cadvisor"}


def _apis(spec: Spec) -> Config:
    secured = _secured()
    secured["tls_config"]["server_name"] = "kubernetes.default.svc"
    port = ["__meta_kubernetes_service_name", "__meta_kubernetes_endpoint_port_name"]
    return {
        "job_name": "apiserver",
        **secured,
        "kubernetes_sd_configs": [{"role": "endpoints", "namespaces": {"names": ["default"]}}],
        "relabel_configs": [
            {"source_labels": port, "regex": "kubernetes;https", "action": "keep"},
            *of_robot(spec["robot"]),
        ],
        "metric_relabel_configs": [_kept("apiserver")],
    }


def _secured() -> Config:
    return {
        "scheme": "https",
        "authorization": {"credentials_file": f"{ACCOUNT}/token"},
        "tls_config": {"ca_file": f"{ACCOUNT}/ca.crt"},
    }


# --- rules


@functools.cache
def kept() -> Mapping[str, Sequence[str]]:
    """Metrics that are kept, as patterns, by job; of other jobs all are."""
    return filled("kept")


def _kept(job: str) -> Config:
    return _where("__name__", "|".join(kept()[job]))


def _where(label: str, regex: str, action: str = "keep") -> Config:
    return {"source_labels": [label], "regex": regex, "action": action}


def _same(source: str, target: str) -> Config:
    return {"source_labels": [source], "target_label": target}


def take(source: str, target: str, regex: str = "(.+)") -> Config:
    """A label's value, or a part of it, for another one, where it has one."""
    return {"source_labels": [source], "regex": regex, "target_label": target, "replacement": "$1"}


def meta_label(kind: str, label: str) -> str:
    """The name under which service discovery gives a label: what no label of Prometheus may have becomes `_`.

    >>> meta_label("pod", "rosops.fleet/robot")
    '__meta_kubernetes_pod_label_rosops_fleet_robot'
    """
    return f"__meta_kubernetes_{kind}_label_{re.sub(r'[^A-Za-z0-9_]', '_', label)}"


def annotation(name: str) -> str:
    """The same for a pod's annotation of Prometheus."""
    return f"__meta_kubernetes_pod_annotation_prometheus_io_{name}"


def of_robot(robot: str) -> list[Config]:
    """On a robot's own cluster everything is the robot's."""
    return [{"target_label": "robot", "replacement": robot}] if robot else []


def of_pod(robot: str) -> list[Config]:
    """The labels of a pod's series."""
    return [
        *of_robot(robot),
        take(meta_label("pod", names.LABEL_ROBOT), "robot"),
        take("__meta_kubernetes_namespace", "namespace"),
        take("__meta_kubernetes_pod_name", "pod"),
        # pods of others have no label of ours: then the owner's name, as in their log lines
        take("__meta_kubernetes_pod_name", "app", plain(APP_OF_POD)),
        take(meta_label("pod", names.LABEL_APP), "app"),
        take(meta_label("node", names.LABEL_PLACEMENT), "placement"),
    ]


def of_node(robot: str) -> list[Config]:
    """The labels of a host's series."""
    return [
        *of_robot(robot),
        take(meta_label("node", names.LABEL_ROBOT), "robot"),
        take(meta_label("node", names.LABEL_PLACEMENT), "placement"),
    ]


def of_container(robot: str) -> list[Config]:
    """cAdvisor's series say themselves which pod they are about; applied to the metrics, not to the target.

    The target's robot is the host's, and not that of a pod which only happens to run there.
    """
    cleared = [] if robot else [{"source_labels": ["pod"], "regex": ".+", "target_label": "robot", "replacement": ""}]
    return [
        *cleared,
        {
            "source_labels": ["namespace", "pod"],
            "separator": "/",
            "regex": f"{plain(ROBOT_OF_NAMESPACE)}/.+",
            "target_label": "robot",
            "replacement": "$1",
        },
        take("pod", "app", plain(APP_OF_POD)),
    ]


def plain(regex: str) -> str:
    """Named groups as numbered ones."""
    return re.sub(r"\(\?P<\w+>", "(", regex)
