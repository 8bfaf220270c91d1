# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts of the stack: what each of them is configured with, and its objects. Pure."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from ...module_utils._step.objects import Object
from .._model.merge import deep_merge
from . import names as obs
from . import workload
from .files import Files
from .pod_labels import APP_OF_POD, PATH, ROBOT_OF_NAMESPACE, STREAM_LABELS, anchored
from .scrape import prometheus_config, vmagent_config
from .spec import Spec, hub_url, retention_size, runs, store_size
from .templates import Config, filled, yaml_text

RULES = {obs.PROMETHEUS: "prometheus-rules", obs.LOKI: "loki-rules"}  # ConfigMaps
STATE = "/var/lib/rosops-fleet/log-shipper"  # on the host
# Folder in Grafana -> directory: the collection's own dashboards, and those of the inventory.
FOLDERS = {"Fleet": "/etc/dashboards/fleet", "Own": "/etc/dashboards/own"}
PREFIXES = {"Fleet": "dashboard-", "Own": "own-dashboard-"}


@dataclass(frozen=True)
class Part:
    """`maps` are ConfigMaps by name. For another `config` the pod is restarted; without one its arguments are all that
    it is configured with. Without a `claim` its data goes with the pod. A part with a `port` is open to the outside."""

    config: Any = None
    maps: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    claim: str = ""
    port: int | None = None
    discovers: bool = False  # its targets, through the Kubernetes API


def part_objects(name: str, spec: Spec, files: Files, pods: Config) -> list[Object]:
    """What is applied of a part that runs; `pods` are `stack_pods`."""
    part, pod = _PARTS[name](spec, files), _pod(name, pods[name])
    config = pod["containers"][0]["args"] if part.config is None else part.config
    return [
        *(workload.discovery_access(name, spec) if part.discovers else []),
        *(workload.config_map(found, name, spec, data) for found, data in part.maps.items()),
        *([workload.claim(name, spec, part.claim)] if part.claim else []),
        workload.workload(name, spec, pod, config),
        *([workload.service(name, spec, part.port)] if obs.WORKLOADS[name] == "Deployment" else []),
        *(workload.allow_list(name, spec) if part.port is not None else []),
    ]


def stack_pods(spec: Spec, files: Files, admin_version: str) -> Config:
    """All pods of the stack by their parts, as `pods.yml.j2` has them."""
    boards = {
        folder: [map_name(folder, file) for file in sorted(files.dashboards.get(folder, ()))] for folder in FOLDERS
    }
    return filled(
        "pods",
        **_values(spec),
        dashboards=boards,
        admin_version=admin_version,
        memory=workload.memory,
        data=workload.data_volume,
    )


def loki_config(spec: Spec) -> Config:
    """loki.yml."""
    return filled("loki", **_values(spec))


def shipper_config(spec: Spec) -> Config:
    """The collector's; its lines go to this cluster's Loki, or to the hub's."""
    return filled("otelcol", **_values(spec))


def grafana_config(spec: Spec) -> Config:
    """Provisioning files by name."""
    return filled("grafana", **_values(spec))


def _values(spec: Spec) -> Config:
    """What the templates are filled with."""
    robot, wanted = spec["profile"] == obs.ROBOT, runs(spec)
    remote = json.dumps(sorted(set(spec["remote_nodes"])))
    return {
        **{key: spec[key] for key in ("images", "robot", obs.PROMETHEUS, obs.LOKI, obs.GRAFANA)},
        "hub": spec["profile"] == obs.HUB,
        "hub_metrics": hub_url(spec, "hub_metrics_port") if robot else "",
        "loki_url": hub_url(spec, "hub_logs_port") if robot else obs.URLS[obs.LOKI],
        "has_alertmanager": wanted[obs.ALERTMANAGER],
        "sources": [name for name in (obs.PROMETHEUS, obs.LOKI, obs.ALERTMANAGER) if wanted[name]],
        "ports": obs.PORTS,
        "urls": obs.URLS,
        "folders": FOLDERS,
        "state": STATE,
        "retention_size": retention_size(spec["prometheus_size"]),
        "store_size": store_size(spec["store_size"]),
        "stream_labels": STREAM_LABELS,
        "path": anchored(PATH),
        "robot_of_namespace": anchored(ROBOT_OF_NAMESPACE),
        "app_of_pod": anchored(APP_OF_POD),
        "placement": f'EXPR(env("NODE_NAME") in {remote} ? "remote" : "local")',
    }


