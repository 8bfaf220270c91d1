# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The job's `observability`, key by key: those of the dissertation have the same names here."""

from __future__ import annotations

from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.role_specs import Option, role_options
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.part import CHANGED, LEFT, OPEN, TAKEN, Part

STACK = ("grafana", "prometheus", "loki")
_FLAGS = ("node_exporter", "ros_metrics")
OWN = (
    "left out, as a password does not belong into plain text: one is generated in the cluster; your own goes into "
    "Ansible Vault, as observability_grafana_admin_password"
)
CHARTS = (
    "the collection brings its own objects instead of Helm's charts; what differs goes into observability_overrides"
)
IN_CLUSTER = "Prometheus and Loki are reached within the cluster, by Grafana"


def watched(orchestration: Part) -> dict[str, Any]:
    """`observability` of the inventory; empty where the job has none."""
    part = orchestration.part("observability")
    for key in (*STACK, *_FLAGS):  # so in the dissertation's listing 6
        if key in orchestration and key not in part:
            part.value[key] = orchestration.value.pop(key)
            orchestration.say(key, TAKEN, f"read as observability.{key}")
    return _taken(part, role_options("observability")["observability"]["options"])


def _taken(part: Part, options: dict[str, Option]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key in list(part.value):
        option = options.get(key)
        if key == "admin_password":
            part.leave(key, OWN, OPEN)
        elif key == "service_type":
            _service(part, key, option, found)
        elif option is None:
            part.leave(
                key, CHARTS if key != "namespace" else "it is observability", CHANGED if key == "namespace" else LEFT
            )
        elif option.get("options"):
            below = _taken(part.part(key), option["options"])
            if below:
                found[key] = below
        else:
            value = part.take(key, bool) if option["type"] == "bool" else part.text(key)
            if value not in (None, ""):
                found[key] = value
                part.say(key, TAKEN, part.at(key).partition(".orchestration.")[2])
    return found


def _service(part: Part, key: str, option: Option | None, found: dict[str, Any]) -> None:
    value = part.text(key)
    if option and value in option["choices"]:
        found[key] = value
        part.say(key, TAKEN, "observability.grafana.service_type")
    elif option:
        part.say(key, CHANGED, f"NodePort instead of {value}: k3s serves Grafana at port 30300 of its host")
    else:
        part.say(key, LEFT, IN_CLUSTER)


def dashboards(extra: Part) -> list[str]:
    """Files of dashboards that `additional_k8s_params` names, wherever below its observability."""
    found: list[str] = []
    for key in ("observability", "grafana"):
        value = extra.value.pop(key, None)
        if value is None:
            continue
        files = [text for text in _texts(value) if text.endswith(".json")]
        found += files
        told = f"observability_dashboards: {', '.join(files)}" if files else CHARTS
        extra.say(key, TAKEN if files else LEFT, told)
    return found


def _texts(value: Any) -> list[str]:
    if isinstance(value, dict):
        return [text for item in value.values() for text in _texts(item)]
    if isinstance(value, list):
        return [text for item in value for text in _texts(item)]
    return [value] if isinstance(value, str) else []
