# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Alertmanager on the cluster: objects. Its configuration may hold passwords, so it is a Secret. Pure."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.common import pod_spec
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import names as obs
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import workload
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.yaml_text import yaml_text

Spec = Mapping[str, Any]

CONFIG_DIR = "/etc/alertmanager"
NOBODY = 65534


def alertmanager_secret(spec: Spec) -> dict[str, Any]:
    """The configuration as a Secret."""
    text = yaml_text(spec["alertmanager_config"])
    return {
        "apiVersion": "v1",
        "kind": "Secret",
        "metadata": workload.metadata(obs.ALERTMANAGER, obs.ALERTMANAGER, spec),
        "data": {"alertmanager.yml": base64.b64encode(text.encode()).decode()},
    }


def alertmanager_objects(spec: Spec) -> list[dict[str, Any]]:
    """Alertmanager without its Secret. What it silences and has sent goes with the pod."""
    name = obs.ALERTMANAGER
    container = workload.container(
        name,
        spec["images"]["alertmanager"],
        args=[
            f"--config.file={CONFIG_DIR}/alertmanager.yml",
            "--storage.path=/alertmanager",
            "--cluster.listen-address=",  # one of it, nobody to agree with
            "--log.level=warn",
        ],
        env=workload.memory("32MiB"),
        ports=workload.port_of(name),
        resources=workload.resources("10m", "32Mi", "96Mi"),
        volumeMounts=[
            {"name": "config", "mountPath": CONFIG_DIR, "readOnly": True},
            {"name": "data", "mountPath": "/alertmanager"},
        ],
        readinessProbe=workload.probe("/-/ready", obs.PORTS[name]),
    )
    volumes = [{"name": "config", "secret": {"secretName": name}}, workload.data_volume(name, False)]
    pod = pod_spec([container], volumes, securityContext=workload.as_user(NOBODY))
    return [workload.workload(name, spec, pod, spec["alertmanager_config"]), workload.service(name, spec)]
