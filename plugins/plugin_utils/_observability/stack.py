# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The observability stack of one cluster: spec and files -> objects. Pure and deterministic.

`files` is {rules: {name: text}, loki_rules: {..}, dashboards: {folder: {name: text}}}.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import replace

from ...module_utils._common.errors import SpecError
from ...module_utils._step.objects import Object
from .._objects.common import owner_labels
from . import names as obs
from . import workload
from .files import Files
from .parts import RULES, part_objects, stack_pods
from .spec import Spec, runs
from .templates import yaml_text

# Who is asked for what comes before who asks.
ORDER = (
    obs.PROMETHEUS, obs.LOKI, obs.ALERTMANAGER, obs.VMAGENT, obs.NODE_EXPORTER, obs.SHIPPER, obs.GRAFANA,
)  # fmt: skip
ADMIN_SECRET = {
    "apiVersion": "v1",
    "kind": "Secret",
    "metadata": {"name": obs.ADMIN_SECRET, "namespace": obs.NAMESPACE},
}


def stack_objects(spec: Spec, files: Files, admin_version: str = "") -> list[Object]:
    """All objects but the Secrets: what is in them may be shown. Grafana is restarted for another `admin_version`."""
    wanted = runs(spec)
    if not spec["grafana"]["default_dashboards"]:
        files = replace(files, dashboards={name: one for name, one in files.dashboards.items() if name != "Fleet"})
    pods = stack_pods(spec, files, admin_version)
    found = [_namespace(spec)]
    for name in ORDER:
        found += part_objects(name, spec, files, pods) if wanted[name] else []
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
        if name in RULES:
            found.append(_reference("v1", "ConfigMap", RULES[name]))
    for name in (obs.PROMETHEUS, obs.VMAGENT):
        if not wanted[name]:
            found += [_bare(one) for one in reversed(workload.discovery_access(name, spec))]
    if not spec["allowed_networks"]:
        opened = (obs.GRAFANA, obs.PROMETHEUS, obs.LOKI)
        found += [_reference("networking.k8s.io/v1", "NetworkPolicy", name) for name in opened if wanted[name]]
    return found


def stack_secrets(spec: Spec, admin: Mapping[str, str]) -> list[Object]:
    """Grafana's password, `{password, version}`, and Alertmanager's configuration."""
    wanted = runs(spec)
    found = []
    if wanted[obs.GRAFANA] and admin["password"]:
        found.append(_secret(obs.ADMIN_SECRET, obs.GRAFANA, spec, {"user": "admin", **admin}))
    if wanted[obs.ALERTMANAGER]:
        config = {"alertmanager.yml": yaml_text(spec["alertmanager_config"])}
        found.append(_secret(obs.ALERTMANAGER, obs.ALERTMANAGER, spec, config))
    return found


def _secret(name: str, app: str, spec: Spec, texts: Mapping[str, str]) -> Object:
    data = {key: base64.b64encode(str(text).encode()).decode() for key, text in texts.items()}
    return {"apiVersion": "v1", "kind": "Secret", "metadata": workload.metadata(name, app, spec), "data": data}


def has_grafana(spec: Spec) -> bool:
    """Whether there is a Grafana, and with it a password."""
    return runs(spec)[obs.GRAFANA]


def grafana_admin(secret: Object | None, given: str, fresh: str) -> dict[str, str]:
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


def _namespace(spec: Spec) -> Object:
    # the hosts' files and network are what node exporter and log shipper are about
    labels = {**owner_labels(spec["robot"] or None), "pod-security.kubernetes.io/enforce": "privileged"}
    return {"apiVersion": "v1", "kind": "Namespace", "metadata": {"name": obs.NAMESPACE, "labels": labels}}


def _reference(api: str, kind: str, name: str) -> Object:
    return {"apiVersion": api, "kind": kind, "metadata": {"name": name, "namespace": obs.NAMESPACE}}


def _bare(item: Object) -> Object:
    metadata = {key: item["metadata"][key] for key in ("name", "namespace") if key in item["metadata"]}
    return {"apiVersion": item["apiVersion"], "kind": item["kind"], "metadata": metadata}
