# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The role's variables as one spec, and what follows: who runs, which images, how much is kept. Pure."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from ...module_utils._common.errors import SpecError
from .._model.formats import quantity_value
from .._model.role_specs import completed, role_options
from . import names as obs

Spec = Mapping[str, Any]  # the role's variables

# Blocks are dropped when they would exceed this part of the claim. The rest is for what is not counted among them: the
# write-ahead log of the last three hours, and the copy that a compaction makes.
RETENTION_PART = 0.8
# vmagent drops the oldest once its queue is this part of its claim; the rest is for its open file.
STORE_PART = 0.9


def spec_of(variables: Spec, robot: str = "", remote_nodes: Collection[str] = ()) -> Spec:
    """The role's variables, all of them and of their specs' types, as the one input of what follows.

    Keys are those of the mapping `observability`, and the other variables' names without `observability_`. `robot` is
    the one whose own cluster it is, empty for the shared cluster; `remote_nodes` are that one's edge nodes.
    """
    whole = {name: completed(option, variables[name]) for name, option in role_options("observability").items()}
    seed = whole.pop("observability")
    own = {name.removeprefix("observability_"): value for name, value in whole.items()}
    return {**own, **seed, "robot": robot, "remote_nodes": list(remote_nodes)}


def runs(spec: Spec) -> dict[str, bool]:
    """Which parts of the stack run."""
    robot = spec["profile"] == obs.ROBOT
    loki = not robot and spec["loki"]["enabled"]
    prometheus = not robot and spec["prometheus"]["enabled"]
    return {
        obs.PROMETHEUS: prometheus,
        obs.LOKI: loki,
        obs.GRAFANA: not robot and spec["grafana"]["enabled"],
        obs.ALERTMANAGER: prometheus and bool(spec["alertmanager_config"]),
        obs.VMAGENT: robot,
        obs.NODE_EXPORTER: spec["node_exporter"],
        # lines that nobody takes would fill the hosts' disks
        obs.SHIPPER: spec["log_shipper"] != "none" and (robot or loki),
    }


def images(spec: Spec) -> list[str]:
    """The images of what runs, sorted, each once: for a registry or an archive of one's own."""
    keys = {name: name.replace("-", "_") for name in obs.WORKLOADS} | {obs.SHIPPER: "otelcol"}
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
