# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""JSON Schema (2020-12) of the fleet's own variables. Formats are those of _formats.FORMS.

Every mapping is closed: a key that nobody reads is a mistake that nobody would see. `x-allowed` holds the words for an
operator where the schema's own would not be understood.
"""

from __future__ import annotations

from typing import Any, Mapping

from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.observability_schema import OBSERVABILITY_VARIABLES
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.role_variables import ROLE_VARIABLES

Schema = Mapping[str, Any]


def text(form: str | None = None) -> dict[str, Any]:
    """A text, of a form where one is named."""
    return {"type": "string", "format": form} if form else {"type": "string", "minLength": 1}


def one_of(*choices: str) -> dict[str, Any]:
    """One of some words."""
    return {"enum": list(choices)}


def listing(items: Schema, least: int = 0) -> dict[str, Any]:
    """A list of the like."""
    return {"type": "array", "items": items, "minItems": least}


def mapping(properties: Mapping[str, Schema], *required: str) -> dict[str, Any]:
    """A mapping of these keys and no other."""
    return {
        "type": "object",
        "properties": dict(properties),
        "required": list(required),
        "additionalProperties": False,
    }


def table(keys: str, values: Schema) -> dict[str, Any]:
    """A mapping of free keys of one form."""
    return {"type": "object", "propertyNames": {"format": keys}, "additionalProperties": values}


FLAG: Schema = {"type": "boolean"}
FREE: Schema = {"type": "object"}
QUANTITY: Schema = {
    "anyOf": [text("quantity"), {"type": "number", "minimum": 0}],
    "x-allowed": "a Kubernetes quantity such as 500m, 256Mi or 2",
}
SIZE: Schema = {
    "anyOf": [text("size"), {"type": "number", "exclusiveMinimum": 0}],
    "x-allowed": "a Kubernetes quantity above zero such as 500Mi or 1Gi",
}
RESOURCES: Schema = table("resource-name", QUANTITY)


def number(low: float, above: bool = False) -> dict[str, Any]:
    """A number from `low` on, or above it."""
    return {"type": "number", "exclusiveMinimum" if above else "minimum": low}


def whole(low: int, high: int = 86400) -> dict[str, Any]:
    """A whole number; a day is the longest time that makes sense in seconds."""
    return {"type": "integer", "minimum": low, "maximum": high}


def named(properties: Mapping[str, Schema]) -> dict[str, Any]:
    """A graph name, alone or with conditions on it."""
    return {
        "anyOf": [text("graph-name"), mapping({"name": text("graph-name"), **properties}, "name")],
        "x-allowed": "a ROS name or a mapping with the key name",
    }


TOPIC: Schema = mapping(
    {
        "name": text("graph-name"),
        "type": text("ros-type"),
        "publishers": whole(0),
        "subscribers": whole(0),
        "connected": FLAG,
        "min_rate": number(0, above=True),
    },
    "name",
)

READINESS: Schema = mapping(
    {
        "command": {
            "anyOf": [text(), listing({"type": "string"}, 1)],
            "x-allowed": "a command as text, or as a list of texts",
        },
        "nodes": FLAG,
        "topics": listing(TOPIC),
        "services": listing(named({})),
        "actions": listing(named({"state": one_of("up", "idle")})),
        "absent": listing(text("graph-name")),
        "timeout": number(0, above=True),
        "interval": number(0, above=True),
        "consecutive": whole(1, 1000),
    }
)

APP: Schema = mapping(
    {
        "name": text("app-name"),
        "image": text("image"),
        "command": listing({"type": "string"}, 1),
        "args": listing({"type": "string"}),
        "env": table("env-name", {"type": ["string", "number", "boolean"]}),
        "placement": one_of("local", "remote"),
        "scope": one_of("robot", "fleet"),
        "pattern": one_of("pubsub", "service", "action"),
        "handoff": one_of("overlap", "drain", "replace"),
        "node_name": text("node-name"),
        "private_names": listing(text("private-name")),
        "volumes": listing(
            mapping({"name": text("volume-name"), "mount_path": text("mount-path"), "read_only": FLAG}, "name")
        ),
        "readiness": READINESS,
        "hooks": FLAG,
        "depends_on": listing(text("app-name")),
        "update": mapping(
            {
                "group": text("app-name"),
                "idle": listing(text("graph-name")),
                "on_busy": one_of("wait", "defer", "force"),
            }
        ),
        "drain_deadline": whole(0),
        "termination_grace_period": whole(1),
        "resources": mapping({"requests": RESOURCES, "limits": RESOURCES}),
        "devices": listing(text("device")),
        "host_network": FLAG,
        "host_paths": listing(
            mapping({"path": text("host-path"), "mount_path": text("mount-path"), "read_only": FLAG}, "path")
        ),
        "overrides": FREE,
    },
    "name",
    "image",
)

VOLUME: Schema = mapping(
    {
        "name": text("volume-name"),
        "size": SIZE,
        "storage_class": text("dns-name"),
        "mountPath": text("mount-path"),
        "access_mode": one_of("ReadWriteOnce", "ReadWriteOncePod", "ReadWriteMany", "ReadOnlyMany"),
    },
    "name",
)

PULL_SECRET: Schema = {
    **mapping(
        {"name": text("dns-name"), "registry": text(), "username": text(), "password": text()},
        "name",
    ),
    "dependentRequired": {"registry": ["username", "password"], "username": ["registry"], "password": ["registry"]},
}

TAINT: Schema = mapping(
    {
        "key": text("label-name"),
        "value": text("label-value"),
        "effect": one_of("NoSchedule", "PreferNoSchedule", "NoExecute"),
    },
    "key",
    "effect",
)

FLEET_VARIABLES: dict[str, Schema] = {
    "fleet_kubeconfig_dir": text(),
    "robot_mode": one_of("agent", "standalone"),
    "ros_apps": listing(APP),
    "persistent_storage": mapping({"volumes": listing(VOLUME)}),
    "ros_master_mode": one_of("robot", "shared", "external"),
    "ros_master_image": text("image"),
    # empty is the roles' default and says the same as leaving them out
    "ros_master_uri": {"anyOf": [text("master-uri"), {"const": ""}], "x-allowed": "http://<host>:<port>"},
    "ros_master_placement": {**one_of("", "local", "remote"), "x-allowed": "local or remote"},
    "ros_master_goal_forwarding": FLAG,
    "ros_master_overrides": FREE,
    "node_labels": table("label-name", text("label-value")),
    "node_taints": listing(TAINT),
    "robot_namespace_quota": RESOURCES,
    "robot_namespace_limits": mapping(
        dict.fromkeys(("default", "defaultRequest", "max", "min", "maxLimitRequestRatio"), RESOURCES)
    ),
    "robot_namespace_pull_secrets": listing(PULL_SECRET),
    **OBSERVABILITY_VARIABLES,
}

VARIABLES: dict[str, Schema] = {**ROLE_VARIABLES, **FLEET_VARIABLES}
HOST: Schema = mapping(VARIABLES)
