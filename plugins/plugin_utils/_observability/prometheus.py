# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Prometheus on the cluster, or vmagent on a robot: objects, with the account that finds their targets. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.common import pod_spec
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import names as obs
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import workload
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.prometheus_config import (
    RULES_DIR,
    prometheus_config,
    vmagent_config,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.spec import (
    hub_url,
    retention_size,
    store_size,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.yaml_text import yaml_text

Spec = Mapping[str, Any]
Object = dict[str, Any]

CONFIG_DIR = "/etc/prometheus"
DATA_DIR = "/prometheus"
NOBODY = 65534
RULES_MAP = "prometheus-rules"
VMAGENT_DATA = "/vmagent"


def prometheus_objects(spec: Spec, rules: Mapping[str, str]) -> list[Object]:
    """Prometheus; `rules` are the rule files' texts by name."""
    name = obs.PROMETHEUS
    config = yaml_text(prometheus_config(spec))
    args = [
        f"--config.file={CONFIG_DIR}/prometheus.yml",
        f"--storage.tsdb.path={DATA_DIR}",
        f"--storage.tsdb.retention.time={spec['prometheus']['retention']}",
        f"--storage.tsdb.retention.size={retention_size(spec['prometheus_size'])}",
        "--log.level=warn",
    ]
    hub = spec["profile"] == obs.HUB
    if hub:
        args.append("--web.enable-remote-write-receiver")
    container = workload.container(
        name,
        spec["images"]["prometheus"],
        args=args,
        env=[{"name": "GOMEMLIMIT", "value": "400MiB"}],
        ports=workload.port_of(name),
        resources=workload.resources("50m", "128Mi", "768Mi"),
        volumeMounts=[
            {"name": "config", "mountPath": CONFIG_DIR, "readOnly": True},
            {"name": "rules", "mountPath": RULES_DIR, "readOnly": True},
            {"name": "data", "mountPath": DATA_DIR},
        ],
        readinessProbe=workload.probe("/-/ready", obs.PORTS[name]),
    )
    volumes = [
        workload.map_volume("config", name),
        workload.map_volume("rules", RULES_MAP),
        workload.data_volume(name, True),
    ]
    pod = _discovering(name, [container], volumes, 60)
    return [
        *discovery_access(name, spec),
        workload.config_map(name, name, spec, {"prometheus.yml": config}),
        workload.config_map(RULES_MAP, name, spec, rules),
        workload.claim(name, spec, spec["prometheus_size"]),
        workload.workload(name, spec, pod, [config, dict(rules)]),
        workload.service(name, spec, spec["hub_metrics_port"] if hub else None),
        *(workload.allow_list(name, spec) if hub else []),
    ]


def vmagent_objects(spec: Spec) -> list[Object]:
    """vmagent, whose queue on disk is a robot's store: what the hub does not take is kept, in order, until it does."""
    name = obs.VMAGENT
    config = yaml_text(vmagent_config(spec))
    args = [
        f"-promscrape.config={CONFIG_DIR}/prometheus.yml",
        f"-httpListenAddr=:{obs.PORTS[name]}",
        f"-remoteWrite.url={hub_url(spec, 'hub_metrics_port')}/api/v1/write",
        f"-remoteWrite.tmpDataPath={VMAGENT_DATA}",
        f"-remoteWrite.maxDiskUsagePerURL={store_size(spec['store_size'])}",
        "-remoteWrite.queues=1",  # in order, and one connection's memory
        "-memory.allowedBytes=16MB",
        "-loggerLevel=WARN",
    ]
    container = workload.container(
        name,
        spec["images"]["vmagent"],
        args=args,
        env=workload.memory("20MiB"),
        ports=workload.port_of(name),
        resources=workload.resources("20m", "24Mi", "96Mi"),
        volumeMounts=[
            {"name": "config", "mountPath": CONFIG_DIR, "readOnly": True},
            {"name": "data", "mountPath": VMAGENT_DATA},
        ],
        readinessProbe=workload.probe("/health", obs.PORTS[name]),
    )
    pod = _discovering(name, [container], [workload.map_volume("config", name), workload.data_volume(name, True)], 30)
    return [
        *discovery_access(name, spec),
        workload.config_map(name, name, spec, {"prometheus.yml": config}),
        workload.claim(name, spec, spec["store_size"]),
        workload.workload(name, spec, pod, config),
        workload.service(name, spec),
    ]


def _discovering(name: str, containers: list[Object], volumes: list[Object], grace: int) -> Object:
    return pod_spec(
        containers,
        volumes,
        automountServiceAccountToken=True,
        serviceAccountName=name,
        securityContext=workload.as_user(NOBODY),
        terminationGracePeriodSeconds=grace,
    )


def discovery_access(name: str, spec: Spec) -> list[Object]:
    """An account that may see what there is to scrape, and read the metrics of nodes and API servers: nothing else."""
    meta = workload.metadata(name, name, spec)
    wide = {"name": f"rosops-fleet-{name}", "labels": meta["labels"]}
    rules = [
        {"apiGroups": [""], "resources": ["nodes", "pods", "services", "endpoints"], "verbs": ["get", "list", "watch"]},
        {"apiGroups": [""], "resources": ["nodes/metrics"], "verbs": ["get"]},
        {"nonResourceURLs": ["/metrics"], "verbs": ["get"]},
    ]
    api = "rbac.authorization.k8s.io"
    return [
        {"apiVersion": "v1", "kind": "ServiceAccount", "metadata": meta},
        {"apiVersion": f"{api}/v1", "kind": "ClusterRole", "metadata": wide, "rules": rules},
        {
            "apiVersion": f"{api}/v1",
            "kind": "ClusterRoleBinding",
            "metadata": dict(wide),
            "roleRef": {"apiGroup": api, "kind": "ClusterRole", "name": wide["name"]},
            "subjects": [{"kind": "ServiceAccount", "name": name, "namespace": obs.NAMESPACE}],
        },
    ]
