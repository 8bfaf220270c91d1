# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""JSON Schema (2020-12) of the variables: keys, types and choices from the argument specs, and forms from here.

Every mapping is closed: a key that nobody reads is a mistake that nobody would see. `x-allowed` holds the words for an
operator where the schema's own would not be understood.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._pod.hung import LEAST
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.role_specs import Option, all_options
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.layers import LAYERS

Schema = Mapping[str, Any]


def text(form: str | None = None) -> Schema:
    """A text, of a form (formats.FORMS) where one is named."""
    return {"type": "string", "format": form} if form else {"type": "string", "minLength": 1}


def table(keys: str, values: Schema) -> Schema:
    """A mapping of free keys of one form."""
    return {"type": "object", "propertyNames": {"format": keys}, "additionalProperties": values}


def either(allowed: str, *schemas: Schema) -> Schema:
    """One of several schemas, with words for all of them."""
    return {"anyOf": list(schemas), "x-allowed": allowed}


def number(low: float, above: bool = False) -> Schema:
    """A number from `low` on, or above it."""
    return {"type": "number", "exclusiveMinimum" if above else "minimum": low}


def numeral(allowed: str, schema: Schema, pattern: str) -> Schema:
    """A number, or the text of one."""
    return either(allowed, schema, {"type": "string", "pattern": pattern, "x-allowed": allowed})


def whole(low: int, high: int = 86400) -> Schema:
    """A whole number; a day is the longest time that makes sense in seconds."""
    return {"type": "integer", "minimum": low, "maximum": high}


def named(**properties: Schema) -> Schema:
    """A graph name, alone or in a mapping with conditions on it."""
    closed = {"type": "object", "required": ["name"], "additionalProperties": False}
    mapping = {**closed, "properties": {"name": text("graph-name"), **properties}}
    return either("a ROS name or a mapping with the key name", text("graph-name"), mapping)


FLAG: Schema = {"type": "boolean"}
QUANTITIES: Schema = table(
    "resource-name",
    either("a Kubernetes quantity such as 500m, 256Mi or 2", text("quantity"), number(0)),
)
SIZE: Schema = either("a Kubernetes quantity above zero such as 500Mi or 1Gi", text("size"), number(0, above=True))
NODE_PORT: Schema = whole(30000, 32767)
COMMAND: Schema = either(
    "a command as text, or as a list of texts",
    text(),
    {"type": "array", "items": {"type": "string"}, "minItems": 1},
)

# An empty answer of AWX's survey is nothing to ansible-core.
NAMES: Schema = either(
    "a list of names, also as a text such as 'camera, lidar'",
    {"type": "array", "items": {"type": "string"}},
    {"type": ["string", "null"]},
)