def map_name(folder: str, file: str) -> str:
    """A dashboard's ConfigMap: what a file's name may have and an object's may not becomes a dash."""
    stem = file.rpartition(".")[0].lower()
    return PREFIXES[folder] + (
        "".join(one if one.isascii() and one.isalnum() else "-" for one in stem).strip("-") or "x"
    )


def _pod(name: str, given: Object) -> Object:
    """With what all of them have in common: no access to the API, no rights, one port, a probe of it."""
    port = obs.PORTS[name]
    common = {"imagePullPolicy": "IfNotPresent", "securityContext": workload.UNPRIVILEGED}
    main = {
        **common,
        "name": name,
        "ports": [{"name": obs.HTTP, "containerPort": port, "protocol": "TCP"}],
        # No liveness probe: a restart while a log is replayed only makes it longer.
        "readinessProbe": {
            "httpGet": {"port": port},
            "periodSeconds": 5,
            "timeoutSeconds": 5,
            "failureThreshold": 3,
        },
    }
    pod = {"automountServiceAccountToken": False, "enableServiceLinks": False, **given}
    pod["containers"] = [deep_merge(main, one) for one in given["containers"]]
    if "initContainers" in given:
        pod["initContainers"] = [deep_merge(common, one) for one in given["initContainers"]]
    return pod


def _prometheus(spec: Spec, files: Files) -> Part:
    config = yaml_text(prometheus_config(spec))
    maps = {obs.PROMETHEUS: {"prometheus.yml": config}, RULES[obs.PROMETHEUS]: files.rules}
    port = spec["hub_metrics_port"] if spec["profile"] == obs.HUB else None
    return Part([config, dict(files.rules)], maps, spec["prometheus_size"], port, discovers=True)


def _vmagent(spec: Spec, _files: Files) -> Part:
    config = yaml_text(vmagent_config(spec))
    return Part(config, {obs.VMAGENT: {"prometheus.yml": config}}, spec["store_size"], discovers=True)


def _loki(spec: Spec, files: Files) -> Part:
    config = yaml_text(loki_config(spec))
    maps = {obs.LOKI: {"loki.yml": config}, RULES[obs.LOKI]: files.loki_rules}
    port = spec["hub_logs_port"] if spec["profile"] == obs.HUB else None
    return Part([config, dict(files.loki_rules)], maps, _claim(spec[obs.LOKI]), port)


def _alertmanager(spec: Spec, _files: Files) -> Part:
    return Part(spec["alertmanager_config"])


def _shipper(spec: Spec, _files: Files) -> Part:
    config = yaml_text(shipper_config(spec))
    return Part(config, {obs.SHIPPER: {"otelcol.yml": config}})


def _grafana(spec: Spec, files: Files) -> Part:
    """Each dashboard is a ConfigMap of its own, which Grafana reads again by itself."""
    config = {name: yaml_text(one) for name, one in grafana_config(spec).items()}
    boards = {
        map_name(folder, file): {file: text}
        for folder, found in files.dashboards.items()
        for file, text in sorted(found.items())
    }
    port = spec["grafana_node_port"] if spec[obs.GRAFANA]["service_type"] == "NodePort" else None
    return Part(config, {obs.GRAFANA: config, **boards}, _claim(spec[obs.GRAFANA]), port)


def _claim(of: Spec) -> str:
    return str(of["persistence"]["size"]) if of["persistence"]["enabled"] else ""


_PARTS: Mapping[str, Callable[[Spec, Files], Part]] = {
    obs.PROMETHEUS: _prometheus,
    obs.LOKI: _loki,
    obs.ALERTMANAGER: _alertmanager,
    obs.VMAGENT: _vmagent,
    obs.NODE_EXPORTER: lambda _spec, _files: Part(),
    obs.SHIPPER: _shipper,
    obs.GRAFANA: _grafana,
}
