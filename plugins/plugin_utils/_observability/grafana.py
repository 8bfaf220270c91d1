# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Grafana on the cluster: objects. What it shows is provisioned from files; its claim keeps what users add. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.common import pod_spec
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import names as obs
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import workload
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.grafana_provisioning import (
    FOLDERS,
    PROVISIONING,
    datasources,
    providers,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.yaml_text import yaml_text

Spec = Mapping[str, Any]
Object = dict[str, Any]

USER = 472  # as in its image
DATA = "/var/lib/grafana"
ADMIN_DIR = "/etc/grafana-admin"
PREFIXES = {"Fleet": "dashboard-", "Own": "own-dashboard-"}
SETTINGS = {
    "GF_SECURITY_ADMIN_USER": "admin",
    "GF_SECURITY_ADMIN_PASSWORD__FILE": f"{ADMIN_DIR}/password",
    "GF_SECURITY_DISABLE_GRAVATAR": "true",
    "GF_USERS_ALLOW_SIGN_UP": "false",
    "GF_LOG_LEVEL": "warn",
    # nothing is fetched from outside, and nobody is told
    "GF_ANALYTICS_REPORTING_ENABLED": "false",
    "GF_ANALYTICS_CHECK_FOR_UPDATES": "false",
    "GF_ANALYTICS_CHECK_FOR_PLUGIN_UPDATES": "false",
    "GF_NEWS_NEWS_FEED_ENABLED": "false",
    "GF_PLUGINS_PREINSTALL_DISABLED": "true",
    "GF_PLUGINS_PLUGIN_ADMIN_ENABLED": "false",
}
# Grafana takes the password from its settings only when it makes its database. So that a password which is changed in
# the inventory becomes the one that counts, it is set in a database that has another one. The mark beside the database
# says which: not the password, but the version that its Secret got with it.
SET_PASSWORD = """
set -eu
if [ -f {data}/grafana.db ] && [ "$(cat {data}/.admin-version 2>/dev/null || true)" != "$ADMIN_VERSION" ]; then
  grafana cli --homepath /usr/share/grafana admin reset-admin-password --password-from-stdin \
    < {admin}/password > /dev/null
fi
printf %s "$ADMIN_VERSION" > {data}/.admin-version
""".strip().format(data=DATA, admin=ADMIN_DIR)


def grafana_objects(spec: Spec, dashboards: Mapping[str, Mapping[str, str]], admin_version: str) -> list[Object]:
    """Grafana; `dashboards` is {folder: {file name: text}}, each of them a ConfigMap of its own.

    `admin_version` is another one for every password.
    """
    name, grafana = obs.GRAFANA, spec["grafana"]
    files = {"datasources.yml": yaml_text(datasources(spec)), "dashboards.yml": yaml_text(providers())}
    persistent = grafana["persistence"]["enabled"]
    maps = [
        workload.config_map(map_name(folder, file), name, spec, {file: text})
        for folder, found in dashboards.items()
        for file, text in sorted(found.items())
    ]
    open_port = spec["grafana_node_port"] if grafana["service_type"] == "NodePort" else None
    return [
        workload.config_map(name, name, spec, files),
        *maps,
        *([workload.claim(name, spec, grafana["persistence"]["size"])] if persistent else []),
        workload.workload(name, spec, _pod(spec, dashboards, persistent, admin_version), files),
        workload.service(name, spec, open_port),
        *(workload.allow_list(name, spec) if open_port is not None else []),
    ]


def map_name(folder: str, file: str) -> str:
    """A dashboard's ConfigMap: what a file's name may have and an object's may not becomes a dash."""
    stem = file.rpartition(".")[0].lower()
    return PREFIXES[folder] + (
        "".join(one if one.isascii() and one.isalnum() else "-" for one in stem).strip("-") or "x"
    )


def _pod(spec: Spec, dashboards: Mapping[str, Mapping[str, str]], persistent: bool, admin_version: str) -> Object:
    name, image = obs.GRAFANA, spec["images"]["grafana"]
    version = {"name": "ADMIN_VERSION", "value": admin_version}
    settings = [{"name": key, "value": value} for key, value in SETTINGS.items()]
    own = [
        {"name": "data", "mountPath": DATA},
        {"name": "admin", "mountPath": ADMIN_DIR, "readOnly": True},
        {"name": "tmp", "mountPath": "/tmp"},  # noqa: S108 - the container's own
    ]
    provisioning = [
        {"name": "config", "mountPath": f"{PROVISIONING}/datasources", "readOnly": True},
        {"name": "providers", "mountPath": f"{PROVISIONING}/dashboards", "readOnly": True},
        *(
            {"name": f"dashboards-{folder.lower()}", "mountPath": path, "readOnly": True}
            for folder, path in FOLDERS.items()
        ),
    ]
    command = ["/bin/sh", "-c", SET_PASSWORD]
    first = workload.container("admin-password", image, command=command, env=[*settings, version], volumeMounts=own)
    container = workload.container(
        name,
        image,
        env=settings,
        ports=workload.port_of(name),
        resources=workload.resources("50m", "128Mi", "512Mi"),
        volumeMounts=[*own, *provisioning],
        readinessProbe=workload.probe("/api/health", obs.PORTS[name]),
    )
    volumes = [
        workload.data_volume(name, persistent),
        {"name": "admin", "secret": {"secretName": obs.ADMIN_SECRET}},
        {"name": "tmp", "emptyDir": {}},
        _part("config", "datasources.yml"),
        _part("providers", "dashboards.yml"),
        *(_folder(folder, dashboards.get(folder) or {}) for folder in FOLDERS),
    ]
    return pod_spec([container], volumes, initContainers=[first], securityContext=workload.as_user(USER))


def _part(volume: str, file: str) -> Object:
    items = [{"key": file, "path": file}]
    return {"name": volume, "configMap": {"name": obs.GRAFANA, "items": items}}


def _folder(folder: str, files: Mapping[str, str]) -> Object:
    """A folder's ConfigMaps in one directory; an empty one where there are none, since Grafana wants it to be there."""
    volume: Object = {"name": f"dashboards-{folder.lower()}"}
    if not files:
        return {**volume, "emptyDir": {}}
    sources = [{"configMap": {"name": map_name(folder, file)}} for file in sorted(files)]
    return {**volume, "projected": {"sources": sources}}
