# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Loki on the cluster: objects. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.common import pod_spec
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import names as obs
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import workload
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.loki_config import (
    DATA,
    RULES_DIR,
    TENANT,
    loki_config,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.yaml_text import yaml_text

Spec = Mapping[str, Any]

USER = 10001  # as in its image
RULES_MAP = "loki-rules"


def loki_objects(spec: Spec, rules: Mapping[str, str]) -> list[dict[str, Any]]:
    """Loki; `rules` are the texts of its rule files by name."""
    name = obs.LOKI
    config = yaml_text(loki_config(spec))
    persistent = spec["loki"]["persistence"]["enabled"]
    container = workload.container(
        name,
        spec["images"]["loki"],
        args=["-config.file=/etc/loki/loki.yml"],
        env=[{"name": "GOMEMLIMIT", "value": "300MiB"}],
        ports=workload.port_of(name),
        resources=workload.resources("50m", "128Mi", "640Mi"),
        volumeMounts=[
            {"name": "config", "mountPath": "/etc/loki", "readOnly": True},
            {"name": "rules", "mountPath": f"{RULES_DIR}/{TENANT}", "readOnly": True},
            {"name": "data", "mountPath": DATA},
            {"name": "tmp", "mountPath": "/tmp"},  # noqa: S108 - the container's own
        ],
        # it says ready 15 s after its start: so long it waits for others that might share its work
        readinessProbe=workload.probe("/ready", obs.PORTS[name]),
    )
    volumes = [
        workload.map_volume("config", name),
        workload.map_volume("rules", RULES_MAP),
        workload.data_volume(name, persistent),
        {"name": "tmp", "emptyDir": {}},
    ]
    pod = pod_spec(
        [container],
        volumes,
        securityContext=workload.as_user(USER),
        terminationGracePeriodSeconds=60,  # it writes what it holds in memory to disk
    )
    hub = spec["profile"] == obs.HUB
    return [
        workload.config_map(name, name, spec, {"loki.yml": config}),
        workload.config_map(RULES_MAP, name, spec, rules),
        *([workload.claim(name, spec, spec["loki"]["persistence"]["size"])] if persistent else []),
        workload.workload(name, spec, pod, [config, dict(rules)]),
        workload.service(name, spec, spec["hub_logs_port"] if hub else None),
        *(workload.allow_list(name, spec) if hub else []),
    ]
