# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts of the stack, the role's variables as one spec, and what follows: who runs, which images, how much is kept.
Pure."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from ...module_utils._common.errors import SpecError
from .._model import names
from .._model.formats import quantity_value
from .._model.role_specs import completed, role_options

Spec = Mapping[str, Any]  # the role's variables

NAMESPACE = names.OBSERVABILITY
ROBOT, HUB = "robot", "hub"  # profiles
HUB_METRICS, HUB_LOGS = "hub_metrics_port", "hub_logs_port"  # variables
# Of each part that may end up on the cluster: what a profile, or a switch, no longer wants is taken away.
PORTS = {
    "prometheus": 9090, "loki": 3100, "grafana": 3000, "alertmanager": 9093, "node-exporter": 9100, "log-shipper": 8888,
    "vmagent": 8429,
}  # fmt: skip
ON_EVERY_HOST = frozenset({"node-exporter", "log-shipper"})  # DaemonSets; all others are Deployments
# Who serves by TLS where a Secret is named. All but Grafana, which asks for a password, let in who shows a certificate.
SERVERS = ("prometheus", "loki", "alertmanager", "grafana")
TLS = "/etc/tls"  # in a pod, the files of its Secret

# Blocks are dropped when they would exceed this part of the claim. The rest is for what is not counted among them: the
# write-ahead log of the last three hours, and the copy that a compaction makes.
RETENTION_PART = 0.8
# vmagent drops the oldest once its queue is this part of its claim; the rest is for its open file.
STORE_PART = 0.9


def spec_of(variables: Spec, robot: str = "", remote_nodes: Collection[str] = ()) -> Spec:
    """The role's variables, all of them and of their specs' types, as the one input of what follows.

    Keys are those of the mapping `observability`, and the other variables' names without `observability_`. `robot` is
    the one whose own cluster it is, empty for the shared cluster; `remote_nodes` are that one's edge nodes. What
    `tls_versions` are is only known with the cluster at hand.
    """
    whole = {name: completed(option, variables[name]) for name, option in role_options("observability").items()}
    seed = whole.pop("observability")
    own = {name.removeprefix("observability_"): value for name, value in whole.items()}
    return {**own, **seed, "robot": robot, "remote_nodes": list(remote_nodes), "tls_versions": {}}


def runs(spec: Spec) -> dict[str, bool]:
    """Which parts of the stack run. Who is asked for what comes before who asks."""
    robot = spec["profile"] == ROBOT
    loki = not robot and spec["loki"]["enabled"]
    prometheus = not robot and spec["prometheus"]["enabled"]
    return {
        "prometheus": prometheus,
        "loki": loki,
        "alertmanager": prometheus and bool(spec["alertmanager_config"]),
        "vmagent": robot,
        "node-exporter": spec["node_exporter"],
        # lines that nobody takes would fill the hosts' disks
        "log-shipper": spec["log_shipper"] != "none" and (robot or loki),
        "grafana": not robot and spec["grafana"]["enabled"],
    }


def tls_secrets(spec: Spec) -> dict[str, str]:
    """Part that runs -> the Secret with its certificate.

    The log shipper runs on every host, robots among them, which must not have the key that the servers are known by. So
    it has a Secret of its own, but on a robot's own cluster, which has no servers.
    """
    name = spec["tls_secret_name"]
    if spec["profile"] == ROBOT:
        of_parts = {"vmagent": name, "log-shipper": name}
    else:
        of_parts = {**dict.fromkeys(SERVERS, name), "log-shipper": f"{name}-shipper"}
    return {part: secret for part, secret in of_parts.items() if name and runs(spec)[part]}


def urls(spec: Spec) -> dict[str, str]:
    """Of every part, inside the cluster."""
    secured = SERVERS if spec["tls_secret_name"] else ()
    return {
        name: f"{'https' if name in secured else 'http'}://{name}.{NAMESPACE}:{port}" for name, port in PORTS.items()
    }


def images(spec: Spec) -> list[str]:
    """The images of what runs, sorted, each once: for a registry or an archive of one's own."""
    keys = {name: name.replace("-", "_") for name in PORTS} | {"log-shipper": "otelcol"}
    return sorted({spec["images"][keys[name]] for name, wanted in runs(spec).items() if wanted})


def retention_size(claim: str) -> str:
    """Prometheus's --storage.tsdb.retention.size for a claim, below the claim's capacity.

    >>> retention_size("8Gi"), retention_size("500Mi")
    ('6553MB', '400MB')
    """
    return f"{int(_mebibytes(claim) * RETENTION_PART)}MB"  # Prometheus's MB is 2^20 bytes


def store_size(claim: str) -> str:
    """vmagent's -remoteWrite.maxDiskUsagePerURL for a claim."""
    return f"{int(_mebibytes(claim) * STORE_PART)}MiB"


def _mebibytes(size: str) -> float:
    """Of a Kubernetes quantity."""
    value = quantity_value(str(size))
    if value is None:
        raise SpecError(f"{size!r} is no Kubernetes quantity")
    return float(value) / 2**20


def hub_url(spec: Spec, port: str) -> str:
    """The hub's address for metrics or for logs: `http://192.0.2.10` and one of its two ports."""
    url = str(spec["hub_url"]).rstrip("/")
    if not url:
        raise SpecError("the profile robot needs observability_hub_url, the hub's address")
    return f"{url}:{spec[port]}"
