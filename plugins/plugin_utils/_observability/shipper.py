# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The log shipper on every host: objects. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.common import pod_spec
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import names as obs
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import workload
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.otelcol import (
    FEATURE_GATE,
    NODE_ENV,
    STATE_DIR,
    otelcol_config,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.pod_labels import POD_LOGS
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.spec import hub_url
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.yaml_text import yaml_text

Spec = Mapping[str, Any]

CONFIG_DIR = "/etc/log-shipper"
CONFIG_FILE = "otelcol.yml"
# Log files belong to root and to nobody else; nothing but reading them is left to it.
SECURITY = {
    "allowPrivilegeEscalation": False,
    "readOnlyRootFilesystem": True,
    "capabilities": {"drop": ["ALL"], "add": ["DAC_READ_SEARCH"]},
}


def shipper_objects(spec: Spec) -> list[dict[str, Any]]:
    """DaemonSet and ConfigMap of the collector; its state lies on the host and outlives the pod."""
    name = obs.SHIPPER
    loki = hub_url(spec, "hub_logs_port") if spec["profile"] == obs.ROBOT else obs.url(obs.LOKI)
    config = yaml_text(otelcol_config(spec, loki))
    container = workload.container(
        name,
        spec["images"]["otelcol"],
        args=[f"--config={CONFIG_DIR}/{CONFIG_FILE}", f"--feature-gates={FEATURE_GATE}"],
        env=[
            {"name": NODE_ENV, "valueFrom": {"fieldRef": {"fieldPath": "spec.nodeName"}}},
            *workload.memory("40MiB"),
        ],
        ports=workload.port_of(name),
        resources=workload.resources("20m", "48Mi", "128Mi"),
        volumeMounts=[
            {"name": "config", "mountPath": CONFIG_DIR, "readOnly": True},
            {"name": "logs", "mountPath": POD_LOGS, "readOnly": True},
            {"name": "state", "mountPath": STATE_DIR},
        ],
        # ready once it counts what it does
        readinessProbe=workload.probe("/metrics", obs.PORTS[name]),
        securityContext=SECURITY,
    )
    pod = pod_spec(
        [container],
        [
            workload.map_volume("config", name),
            {"name": "logs", "hostPath": {"path": POD_LOGS, "type": "DirectoryOrCreate"}},
            {"name": "state", "hostPath": {"path": STATE_DIR, "type": "DirectoryOrCreate"}},
        ],
        securityContext={"runAsUser": 0, "runAsGroup": 0},
        terminationGracePeriodSeconds=15,
    )
    return [workload.config_map(name, name, spec, {CONFIG_FILE: config}), workload.workload(name, spec, pod, config)]
