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
    """Of every part, inside the cluster; of what takes a robot's samples and lines, at the hub: `http://192.0.2.10:30090`."""
    secured = SERVERS if spec["tls_secret_name"] else ()
    found = {
        name: f"{'https' if name in secured else 'http'}://{name}.{NAMESPACE}:{port}" for name, port in PORTS.items()
    }
    if spec["profile"] == ROBOT:
        hub = str(spec["hub_url"]).rstrip("/")
        if not hub:
            raise SpecError("the profile robot needs observability_hub_url, the hub's address")
        found |= {"prometheus": f"{hub}:{spec[HUB_METRICS]}", "loki": f"{hub}:{spec[HUB_LOGS]}"}
    return found


def images(spec: Spec) -> list[str]:
    """The images of what runs, sorted, each once: for a registry or an archive of one's own."""
    keys = {name: name.replace("-", "_") for name in PORTS} | {"log-shipper": "otelcol"}
    return sorted({spec["images"][keys[name]] for name, wanted in runs(spec).items() if wanted})


def mebibytes(claim: str, part: float) -> int:
    """What may be kept in a claim of that size, which is a Kubernetes quantity.

    >>> mebibytes("8Gi", RETENTION_PART), mebibytes("500Mi", RETENTION_PART)
    (6553, 400)
    """
    value = quantity_value(str(claim))
    if value is None:
        raise SpecError(f"{claim!r} is no Kubernetes quantity")
    return int(float(value) / 2**20 * part)
