# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The node exporter on every host: objects. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.common import pod_spec
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import names as obs
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import workload

Spec = Mapping[str, Any]

HOST_ROOT = "/host"
NOBODY = 65534
# What the dashboards and alerts need. The defaults are four times as many, most of them of no use on a robot.
COLLECTORS = (
    "cpu",
    "diskstats",
    "filesystem",
    "hwmon",
    "loadavg",
    "meminfo",
    "netdev",
    "powersupplyclass",
    "pressure",
    "stat",
    "thermal_zone",
    "time",
    "timex",
    "uname",
    "vmstat",
)
POD_MOUNTS = "^/(?:dev|proc|sys|run|var/lib/(?:kubelet|rancher|containers|docker)/.+)(?:$|/)"


def node_exporter_objects(spec: Spec) -> list[dict[str, Any]]:
    """A DaemonSet in the hosts' own network: its interfaces are what is to be seen."""
    name = obs.NODE_EXPORTER
    port = obs.PORTS[name]
    args = [
        f"--path.rootfs={HOST_ROOT}",
        f"--path.procfs={HOST_ROOT}/proc",
        f"--path.sysfs={HOST_ROOT}/sys",
        f"--web.listen-address=$(HOST_IP):{port}",
        "--web.disable-exporter-metrics",
        "--log.level=warn",
        "--collector.disable-defaults",
        *(f"--collector.{collector}" for collector in COLLECTORS),
        f"--collector.filesystem.mount-points-exclude={POD_MOUNTS}",
        "--collector.netdev.device-exclude=^(?:veth.*|cni.*|flannel.*|lo)$",
    ]
    container = workload.container(
        name,
        spec["images"]["node_exporter"],
        args=args,
        env=[
            {"name": "HOST_IP", "valueFrom": {"fieldRef": {"fieldPath": "status.hostIP"}}},
            *workload.memory("16MiB"),
        ],
        ports=[{**workload.port_of(name)[0], "hostPort": port}],
        resources=workload.resources("10m", "16Mi", "64Mi"),
        volumeMounts=[
            {"name": "root", "mountPath": HOST_ROOT, "readOnly": True, "mountPropagation": "HostToContainer"}
        ],
        # It listens on its host's address, which the kubelet's probe asks anyway.
        readinessProbe=workload.probe("/", port),
    )
    pod = pod_spec(
        [container],
        [{"name": "root", "hostPath": {"path": "/"}}],
        hostNetwork=True,
        hostPID=True,
        securityContext={"runAsNonRoot": True, "runAsUser": NOBODY, "runAsGroup": NOBODY},
        terminationGracePeriodSeconds=5,
    )
    return [workload.workload(name, spec, pod, args)]
