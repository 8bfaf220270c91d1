# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Types of the roles' public variables, so that a wrong one is reported before anything is touched.

The roles' own meta/argument_specs.yml say the rest; tests/unit/test_role_specs.py fails where this table and they
differ, and its message is the table as it should be.
"""

from __future__ import annotations

from typing import Any, Mapping

Option = Mapping[str, Any]

# YAML takes 007 for a number; a token has to be written as the text it is.
STRICT_TEXT = ("k3s_token", "k3s_agent_token")

# Variables given by `-e name=value` arrive as text, so Ansible's own conversions are followed.
_SCALARS: dict[str, dict[str, Any]] = {
    "str": {"type": ["string", "number"]},
    "path": {"type": "string"},
    "raw": {},
    "int": {"anyOf": [{"type": "integer"}, {"type": "string", "pattern": "^-?[0-9]+$"}], "x-allowed": "a whole number"},
    "float": {
        "anyOf": [{"type": "number"}, {"type": "string", "pattern": r"^-?[0-9]+(\.[0-9]+)?$"}],
        "x-allowed": "a number",
    },
    "bool": {
        "anyOf": [{"type": "boolean"}, {"enum": ["true", "false", "yes", "no", "on", "off", "1", "0", 1, 0]}],
        "x-allowed": "true or false",
    },
}

# As in the argument specs, without defaults and descriptions.
OPTIONS: dict[str, Option] = {
    "cluster_api_kubeconfig": {"type": "str"},
    "images_archives": {
        "type": "list",
        "elements": "dict",
        "options": {"path": {"type": "str", "required": True}, "images": {"type": "list", "elements": "str"}},
    },
    "images_needed": {"type": "list", "elements": "str"},
    "images_refs": {"type": "list", "elements": "str"},
    "images_throttle": {"type": "int"},
    "images_rate_limit": {"type": "str"},
    "images_dir": {"type": "str"},
    "k3s_role": {"type": "str", "choices": ["server", "agent"]},
    "k3s_cluster": {"type": "str"},
    "k3s_server_hosts": {"type": "list", "elements": "str"},
    "k3s_state": {"type": "str", "choices": ["present", "absent"]},
    "k3s_install_source": {"type": "str", "choices": ["release", "airgap"]},
    "k3s_version": {"type": "str"},
    "k3s_release_url": {"type": "str"},
    "k3s_release_checksums": {
        "type": "dict",
        "options": {"x86_64": {"type": "str"}, "aarch64": {"type": "str"}, "armv7l": {"type": "str"}},
    },
    "k3s_airgap_dir": {"type": "str"},
    "k3s_config": {"type": "dict"},
    "k3s_disable": {"type": "list", "elements": "str"},
    "k3s_tls_sans": {"type": "list", "elements": "str"},
    "k3s_registries": {"type": "dict"},
    "k3s_environment": {"type": "dict"},
    "k3s_node_name": {"type": "str"},
    "k3s_node_ip": {"type": "str"},
    "k3s_api_endpoint": {"type": "str"},
    "k3s_token": {"type": "str"},
    "k3s_agent_token": {"type": "str"},
    "k3s_kubeconfig_path": {"type": "str"},
    "k3s_limit_nofile": {"type": "int"},
    "k3s_limit_nproc": {"type": "str"},
    "k3s_limit_tasks": {"type": "str"},
    "k3s_memory_high": {"type": "str"},
    "k3s_memory_max": {"type": "str"},
    "k3s_start_timeout": {"type": "int"},
    "k3s_remove_volumes": {"type": "bool"},
    "k3s_remove_identity": {"type": "bool"},
    "node_name": {"type": "str"},
    "node_placement": {"type": "str", "choices": ["local", "remote"]},
    "node_robot": {"type": "str"},
    "node_ready_timeout": {"type": "int"},
    "observability_enabled": {"type": "bool"},
    "observability_profile": {"type": "str", "choices": ["standalone", "robot", "hub"]},
    "observability_log_shipper": {"type": "str", "choices": ["otelcol", "promtail", "none"]},
    "observability_prometheus_enabled": {"type": "bool"},
    "observability_loki_enabled": {"type": "bool"},
    "observability_loki_persistence": {"type": "bool"},
    "observability_grafana_enabled": {"type": "bool"},
    "observability_grafana_admin_password": {"type": "str"},
    "observability_default_dashboards": {"type": "bool"},
    "observability_dashboards": {"type": "list", "elements": "path"},
    "observability_grafana_service_type": {"type": "str", "choices": ["NodePort", "ClusterIP"]},
    "observability_grafana_persistence": {"type": "bool"},
    "observability_node_exporter": {"type": "bool"},
    "observability_ros_metrics": {"type": "bool"},
    "observability_ros_statistics": {"type": "bool"},
    "observability_claims_path": {"type": "str"},
    "observability_alertmanager_enabled": {"type": "bool"},
    "observability_alertmanager_config": {"type": "dict"},
    "observability_storage_class": {"type": "str"},
    "observability_robot": {"type": "str"},
    "observability_remote_nodes": {"type": "list", "elements": "str"},
    "observability_ready_timeout": {"type": "int"},
    "preflight_role": {"type": "str", "choices": ["server", "agent"]},
    "preflight_server_hosts": {"type": "list", "elements": "str"},
    "preflight_node_name": {"type": "str"},
    "preflight_systems": {"type": "list", "elements": "str"},
    "preflight_server_memory_mb": {
        "type": "dict",
        "options": {"minimum": {"type": "int", "required": True}, "recommended": {"type": "int", "required": True}},
    },
    "preflight_agent_memory_mb": {
        "type": "dict",
        "options": {"minimum": {"type": "int", "required": True}, "recommended": {"type": "int", "required": True}},
    },
    "preflight_disk_mb": {
        "type": "dict",
        "options": {"minimum": {"type": "int", "required": True}, "recommended": {"type": "int", "required": True}},
    },
    "preflight_clock_offset": {
        "type": "dict",
        "options": {"maximum": {"type": "float", "required": True}, "recommended": {"type": "float", "required": True}},
    },
    "preflight_minimum_mtu": {"type": "int"},
    "preflight_server_ports": {
        "type": "list",
        "elements": "dict",
        "options": {"port": {"type": "int", "required": True}, "protocol": {"type": "str", "choices": ["tcp", "udp"]}},
    },
    "preflight_agent_ports": {
        "type": "list",
        "elements": "dict",
        "options": {"port": {"type": "int", "required": True}, "protocol": {"type": "str", "choices": ["tcp", "udp"]}},
    },
    "preflight_timeout": {"type": "float"},
    "ros_app_rollout_timeout": {"type": "int"},
    "storage_remove_claims": {"type": "list", "elements": "str"},
    "storage_remove_confirm": {"type": "bool"},
    "update_apps": {"type": "list", "elements": "str"},
    "update_to": {"type": "str"},
    "update_shared": {"type": "bool"},
    "update_on_busy": {"type": "str", "choices": ["wait", "defer", "force"]},
    "update_busy_timeout": {"type": "float"},
    "update_ready_timeout": {"type": "float"},
    "update_verify_seconds": {"type": "float"},
    "update_rate_tolerance": {"type": "float"},
    "update_rate_seconds": {"type": "float"},
    "update_failure_budget": {"type": "str"},
}


def json_schema(option: Option) -> dict[str, Any]:
    """An option of an argument spec as JSON Schema."""
    kind = option.get("type", "str")
    if "choices" in option:
        return {"enum": list(option["choices"])}
    if kind == "list":
        return {"type": "array", "items": json_schema({**option, "type": option.get("elements", "raw")})}
    if kind != "dict":
        return dict(_SCALARS[kind])
    if "options" not in option:
        return {"type": "object"}
    return {
        "type": "object",
        "properties": {name: json_schema(inner) for name, inner in option["options"].items()},
        "required": [name for name, inner in option["options"].items() if inner.get("required")],
        "additionalProperties": False,
    }


ROLE_VARIABLES: dict[str, Mapping[str, Any]] = {
    name: {"type": "string"} if name in STRICT_TEXT else json_schema(option) for name, option in OPTIONS.items()
}
