# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks of the observability stack's variables that need more than one of them. Pure."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

from .._model.finding import Problem
from .._model.formats import quantity_value
from .._observability.spec import ROBOT
from .said import Inventory, Said

LEAST_STORE = "600Mi"  # vmagent takes no less than 500 MB for its queue
DAY = 86400
_SECONDS = {"ms": 0.001, "s": 1, "m": 60, "h": 3600, "d": DAY, "w": 7 * DAY, "y": 365 * DAY}


def observability_problems(there: Inventory, wrong: Sequence[Problem]) -> Iterator[Problem]:
    """Of each cluster the host that carries its variables. What is malformed was reported as such."""
    bad = {problem.path for problem in wrong}
    for host in there.clusters:
        given = {
            name: value
            for name, value in there.hosts.get(host, {}).items()
            if not any(re.match(rf"hosts\.{re.escape(host)}\.{name}([.[]|$)", path) for path in bad)
        }
        mapping = given.get("observability")
        if isinstance(mapping, Mapping) and mapping.get("enabled"):
            yield from _of_cluster(f"hosts.{host}", given, there.modes.get(host) == "standalone")


def seconds(duration: str) -> float:
    """A duration as Prometheus writes it.

    >>> seconds("1d12h")
    129600.0
    """
    parts = re.findall(r"([0-9]+)(ms|[smhdwy])", duration)
    return float(sum(int(number) * _SECONDS[unit] for number, unit in parts))


def _of_cluster(path: str, given: Said, alone: bool) -> Iterator[Problem]:
    if given.get("observability_profile") == ROBOT:
        if not alone:
            yield Problem(
                f"{path}.observability_profile",
                "is 'robot' for a cluster of several hosts",
                "standalone or hub; robot is for a robot with robot_mode: standalone",
            )
        elif not given.get("observability_hub_url"):
            yield Problem(f"{path}.observability_hub_url", "is missing", "the hub's address, such as http://192.0.2.10")
    store = quantity_value(str(given.get("observability_store_size", LEAST_STORE)))
    if store is not None and store < (quantity_value(LEAST_STORE) or 0):
        yield Problem(f"{path}.observability_store_size", "is too small for a queue", f"{LEAST_STORE} or more")
    retention = ((given.get("observability") or {}).get("loki") or {}).get("retention", "24h")
    if seconds(retention) < DAY:
        path_of_it = f"{path}.observability.loki.retention"
        yield Problem(path_of_it, f"is '{retention}'", "24h or more: Loki keeps its index by the day")
    yield from _ports(path, given)


def _ports(path: str, given: Said) -> Iterator[Problem]:
    defaults = {
        "observability_grafana_node_port": 30300,
        "observability_hub_metrics_port": 30090,
        "observability_hub_logs_port": 30100,
    }
    taken: dict[str, str] = {}
    for name, default in defaults.items():
        port = str(given.get(name, default))
        if port in taken:
            yield Problem(f"{path}.{name}", f"is {port} as {taken[port]}", "a port of its own")
        taken.setdefault(port, name)