# What messages must say; the rest of it is for `when`.
VALUE: Schema = {
    "type": "object",
    "required": ["topic"],
    "additionalProperties": False,
    "properties": {
        "topic": text("graph-name"),
        "field": text(),
        "equals": {"type": ["string", "number", "boolean"]},
        "above": {"type": "number"},
        "below": {"type": "number"},
        "quiet": number(0, above=True),
        "still": number(0, above=True),
        "tolerance": number(0),
    },
}

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
    "ros_apps[].name": text("app-name"),
    "ros_apps[].image": text("image"),
    "ros_apps[].command": {"minItems": 1},
    "ros_apps[].launch.package": text("package-name"),
    "ros_apps[].launch.file": either(
        "a launch file's name, or a list of them",
        text("launch-file"),
        {"type": "array", "items": text("launch-file"), "minItems": 1},
    ),
    "ros_apps[].launch.replace[]": text("node-path"),
    "ros_apps[].launch.overlap[]": text("node-path"),
    "ros_apps[].launch.args": table("launch-arg", {"type": ["string", "number", "boolean"]}),
    "ros_apps[].env": table(
        "env-name",
        either(
            "a text, a number, true, false, or a mapping with secret and key",
            {"type": ["string", "number", "boolean"]},
            {
                "type": "object",
                "required": ["secret", "key"],
                "additionalProperties": False,
                "properties": {"secret": text("dns-name"), "key": text("secret-key")},
            },
        ),
    ),
    "ros_apps[].params": table("param-name", {}),
    "ros_apps[].keep_params[]": text("param-name"),
    "ros_apps[].ports[].name": text("port-name"),
    "ros_apps[].ports[].port": whole(1, 65535),
    "ros_apps[].ports[].host_port": whole(1, 65535),
    "ros_apps[].ports[].node_port": NODE_PORT,
    "ros_apps[].files[].path": text("mount-path"),
    "ros_apps[].files[].content": text("unicode"),
    "ros_apps[].files[].secret": text("dns-name"),
    "ros_apps[].files[].key": text("secret-key"),
    "ros_apps[].files[].mode": text("file-mode"),
    "ros_apps[].node_name": text("node-name"),
    "ros_apps[].private_names[]": text("private-name"),
    "ros_apps[].volumes[].name": text("volume-name"),
    "ros_apps[].volumes[].mount_path": text("mount-path"),
    "ros_apps[].readiness.command": COMMAND,
    "ros_apps[].readiness.topics[].name": text("graph-name"),
    "ros_apps[].readiness.topics[].type": text("ros-type"),
    "ros_apps[].readiness.topics[].publishers": whole(0),
    "ros_apps[].readiness.topics[].subscribers": whole(0),
    "ros_apps[].readiness.topics[].min_rate": number(0, above=True),
    "ros_apps[].readiness.services[]": named(),
    "ros_apps[].readiness.actions[]": named(state={"enum": ["up", "idle"]}),
    "ros_apps[].readiness.absent[]": text("graph-name"),
    "ros_apps[].readiness.timeout": number(0, above=True),
    "ros_apps[].readiness.interval": number(0, above=True),
    "ros_apps[].readiness.consecutive": whole(1, 1000),
    "ros_apps[].depends_on[]": text("app-name"),
    "ros_apps[].update.group": text("app-name"),
    "ros_apps[].update.idle[]": text("graph-name"),
    "ros_apps[].update.when[]": VALUE,
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
    "ros_apps[].update.ignore[]": text("graph-pattern"),
    "ros_apps[].update.renamed": table("graph-name", text("graph-name")),
    "ros_apps[].update.rates": table("graph-pattern", number(0)),
    "ros_apps[].liveness_timeout": {
        **whole(0),
        "not": {"exclusiveMinimum": 0, "exclusiveMaximum": LEAST},
        "x-allowed": f"0 for never, or {LEAST} seconds and more",
    },
    "ros_apps[].drain_deadline": whole(0),
    "ros_apps[].termination_grace_period": whole(1),
    "ros_apps[].resources.requests": QUANTITIES,
    "ros_apps[].resources.limits": QUANTITIES,
    "ros_apps[].devices[]": text("device"),
    "ros_apps[].host_paths[].path": text("host-path"),
    "ros_apps[].host_paths[].mount_path": text("mount-path"),
    "persistent_storage.volumes[].name": text("volume-name"),
    "persistent_storage.volumes[].size": SIZE,
    "persistent_storage.volumes[].storage_class": text("dns-name"),
    "persistent_storage.volumes[].mountPath": text("mount-path"),
    "k3s_version": text("k3s-version"),
    "k3s_node_ip": either("an IP address, or one of each family", text("addresses"), {"const": ""}),
    "ros_master_image": text("image"),
    # empty is the roles' default and says the same as leaving it out
    "ros_master_uri": either("http://<host>:<port>", text("master-uri"), {"const": ""}),
    "ros_master_placement": {"x-allowed": "local or remote"},
    "ros_master_goal_forwarding": FLAG,
    "node_labels": table("label-name", text("label-value")),
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
            "observability_out_of_order_window",
        ),
        text("retention"),
    ),
    **dict.fromkeys(
        (
            "observability.grafana.persistence.size",
            "observability.loki.persistence.size",
            "observability_prometheus_size",
            "observability_store_size",
        ),
        SIZE,
    ),
    **dict.fromkeys(
        ("observability_grafana_node_port", "observability_hub_metrics_port", "observability_hub_logs_port"), NODE_PORT
    ),
    **{f"observability_images.{part}": text("image") for part in all_options()["observability_images"]["options"]},
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
    return {**{name: schema_of(option, name) for name, option in all_options().items()}, **OWN}


def host_schema() -> Schema:
    """The schema of one host's variables."""
    return {"type": "object", "properties": variables(), "additionalProperties": False}


def schema_of(option: Option, path: str) -> Schema:
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
        return {"type": "array", "items": schema_of({**option, "type": option.get("elements", "raw")}, f"{path}[]")}
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
        "properties": {name: schema_of(inner, f"{path}.{name}") for name, inner in option["options"].items()},
        "required": [name for name, inner in option["options"].items() if inner.get("required")],
        "additionalProperties": False,
    }
