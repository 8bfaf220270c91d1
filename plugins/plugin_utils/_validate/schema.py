# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""JSON Schema (2020-12) of the variables: of apps and volumes from their types (`_model/app.py`), of the others keys,
types and choices from the argument specs, and forms from here.

`x-allowed` holds the words for an operator where the schema's own would not be understood.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Annotated

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.app import (
    NODE_PORT,
    SIZE,
    VALUE,
    App,
    Quantities,
    Volume,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.keys import Schema, either, number, schema_of, text
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.role_specs import Option, all_options
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.layers import APPS, LAYERS


def numeral(allowed: str, schema: Schema, pattern: str) -> Schema:
    """A number, or the text of one."""
    return either(allowed, schema, {"type": "string", "pattern": pattern, "x-allowed": allowed})


FLAG: Schema = {"type": "boolean"}
QUANTITIES = schema_of(Quantities)

# An empty answer of AWX's survey is nothing to ansible-core.
NAMES: Schema = either(
    "a list of names, also as a text such as 'camera, lidar'",
    {"type": "array", "items": {"type": "string"}},
    {"type": ["string", "null"]},
)

# Variables that are no role's.
OWN: dict[str, Schema] = {
    "fleet_name": text("dns-name"),
    "fleet_kubeconfig_dir": text(),
    "robot_mode": {"enum": ["agent", "standalone"]},
}

# What an argument spec cannot say, by the path of the value. With a type of its own a form stands for what the spec
# says, else it adds to that.
FORMS: dict[str, Schema] = {
    **{f"{layer}[]": {"required": ["name"], "properties": {"name": text("app-name")}} for layer in LAYERS},
    APPS: schema_of(tuple[App, ...]),
    "collect_claims": NAMES,
    "collect_match": NAMES,
    "collect_robots": NAMES,
    "update_apps": NAMES,
    "update_remove_apps": NAMES,
    "update_to": {"type": ["string", "number", "null"]},
    "update_when[]": VALUE,
    "update_windows[].days": {"minItems": 1},
    "update_windows[].from": text("time-of-day"),
    "update_windows[].to": text("time-of-day"),
    "update_timezone": text("time-zone"),
    "persistent_storage.volumes": schema_of(tuple[Volume, ...]),
    "k3s_version": text("k3s-version"),
    "k3s_node_ip": either("an IP address, or one of each family", text("addresses"), {"const": ""}),
    "ros_master_image": text("image"),
    # empty is the roles' default and says the same as leaving it out
    "ros_master_uri": either("http://<host>:<port>", text("master-uri"), {"const": ""}),
    "ros_master_placement": {"x-allowed": "local or remote"},
    "ros_master_goal_forwarding": FLAG,
    "node_labels": schema_of(Mapping[Annotated[str, text("label-name")], Annotated[str, text("label-value")]]),
    "node_taints[].key": text("label-name"),
    "node_taints[].value": text("label-value"),
    "robot_namespace_quota": QUANTITIES,
    **dict.fromkeys(
        [
            f"robot_namespace_limits.{key}"
            for key in ("default", "defaultRequest", "max", "min", "maxLimitRequestRatio")
        ],
        QUANTITIES,
    ),
    "robot_namespace_pull_secrets[]": {
        "dependentRequired": {"registry": ["username", "password"], "username": ["registry"], "password": ["registry"]}
    },
    "robot_namespace_pull_secrets[].name": text("dns-name"),
    **dict.fromkeys([f"robot_namespace_pull_secrets[].{key}" for key in ("registry", "username", "password")], text()),
    **dict.fromkeys(
        (
            "observability.prometheus.scrape_interval",
            "observability.prometheus.evaluation_interval",
            "observability.prometheus.retention",
            "observability.loki.retention",
            "observability_scrape_interval",
            "observability_evaluation_interval",
            "observability_prometheus_retention",
            "observability_loki_retention",
            "observability_out_of_order_window",
        ),
        text("retention"),
    ),
    **dict.fromkeys(
        (
            "observability.grafana.persistence.size",
            "observability.loki.persistence.size",
            "observability_prometheus_size",
            "observability_loki_size",
            "observability_grafana_size",
            "observability_store_size",
            "observability_log_queue_size",
        ),
        SIZE,
    ),
    **dict.fromkeys(
        ("observability_grafana_node_port", "observability_hub_metrics_port", "observability_hub_logs_port"), NODE_PORT
    ),
    **dict.fromkeys(
        [
            f"observability_{part}_image"
            for part in (
                "prometheus", "loki", "grafana", "alertmanager", "node_exporter", "otelcol", "vmagent",
            )
        ],
        text("image"),
    ),
    "observability_hub_url": either(
        "http://<host> or https://<host>, without a port and a path", text("hub-url"), {"const": ""}
    ),
    "observability_allowed_networks[]": text("network"),
    "observability_log_shipper": {"x-allowed": "otelcol, which took promtail's place and its labels, or none"},
}  # fmt: skip

# What is inside a mapping has the type that YAML gave it.
STRICT: dict[str, Schema] = {
    "str": {"type": "string"},
    "path": {"type": "string"},
    "raw": {},
    "int": {"type": "integer"},
    "float": {"type": "number"},
    "bool": FLAG,
}
# A variable that `-e name=value` gives is a text, so Ansible's own conversions are followed.
LENIENT: dict[str, Schema] = {
    **STRICT,
    "str": {"type": ["string", "number"]},
    "int": numeral("a whole number", {"type": "integer"}, "^-?[0-9]+$"),
    "float": numeral("a number", {"type": "number"}, r"^-?[0-9]+(\.[0-9]+)?$"),
    "bool": either("true or false", FLAG, {"enum": ["true", "false", "yes", "no", "on", "off", "1", "0", 1, 0]}),
}
# Of times in seconds.
SECONDS: dict[str, Schema] = {
    "int": numeral("a whole number, 0 or more", {"type": "integer", "minimum": 0}, "^[0-9]+$"),
    "float": numeral("a number, 0 or more", number(0), r"^[0-9]+(\.[0-9]+)?$"),
}
TIMES = ("_timeout", "_seconds")


@functools.cache
def variables() -> dict[str, Schema]:
    """The schema of each of the fleet's variables."""
    return {**{name: option_schema(option, name) for name, option in all_options().items()}, **OWN}


def host_schema() -> Schema:
    """The schema of one host's variables."""
    return {"type": "object", "properties": variables(), "additionalProperties": False}


def option_schema(option: Option, path: str) -> Schema:
    """An option of an argument spec as JSON Schema, with the forms at and below its path."""
    form = FORMS.get(path, {})
    return form if {"type", "anyOf"} & set(form) else {**_plain_schema(option, path), **form}


def needed(name: str) -> bool:
    """Whether the validation itself has to read a variable: it has a form, or robots are made of it."""
    return (
        name in OWN
        or name.startswith(("ros_master_", "robot_namespace_"))
        or any(path == name or path.startswith((f"{name}.", f"{name}[")) for path in FORMS)
    )


def _plain_schema(option: Option, path: str) -> Schema:
    kind = option.get("type", "str")
    if kind == "list":
        return {"type": "array", "items": option_schema({**option, "type": option.get("elements", "raw")}, f"{path}[]")}
    if "choices" in option:
        return {"enum": list(option["choices"])}
    if kind != "dict":
        if "." not in path and path.endswith(TIMES):
            return SECONDS[kind]
        # YAML takes 007 for a number; a secret has to be written as the text it is
        return (STRICT if "." in path or option.get("no_log") else LENIENT)[kind]
    if "options" not in option:
        return {"type": "object"}
    return {
        "type": "object",
        "properties": {name: option_schema(inner, f"{path}.{name}") for name, inner in option["options"].items()},
        "required": [name for name, inner in option["options"].items() if inner.get("required")],
        "additionalProperties": False,
    }
