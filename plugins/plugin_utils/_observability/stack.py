# SPDX-License-Identifier: GPL-3.0-or-later
"""The observability stack of one cluster: spec and files -> objects. Pure and deterministic."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from typing import Any

from ...module_utils._common.errors import SpecError
from ...module_utils._step.objects import Object
from .._model.merge import deep_merge
from .._objects import common
from .._objects.common import annotate, made, object_labels, owner_labels, pod_selector
from .._objects.network import blocks, ingress_policy, tcp
from .._objects.placement import node_selector
from .configs import FOLDERS, config, web_config, yaml_text
from .files import Files
from .spec import HUB, HUB_LOGS, HUB_METRICS, NAMESPACE, ON_EVERY_HOST, PORTS, TLS, Spec, runs, tls_secrets

PREFIXES = {"Fleet": "dashboard-", "Own": "own-dashboard-"}  # of the ConfigMaps of dashboards, by folder
ADMIN_SECRET = made("v1", "Secret", "grafana-admin", NAMESPACE)
ANNOTATION_CONFIG = "rosops.fleet/config-hash"
RBAC = "rbac.authorization.k8s.io"
# To see what there is to scrape, and read the metrics of nodes and API servers: nothing else.
DISCOVERY = [
    {"apiGroups": [""], "resources": ["nodes", "pods", "services", "endpoints"], "verbs": ["get", "list", "watch"]},
    {"apiGroups": [""], "resources": ["nodes/metrics"], "verbs": ["get"]},
    {"nonResourceURLs": ["/metrics"], "verbs": ["get"]},
]
TLS_KEYS = ("tls.crt", "tls.key", "ca.crt")  # of a Secret as cert-manager writes it
# What a part reads of its Secret at its start alone. Everything else it reads again. Loki has a new certificate for who
# asks it by a name, but not for who asks by an address.
READ_ONCE = {
    "loki": ("tls.crt", "ca.crt"), "grafana": ("tls.crt", "ca.crt"), "log-shipper": ("ca.crt",), "vmagent": ("ca.crt",),
}  # fmt: skip
# A process that needs nothing of its host but what is mounted into it.
UNPRIVILEGED = {"allowPrivilegeEscalation": False, "readOnlyRootFilesystem": True, "capabilities": {"drop": ["ALL"]}}

Maps = Mapping[str, Mapping[str, str]]  # ConfigMaps by name: text by file


def stack_objects(spec: Spec, files: Files, admin_version: str = "") -> list[Object]:
    """All objects but the Secrets: what is in them may be shown. Grafana is restarted for another `admin_version`."""
    # the hosts' files and network are what node exporter and log shipper are about
    labels = {**owner_labels(spec["robot"] or None), "pod-security.kubernetes.io/enforce": "privileged"}
    parts, wanted = _parts(spec, files, admin_version), runs(spec)
    of_parts = (one for name, objects in parts.items() if wanted[name] for one in objects)
    return [made("v1", "Namespace", NAMESPACE, labels=labels), *of_parts]


def leftovers(spec: Spec, objects: Iterable[Object]) -> list[Object]:
    """What another spec may have made, and is not among the `objects` of this one: to be deleted.

    Never a claim: data is its owner's to delete. A dashboard that nobody shows stays, too.
    """
    open_grafana = {**spec["grafana"], "service_type": "NodePort"}
    most = {**spec, "profile": HUB, "allowed_networks": ["0.0.0.0/0"], "grafana": open_grafana}
    there = {_key(one) for one in objects}
    every = [one for part in _parts(most, Files(), "").values() for one in part]
    return [one for one in reversed(every) if one["kind"] != "PersistentVolumeClaim" and _key(one) not in there]


def _key(item: Object) -> tuple[str, str]:
    return item["kind"], item["metadata"]["name"]


def stack_secrets(spec: Spec, admin: Mapping[str, str]) -> list[Object]:
    """Grafana's password, `{password, version}`, and Alertmanager's configuration."""
    wanted = runs(spec)
    found = []
    if wanted["grafana"] and admin["password"]:
        found.append(_secret(ADMIN_SECRET["metadata"]["name"], "grafana", spec, {"user": "admin", **admin}))
    if wanted["alertmanager"]:
        texts = {"alertmanager.yml": yaml_text(spec["alertmanager_config"]), **web_config(spec)}
        found.append(_secret("alertmanager", "alertmanager", spec, texts))
    return found


def _secret(name: str, app: str, spec: Spec, texts: Mapping[str, str]) -> Object:
    data = {key: base64.b64encode(str(text).encode()).decode() for key, text in texts.items()}
    return made("v1", "Secret", name, NAMESPACE, object_labels(app, spec["robot"] or None), data=data)


def tls_versions(spec: Spec, secrets: Mapping[str, Object | None]) -> dict[str, str]:
    """Part -> what it is restarted for, of the Secret with its certificate. SpecError where that is not whole.

    `secrets` are those of the cluster by name. Nothing of a key is in what becomes of them.
    """
    found = {}
    for part, name in tls_secrets(spec).items():
        data = (secrets[name] or {}).get("data") or {}
        if missing := [key for key in TLS_KEYS if not data.get(key)]:
            told = f"the Secret {name} in the namespace {NAMESPACE} has no {', '.join(missing)}"
            raise SpecError(f"{told}; docs/observability.md, Certificates, has how it is made")
        if part in READ_ONCE:
            found[part] = common.canonical_hash([data[key] for key in READ_ONCE[part]])
    return found


def grafana_admin(secret: Object | None, given: str, fresh: str) -> dict[str, str]:
    """The password that holds: the given one, else the one that the cluster has, else a fresh one.

    `secret` is what the cluster has, `fresh` is random text: its first eight characters become
    the version of a password that is new, the rest the password where none is given.
    """
    there = (secret or {}).get("data") or {}
    known = {key: base64.b64decode(there.get(key, "")).decode() for key in ("password", "version")}
    if known["password"] and given in ("", known["password"]) and known["version"]:
        return known
    return {"password": given or known["password"] or fresh[8:], "version": fresh[:8]}


# --- parts


def _parts(spec: Spec, files: Files, admin_version: str) -> dict[str, list[Object]]:
    """The objects of every part, whether it runs or not."""
    boards = {folder: _boards(folder, files.dashboards.get(folder, {})) for folder in FOLDERS}
    pods = config("pods", spec, dashboards=boards, admin_version=admin_version)
    every = {name: data for found in boards.values() for name, data in found.items()}
    configured = _maps(spec, files.rules, every)
    return {name: list(_objects(name, spec, pods[name], configured.get(name, {}))) for name in runs(spec)}


def _boards(folder: str, texts: Mapping[str, str]) -> Maps:
    """Each dashboard is a ConfigMap of its own, which Grafana reads again by itself."""
    return {PREFIXES[folder] + file.removesuffix(".json"): {file: text} for file, text in sorted(texts.items())}


def _maps(spec: Spec, rules: Mapping[str, str], boards: Maps) -> dict[str, Maps]:
    """The ConfigMaps of each part."""
    scraped = {"prometheus.yml": yaml_text(config("scrape", spec))}
    return {
        "prometheus": {"prometheus": {**scraped, **web_config(spec)}, "prometheus-rules": rules},
        "vmagent": {"vmagent": scraped},
        "loki": {"loki": {"loki.yml": yaml_text(config("loki", spec))}, "loki-rules": {}},
        "log-shipper": {"log-shipper": {"otelcol.yml": yaml_text(config("otelcol", spec))}},
        "grafana": {"grafana": {name: yaml_text(one) for name, one in config("grafana", spec).items()}, **boards},
    }


def _claims(spec: Spec) -> dict[str, str]:
    """Part -> the size of its claim. The data of another one goes with the pod."""
    kept = {name: spec[name]["persistence"] for name in ("loki", "grafana")}
    sizes = {name: one["size"] for name, one in kept.items() if one["enabled"]}
    return {"prometheus": spec["prometheus_size"], "vmagent": spec["store_size"], **sizes}


def _open_ports(spec: Spec) -> dict[str, int]:
    """Part -> the port of each host, at which it is open to the outside."""
    of_hub = {"prometheus": spec[HUB_METRICS], "loki": spec[HUB_LOGS]} if spec["profile"] == HUB else {}
    return of_hub | ({"grafana": spec["grafana_node_port"]} if spec["grafana"]["service_type"] == "NodePort" else {})


def _objects(name: str, spec: Spec, given: Object, maps: Maps) -> Iterator[Object]:
    """What is applied of a part, on a robot's own cluster as the robot's; `given` is its pod as the template has it."""
    labels, pod = object_labels(name, spec["robot"] or None), _pod(name, given, tls_secrets(spec).get(name, ""))
    make = partial(made, namespace=NAMESPACE, labels=labels)
    if "serviceAccountName" in pod:
        account = f"rosops-fleet-{name}"
        subject = {"kind": "ServiceAccount", "name": name, "namespace": NAMESPACE}
        role = {"apiGroup": RBAC, "kind": "ClusterRole", "name": account}
        yield make("v1", "ServiceAccount", name)
        yield made(f"{RBAC}/v1", "ClusterRole", account, labels=labels, rules=DISCOVERY)
        yield made(f"{RBAC}/v1", "ClusterRoleBinding", account, labels=labels, roleRef=role, subjects=[subject])
    for found, data in maps.items():
        yield make("v1", "ConfigMap", found, data=dict(data))
    if size := _claims(spec).get(name):
        body: Object = {"accessModes": ["ReadWriteOnce"], "resources": {"requests": {"storage": str(size)}}}
        body |= {"storageClassName": spec["storage_class"]} if spec["storage_class"] else {}
        yield make("v1", "PersistentVolumeClaim", name, spec=body)
    configured, tls_version = _config(name, spec, pod, maps), spec["tls_versions"].get(name)
    yield _workload(name, spec, pod, [configured, tls_version] if tls_version else configured)
    if name not in ON_EVERY_HOST:
        port, open_port = PORTS[name], _open_ports(spec).get(name)
        opened, at_host = {}, {}
        if open_port is not None:  # under the callers' own addresses, which the list of allowed networks is about
            opened, at_host = {"type": "NodePort", "externalTrafficPolicy": "Local"}, {"nodePort": open_port}
        ports = [{"name": "http", "port": port, "targetPort": port, "protocol": "TCP", **at_host}]
        body = {"type": "ClusterIP", "selector": pod_selector(name), "ports": ports, **opened}
        yield make("v1", "Service", name, spec=body)
        # Grafana alone asks for a password; what the others have, and take, is for parts of the stack
        pods: Object = {"namespaceSelector": {}} if name == "grafana" else {"podSelector": {}}
        outside = blocks(spec["allowed_networks"]) if open_port is not None else []
        if outside or name != "grafana":
            rule = {"from": [pods, *outside], "ports": [tcp(port)]}
            yield ingress_policy(name, NAMESPACE, labels, {"rosops.fleet/app": name}, [rule])


def _pod(name: str, given: Object, tls_secret: str) -> Object:
    """With what all of them have in common: no access to the API, no rights, one port, a probe of it. Who has a
    certificate has the files of that Secret."""
    port = PORTS[name]
    all_of_them = {"imagePullPolicy": "IfNotPresent", "securityContext": UNPRIVILEGED}
    main = {
        **all_of_them,
        "name": name,
        "ports": [{"name": "http", "containerPort": port, "protocol": "TCP"}],
        # No liveness probe: a restart while a log is replayed only makes it longer.
        "readinessProbe": {"httpGet": {"port": port}, "periodSeconds": 5, "timeoutSeconds": 5, "failureThreshold": 3},
    }
    pod = {"automountServiceAccountToken": False, "enableServiceLinks": False, **given}
    if tls_secret:
        main["volumeMounts"] = [{"name": "tls", "mountPath": TLS, "readOnly": True}]
        volume = {"name": "tls", "secret": {"secretName": tls_secret, "defaultMode": 0o440}}
        pod["volumes"] = [*given["volumes"], volume]
    for key, base in (("containers", main), ("initContainers", all_of_them)):
        if key in given:
            pod[key] = [deep_merge(base, one) for one in given[key]]
    return pod


def _config(name: str, spec: Spec, pod: Object, maps: Maps) -> Any:
    """What the pod is restarted for when it changes."""
    match name:
        case "alertmanager":  # it may hold passwords, so it is a Secret
            return spec["alertmanager_config"]
        case "node-exporter":  # its arguments are all that it is configured with
            return pod["containers"][0]["args"]
        case "grafana":
            return maps["grafana"]
    text, *_read_again = maps[name].values()
    rules = maps.get(f"{name}-rules")
    return text if rules is None else [text, dict(rules)]


def _workload(name: str, spec: Spec, pod: Object, configured: Any) -> Object:
    """The Deployment or DaemonSet of a part."""
    kind = "Deployment"
    strategy: Object = common.RECREATE_STRATEGY  # two on one claim would ruin what the other writes
    if name in ON_EVERY_HOST:
        pod["tolerations"] = [{"operator": "Exists"}]
        # A host that is off counts as unavailable: with fewer, it would keep the others at the old revision.
        kind, strategy = "DaemonSet", {"type": "RollingUpdate", "rollingUpdate": {"maxUnavailable": "100%"}}
    else:
        pod["nodeSelector"] = node_selector("local" if spec["robot"] else "remote", spec["robot"])
    notes = {ANNOTATION_CONFIG: common.canonical_hash(configured)}
    item = common.workload(name, NAMESPACE, spec["robot"] or None, pod, notes, strategy, kind)
    return annotate(deep_merge(item, spec["overrides"].get(name) or {}))
