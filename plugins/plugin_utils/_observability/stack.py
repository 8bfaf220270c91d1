# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The observability stack of one cluster: spec and files -> objects. Pure and deterministic.

`files` is {rules: {name: text}, loki_rules: {..}, dashboards: {folder: {name: text}}}.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import names as obs
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import workload
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.alertmanager import (
    alertmanager_objects,
    alertmanager_secret,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.grafana import grafana_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.loki import RULES_MAP as LOKI_RULES_MAP
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.loki import loki_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.node_exporter import node_exporter_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.prometheus import (
    RULES_MAP,
    prometheus_objects,
    vmagent_objects,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.shipper import shipper_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.spec import runs

Spec = Mapping[str, Any]
Object = dict[str, Any]


ADMIN_SECRET = {
    "apiVersion": "v1",
    "kind": "Secret",
    "metadata": {"name": obs.ADMIN_SECRET, "namespace": obs.NAMESPACE},
}


def stack_objects(spec: Spec, files: Mapping[str, Any], admin_version: str = "") -> list[Object]:
    """All objects but the Secrets: what is in them may be shown. Grafana is restarted for another `admin_version`."""
    wanted = runs(spec)
    found = [namespace_object(spec)]
    if wanted[obs.PROMETHEUS]:
        found += prometheus_objects(spec, files.get("rules") or {})
    if wanted[obs.LOKI]:
        found += loki_objects(spec, files.get("loki_rules") or {})
    if wanted[obs.ALERTMANAGER]:
        found += alertmanager_objects(spec)
    if wanted[obs.VMAGENT]:
        found += vmagent_objects(spec)
    if wanted[obs.NODE_EXPORTER]:
        found += node_exporter_objects(spec)
    if wanted[obs.SHIPPER]:
        found += shipper_objects(spec)
    if wanted[obs.GRAFANA]:
        dashboards = dict(files.get("dashboards") or {})
        if not spec["grafana"]["default_dashboards"]:
            dashboards.pop("Fleet", None)
        found += grafana_objects(spec, dashboards, admin_version)
    return found


def leftovers(spec: Spec) -> list[Object]:
    """Objects of parts that no longer run: to be deleted. Never a claim or a Secret: data is its owner's to delete."""
    wanted = runs(spec)
    found: list[Object] = []
    for name in (name for name, on in wanted.items() if not on):
        found.append(_reference("apps/v1", obs.WORKLOADS[name], name))
        if name != obs.NODE_EXPORTER:
            found.append(_reference("v1", "ConfigMap", name))
        if obs.WORKLOADS[name] == "Deployment":
            found.append(_reference("v1", "Service", name))
            found.append(_reference("networking.k8s.io/v1", "NetworkPolicy", name))
        found += [_reference("v1", "ConfigMap", {obs.PROMETHEUS: RULES_MAP, obs.LOKI: LOKI_RULES_MAP}.get(name, ""))]
    for name in (obs.PROMETHEUS, obs.VMAGENT):
        if not wanted[name]:
            wide = f"rosops-fleet-{name}"
            found += [
                _reference("rbac.authorization.k8s.io/v1", f"ClusterRole{kind}", wide) for kind in ("Binding", "")
            ]
            found.append(_reference("v1", "ServiceAccount", name))
    if not spec["allowed_networks"]:
        opened = (obs.GRAFANA, obs.PROMETHEUS, obs.LOKI)
        found += [_reference("networking.k8s.io/v1", "NetworkPolicy", name) for name in opened if wanted[name]]
    return [item for item in found if item["metadata"]["name"]]


def stack_secrets(spec: Spec, admin: Mapping[str, str]) -> list[Object]:
    """Grafana's password, `{password, version}`, and Alertmanager's configuration."""
    wanted = runs(spec)
    found = []
    if wanted[obs.GRAFANA] and admin["password"]:
        secret = {"user": "admin", "password": admin["password"], "version": admin["version"]}
        meta = workload.metadata(obs.ADMIN_SECRET, obs.GRAFANA, spec)
        data = {key: base64.b64encode(str(value).encode()).decode() for key, value in secret.items()}
        found.append({"apiVersion": "v1", "kind": "Secret", "metadata": meta, "data": data})
    if wanted[obs.ALERTMANAGER]:
        found.append(alertmanager_secret(spec))
    return found


def has_grafana(spec: Spec) -> bool:
    """Whether there is a Grafana, and with it a password."""
    return runs(spec)[obs.GRAFANA]


def grafana_admin(secret: Mapping[str, Any] | None, given: str, fresh: str) -> dict[str, str]:
    """The password that holds: the given one, else the one that the cluster has, else a fresh one.

    `secret` is what the cluster has, `fresh` is random text: its first eight characters become
    the version of a password that is new, the rest the password where none is given.
    """
    if len(fresh) < 24:
        raise SpecError("needs at least 24 random characters")
    there = (secret or {}).get("data") or {}
    known = {key: base64.b64decode(there.get(key, "")).decode() for key in ("password", "version")}
    if known["password"] and given in ("", known["password"]) and known["version"]:
        return known
    return {"password": given or known["password"] or fresh[8:], "version": fresh[:8]}


def namespace_object(spec: Spec) -> Object:
    """The stack's namespace."""
    labels = {
        "app.kubernetes.io/managed-by": names.MANAGER,
        # the hosts' files and network are what node exporter and log shipper are about
        "pod-security.kubernetes.io/enforce": "privileged",
    }
    if spec["robot"]:
        labels[names.LABEL_ROBOT] = spec["robot"]
    return {"apiVersion": "v1", "kind": "Namespace", "metadata": {"name": obs.NAMESPACE, "labels": labels}}


def _reference(api: str, kind: str, name: str) -> Object:
    wide = kind.startswith("ClusterRole")
    return {
        "apiVersion": api,
        "kind": kind,
        "metadata": {"name": name} | ({} if wide else {"namespace": obs.NAMESPACE}),
    }
