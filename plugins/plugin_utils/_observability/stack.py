# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The observability stack of one cluster: spec and files -> objects. Pure and deterministic.

`files` is {rules: {name: text}, loki_rules: {..}, dashboards: {folder: {name: text}}}.
"""

from __future__ import annotations

import base64
from typing import Any, Mapping

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import names as obs
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import workload as made
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
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.spec import complete_spec, images, runs

Spec = Mapping[str, Any]
Object = dict[str, Any]


def observability_objects(spec: Spec, files: Mapping[str, Any] | None = None) -> list[Object]:
    """All objects but the Secrets: what is in them may be shown."""
    full, wanted, given = complete_spec(spec), runs(complete_spec(spec)), files or {}
    found = [_namespace(full)]
    if wanted[obs.PROMETHEUS]:
        found += prometheus_objects(full, given.get("rules") or {})
    if wanted[obs.LOKI]:
        found += loki_objects(full, given.get("loki_rules") or {})
    if wanted[obs.ALERTMANAGER]:
        found += alertmanager_objects(full)
    if wanted[obs.VMAGENT]:
        found += vmagent_objects(full)
    if wanted[obs.NODE_EXPORTER]:
        found += node_exporter_objects(full)
    if wanted[obs.SHIPPER]:
        found += shipper_objects(full)
    if wanted[obs.GRAFANA]:
        dashboards = dict(given.get("dashboards") or {})
        if not full["grafana"]["default_dashboards"]:
            dashboards.pop("Fleet", None)
        found += grafana_objects(full, dashboards)
    return found


def observability_images(spec: Spec) -> list[str]:
    """The images that this spec's stack needs, for a registry or an archive of one's own."""
    return images(complete_spec(spec))


def observability_leftovers(spec: Spec) -> list[Object]:
    """Objects of parts that no longer run: to be deleted. Never a claim or a Secret: data is its owner's to delete."""
    full = complete_spec(spec)
    wanted = runs(full)
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
    if not full["allowed_networks"]:
        opened = (obs.GRAFANA, obs.PROMETHEUS, obs.LOKI)
        found += [_reference("networking.k8s.io/v1", "NetworkPolicy", name) for name in opened if wanted[name]]
    return [item for item in found if item["metadata"]["name"]]


def observability_secrets(spec: Spec, admin: Mapping[str, str] | None = None) -> list[Object]:
    """Grafana's password, `{password, version}`, and Alertmanager's configuration."""
    full = complete_spec(spec)
    wanted = runs(full)
    found = []
    if wanted[obs.GRAFANA] and admin:
        secret = {"user": "admin", "password": admin["password"], "version": admin["version"]}
        meta = made.metadata(obs.ADMIN_SECRET, obs.GRAFANA, full)
        data = {key: base64.b64encode(str(value).encode()).decode() for key, value in secret.items()}
        found.append({"apiVersion": "v1", "kind": "Secret", "metadata": meta, "data": data})
    if wanted[obs.ALERTMANAGER]:
        found.append(alertmanager_secret(full))
    return found


def grafana_admin(secrets: Any, given: str, fresh: str) -> dict[str, str]:
    """The password that holds: the given one, else the one that the cluster has, else a fresh one.

    `secrets` is what the cluster has under the Secret's name, `fresh` is random text: its first eight characters become
    the version of a password that is new, the rest the password where none is given.
    """
    if len(fresh) < 24:
        raise SpecError("needs at least 24 random characters")
    there = (secrets[0].get("data") or {}) if secrets else {}
    known = {key: base64.b64decode(there.get(key, "")).decode() for key in ("password", "version")}
    if known["password"] and given in ("", known["password"]) and known["version"]:
        return known
    return {"password": given or known["password"] or fresh[8:], "version": fresh[:8]}


def _namespace(spec: Spec) -> Object:
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
