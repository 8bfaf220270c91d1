# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Grafana's provisioning files: data sources with fixed uids, and folders of dashboards. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import names as obs
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.spec import runs

Spec = Mapping[str, Any]

PROVISIONING = "/etc/grafana/provisioning"
# folder in Grafana -> directory: the collection's own dashboards, and those of the inventory
FOLDERS = {"Fleet": "/etc/dashboards/fleet", "Own": "/etc/dashboards/own"}


def datasources(spec: Spec) -> dict[str, Any]:
    """datasources.yml; spec is complete. Dashboards know the sources by their uids."""
    wanted = runs(spec)
    found: list[dict[str, Any]] = []
    if wanted[obs.PROMETHEUS]:
        # Grafana's $__rate_interval comes from it
        more = {"timeInterval": spec["prometheus"]["scrape_interval"], "httpMethod": "POST"}
        found.append(_source("Prometheus", obs.PROMETHEUS, isDefault=True, jsonData=more))
    if wanted[obs.LOKI]:
        found.append(_source("Loki", obs.LOKI, isDefault=not found, jsonData={"maxLines": 1000}))
    if wanted[obs.ALERTMANAGER]:
        found.append(_source("Alertmanager", obs.ALERTMANAGER, jsonData={"implementation": "prometheus"}))
    return {"apiVersion": 1, "prune": True, "datasources": found}


def _source(name: str, kind: str, **more: Any) -> dict[str, Any]:
    return {
        "name": name,
        "type": kind,
        "uid": kind,
        "access": "proxy",
        "url": obs.url(kind),
        "editable": False,
        **more,
    }


def providers(folders: Mapping[str, str] | None = None) -> dict[str, Any]:
    """dashboards.yml: read again every half minute, so that a changed dashboard restarts nothing."""
    return {
        "apiVersion": 1,
        "providers": [
            {
                "name": folder,
                "folder": folder,
                "type": "file",
                "disableDeletion": False,
                "allowUiUpdates": False,
                "updateIntervalSeconds": 30,
                "options": {"path": path},
            }
            for folder, path in (FOLDERS if folders is None else folders).items()
        ],
    }
