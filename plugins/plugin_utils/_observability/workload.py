# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What all parts of the stack are made of: Deployments, DaemonSets, Services, ConfigMaps, claims. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...module_utils._step.objects import Object
from .._model.merge import deep_merge
from .._objects import common
from .._objects.common import annotate, canonical_hash, node_selector, object_labels, pod_selector
from . import names as obs
from .spec import Spec

# A process that needs nothing of its host but what is mounted into it.
UNPRIVILEGED = {
    "allowPrivilegeEscalation": False,
    "readOnlyRootFilesystem": True,
    "capabilities": {"drop": ["ALL"]},
}


def metadata(name: str, app: str, spec: Spec) -> Object:
    """Name, namespace and labels; on a robot's own cluster all of it is the robot's."""
    return {"name": name, "namespace": obs.NAMESPACE, "labels": object_labels(app, spec["robot"] or None)}


def workload(name: str, spec: Spec, pod: Object, config: Any) -> Object:
    """The Deployment or DaemonSet of a part; `config` is all that the pod has to be restarted for when it changes."""
    strategy: Object
    if obs.WORKLOADS[name] == "Deployment":
        pod["nodeSelector"] = node_selector("local" if spec["robot"] else "remote", spec["robot"])
        strategy = common.RECREATE_STRATEGY  # two of them on one claim would ruin what the other writes
    else:
        pod["tolerations"] = [{"operator": "Exists"}]
        # A host that is off counts as unavailable: with fewer, it would keep the others at the old revision.
        strategy = {"type": "RollingUpdate", "rollingUpdate": {"maxUnavailable": "100%"}}
    item = common.workload(
        name,
        obs.NAMESPACE,
        spec["robot"] or None,
        pod,
        kind=obs.WORKLOADS[name],
        strategy=strategy,
        annotations={obs.ANNOTATION_CONFIG: canonical_hash(config)},
    )
    return annotate(deep_merge(item, spec["overrides"].get(name) or {}))


def service(name: str, spec: Spec, node_port: int | None = None) -> Object:
    """The Service of a part; with `node_port` reachable from outside, under the callers' own addresses."""
    meta = metadata(name, name, spec)
    port: Object = {"name": obs.HTTP, "port": obs.PORTS[name], "targetPort": obs.PORTS[name], "protocol": "TCP"}
    body: Object = {"type": "ClusterIP", "selector": pod_selector(name), "ports": [port]}
    if node_port is not None:
        # Local keeps the caller's address, which the list of allowed networks is about
        body |= {"type": "NodePort", "externalTrafficPolicy": "Local"}
        port["nodePort"] = node_port
    return {"apiVersion": "v1", "kind": "Service", "metadata": meta, "spec": body}


def allow_list(name: str, spec: Spec) -> list[Object]:
    """Who may reach a part that is open to the outside: pods of the cluster, and the networks that are allowed."""
    if not spec["allowed_networks"]:
        return []
    meta = metadata(name, name, spec)
    sources: list[Object] = [{"ipBlock": {"cidr": network}} for network in spec["allowed_networks"]]
    rule = {
        "from": [{"namespaceSelector": {}}, *sources],
        "ports": [{"port": obs.PORTS[name], "protocol": "TCP"}],
    }
    selector = {"matchLabels": {"rosops.fleet/app": name}}
    body = {"podSelector": selector, "policyTypes": ["Ingress"], "ingress": [rule]}
    return [{"apiVersion": "networking.k8s.io/v1", "kind": "NetworkPolicy", "metadata": meta, "spec": body}]


def config_map(name: str, app: str, spec: Spec, data: Mapping[str, str]) -> Object:
    """A ConfigMap of text files."""
    return {"apiVersion": "v1", "kind": "ConfigMap", "metadata": metadata(name, app, spec), "data": dict(data)}


def claim(name: str, spec: Spec, size: str) -> Object:
    """The claim of a part's data."""
    body: Object = {"accessModes": ["ReadWriteOnce"], "resources": {"requests": {"storage": str(size)}}}
    if spec["storage_class"]:
        body["storageClassName"] = spec["storage_class"]
    return {"apiVersion": "v1", "kind": "PersistentVolumeClaim", "metadata": metadata(name, name, spec), "spec": body}


def data_volume(name: str, persistent: bool) -> Object:
    """The pod's volume `data`: its claim, or a directory that goes with the pod."""
    source: Object = {"persistentVolumeClaim": {"claimName": name}} if persistent else {"emptyDir": {}}
    return {"name": "data", **source}


def memory(limit: str) -> list[Object]:
    """Go's soft limit of memory and one thread: the collector of garbage works harder before more is taken."""
    return [{"name": "GOMEMLIMIT", "value": limit}, {"name": "GOMAXPROCS", "value": "1"}]


def discovery_access(name: str, spec: Spec) -> list[Object]:
    """An account that may see what there is to scrape, and read the metrics of nodes and API servers: nothing else."""
    meta = metadata(name, name, spec)
    wide = {"name": f"rosops-fleet-{name}", "labels": meta["labels"]}
    rules = [
        {"apiGroups": [""], "resources": ["nodes", "pods", "services", "endpoints"], "verbs": ["get", "list", "watch"]},
        {"apiGroups": [""], "resources": ["nodes/metrics"], "verbs": ["get"]},
        {"nonResourceURLs": ["/metrics"], "verbs": ["get"]},
    ]
    api = "rbac.authorization.k8s.io"
    return [
        {"apiVersion": "v1", "kind": "ServiceAccount", "metadata": meta},
        {"apiVersion": f"{api}/v1", "kind": "ClusterRole", "metadata": wide, "rules": rules},
        {
            "apiVersion": f"{api}/v1",
            "kind": "ClusterRoleBinding",
            "metadata": dict(wide),
            "roleRef": {"apiGroup": api, "kind": "ClusterRole", "name": wide["name"]},
            "subjects": [{"kind": "ServiceAccount", "name": name, "namespace": obs.NAMESPACE}],
        },
    ]
