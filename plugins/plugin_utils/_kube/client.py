# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Requests to the Kubernetes API: with `_watch.py`, the collection's only Kubernetes I/O.

Credentials come the way kubernetes.core takes them (same options, same K8S_AUTH_* variables), through the official
client's configuration. The requests themselves go through that client's connection pool and not through its API
classes: those build thousands of model classes that nobody here needs, their dynamic client asks for the API's
resources first, and their watch cannot be stopped while it waits. kubernetes.core's own client is not imported: its
module_utils are private to it, and it has no watch.
"""

from __future__ import annotations

import json
import os
import traceback
from dataclasses import dataclass
from typing import Any, Dict, Mapping
from urllib.parse import urlencode

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError

try:
    import urllib3
    from kubernetes import config as kube_config
    from kubernetes.client import Configuration
    from kubernetes.client.rest import RESTClientObject

    IMPORT_ERROR: str = ""
except ImportError:
    IMPORT_ERROR = traceback.format_exc()

Object = Dict[str, Any]

# Option -> names in K8S_AUTH_<NAME>, the first that is set counts. As in kubernetes.core.
AUTH_VARIABLES: dict[str, tuple[str, ...]] = {
    "kubeconfig": ("KUBECONFIG",),
    "context": ("CONTEXT",),
    "host": ("HOST",),
    "api_key": ("API_KEY",),
    "validate_certs": ("VALIDATE_CERTS", "VERIFY_SSL"),
    "ca_cert": ("CA_CERT", "SSL_CA_CERT"),
    "client_cert": ("CLIENT_CERT", "CERT_FILE"),
    "client_key": ("CLIENT_KEY", "KEY_FILE"),
    "proxy": ("PROXY",),
    "no_proxy": ("NO_PROXY",),
    "impersonate_user": ("IMPERSONATE_USER",),
    "impersonate_groups": ("IMPERSONATE_GROUPS",),
}
KUBE_ARGS: dict[str, dict[str, Any]] = {
    "kubeconfig": {"type": "raw", "no_log": True},
    "context": {"type": "str"},
    "host": {"type": "str"},
    "api_key": {"type": "str", "no_log": True},
    "validate_certs": {"type": "bool", "aliases": ["verify_ssl"]},
    "ca_cert": {"type": "path", "aliases": ["ssl_ca_cert"]},
    "client_cert": {"type": "path", "aliases": ["cert_file"]},
    "client_key": {"type": "path", "aliases": ["key_file"], "no_log": False},
    "proxy": {"type": "str"},
    "no_proxy": {"type": "str"},
    "impersonate_user": {"type": "str"},
    "impersonate_groups": {"type": "list", "elements": "str"},
}

# Kind -> where its list is: API path, plural name, whether it lives in a namespace.
RESOURCES: dict[str, tuple[str, str, bool]] = {
    "ConfigMap": ("/api/v1", "configmaps", True),
    "ControllerRevision": ("/apis/apps/v1", "controllerrevisions", True),
    "DaemonSet": ("/apis/apps/v1", "daemonsets", True),
    "Deployment": ("/apis/apps/v1", "deployments", True),
    "Event": ("/api/v1", "events", True),
    "Job": ("/apis/batch/v1", "jobs", True),
    "Namespace": ("/api/v1", "namespaces", False),
    "Node": ("/api/v1", "nodes", False),
    "PersistentVolume": ("/api/v1", "persistentvolumes", False),
    "PersistentVolumeClaim": ("/api/v1", "persistentvolumeclaims", True),
    "Pod": ("/api/v1", "pods", True),
    "ReplicaSet": ("/apis/apps/v1", "replicasets", True),
    "Service": ("/api/v1", "services", True),
    "StatefulSet": ("/apis/apps/v1", "statefulsets", True),
    "StorageClass": ("/apis/storage.k8s.io/v1", "storageclasses", False),
}

CONNECT_SECONDS = 5.0
READ_SECONDS = 30.0


class ApiError(KubeError):
    """One request failed. `transient` says that the same request may succeed a moment later."""

    def __init__(self, message: str, status: int = 0, transient: bool = False) -> None:
        super().__init__(message)
        self.status = status
        self.transient = transient


# --- credentials ----------------------------------------------------------------------------------------------------


def resolve_auth(params: Mapping[str, Any], environ: Mapping[str, str]) -> Object:
    """Options, and for those not given (or empty) the K8S_AUTH_* variables. Pure."""
    auth: Object = {}
    for option, names in AUTH_VARIABLES.items():
        value = params.get(option)
        if value in (None, "", {}, []):
            value = next((environ[f"K8S_AUTH_{name}"] for name in names if environ.get(f"K8S_AUTH_{name}")), None)
            if value is not None and option == "validate_certs":
                value = value.lower() not in ("0", "false", "no")
            elif value is not None and option == "impersonate_groups":
                value = [group for group in value.split(",") if group]
        if value is not None:
            auth[option] = value
    return auth


def _load(auth: Mapping[str, Any], configuration: Any) -> str:
    """Fill the configuration; return in words where the credentials come from."""
    has_host = bool(auth.get("host"))
    if has_host and (auth.get("api_key") or (auth.get("client_cert") and auth.get("client_key"))):
        return "the given host and credentials"
    kubeconfig, context = auth.get("kubeconfig"), auth.get("context")
    if not kubeconfig and not context:
        try:
            kube_config.load_incluster_config(client_configuration=configuration)
            return "the pod's service account"
        except kube_config.ConfigException:
            pass  # not in a pod: then the default kubeconfig, as kubernetes.core does
    if isinstance(kubeconfig, Mapping):
        kube_config.load_kube_config_from_dict(
            dict(kubeconfig), context=context, client_configuration=configuration, persist_config=False
        )
        return "the given kubeconfig"
    kube_config.load_kube_config(
        config_file=kubeconfig, context=context, client_configuration=configuration, persist_config=False
    )
    return f"kubeconfig {kubeconfig or os.environ.get('KUBECONFIG', '~/.kube/config')}"


def _configuration(auth: Mapping[str, Any]) -> tuple[Any, str]:
    configuration = Configuration()
    try:
        source = _load(auth, configuration)
    except Exception as exc:  # the client's loader lets through what YAML, files and plugins raise
        where = auth.get("kubeconfig") if isinstance(auth.get("kubeconfig"), str) else "kubeconfig"
        why = " ".join(str(exc).split())
        raise KubeError(
            f"No usable Kubernetes credentials in {where}: {why}. Set kubeconfig (or K8S_AUTH_KUBECONFIG) to the "
            "cluster's kubeconfig, or host and api_key (K8S_AUTH_HOST, K8S_AUTH_API_KEY)."
        ) from exc
    if auth.get("host"):
        configuration.host = str(auth["host"]).rstrip("/")
    if auth.get("api_key"):
        configuration.api_key = {"authorization": f"Bearer {auth['api_key']}"}
    attributes = {
        "validate_certs": "verify_ssl",
        "ca_cert": "ssl_ca_cert",
        "client_cert": "cert_file",
        "client_key": "key_file",
        "proxy": "proxy",
        "no_proxy": "no_proxy",
    }
    for option, attribute in attributes.items():
        if auth.get(option) is not None:
            setattr(configuration, attribute, auth[option])
    return configuration, source


def broken_off(exc: BaseException) -> bool:
    """Whether this is what a broken connection raises while an answer is read."""
    return isinstance(exc, (urllib3.exceptions.HTTPError, OSError))


# --- requests -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Target:
    """What one stream follows: a kind, in one namespace or ("") everywhere."""

    kind: str
    namespace: str = ""

    def __str__(self) -> str:
        plural = RESOURCES[self.kind][1]
        return f"{plural} in namespace {self.namespace}" if self.namespace else plural

    @property
    def path(self) -> str:
        base, plural, namespaced = RESOURCES[self.kind]
        return f"{base}/namespaces/{self.namespace}/{plural}" if namespaced and self.namespace else f"{base}/{plural}"


def _cause(exc: BaseException) -> str:
    """The innermost cause in one line, without urllib3's object names."""
    text = str(exc)
    for known in ("Connection refused", "No route to host", "Name or service not known", "Network is unreachable"):
        if known in text:
            return known.lower()
    if any(known in text for known in ("EOF occurred", "Connection reset", "RemoteDisconnected", "Connection aborted")):
        return "it closed the connection"
    if "timed out" in text.lower():
        return "no answer in time"
    if "CERTIFICATE_VERIFY_FAILED" in text:
        return f"its certificate is not trusted ({text.rpartition('CERTIFICATE_VERIFY_FAILED] ')[2].rstrip(')')})"
    return text.rpartition(": ")[2] or type(exc).__name__


def _status_message(body: bytes) -> str:
    """The message of a Kubernetes Status object, or the start of whatever answered instead."""
    try:
        return str(json.loads(body).get("message") or "")
    except (ValueError, AttributeError):
        return body[:200].decode("utf-8", "replace").strip()


class Kube:
    """One cluster's API. Thread-safe; `close` it, or use it as a context."""

    def __init__(self, auth: Mapping[str, Any]) -> None:
        if IMPORT_ERROR:
            raise KubeError(
                "The Python library kubernetes is missing where this runs (the control node): install it there.",
                exception=IMPORT_ERROR,
            )
        self._configuration, self._source = _configuration(auth)
        self._pool = RESTClientObject(self._configuration).pool_manager
        self._impersonate = [("Impersonate-User", auth["impersonate_user"])] if auth.get("impersonate_user") else []
        self._impersonate += [("Impersonate-Group", group) for group in auth.get("impersonate_groups") or []]

    @property
    def host(self) -> str:
        return str(self._configuration.host)

    def __enter__(self) -> Kube:
        return self

    def __exit__(self, *unused: object) -> None:
        self.close()

    def close(self) -> None:
        self._pool.clear()
        # Inline keys of a kubeconfig lie in temporary files that the client removes at the interpreter's exit.
        # Ansible's worker processes end without that, so the files go now.
        clean = getattr(kube_config.kube_config, "_cleanup_temp_files", None)
        if clean:
            clean()

    def _headers(self) -> Any:
        headers = urllib3.HTTPHeaderDict({"Accept": "application/json", "User-Agent": "rosops.fleet"})
        for setting in self._configuration.auth_settings().values():
            headers[setting["key"]] = setting["value"]
        for name, value in self._impersonate:
            headers.add(name, value)
        return headers

    def request(self, path: str, query: Mapping[str, Any], read_seconds: float = READ_SECONDS) -> Any:
        """Open a GET; the answer's body is still to be read. Anything but 200 is an ApiError."""
        url = f"{self.host}{path}" + (f"?{urlencode(query)}" if query else "")
        timeout = urllib3.Timeout(connect=CONNECT_SECONDS, read=read_seconds)
        try:
            answer = self._pool.request(
                "GET", url, headers=self._headers(), preload_content=False, retries=False, timeout=timeout
            )
        except (urllib3.exceptions.HTTPError, OSError) as exc:
            raise self._unreachable(exc) from exc
        if answer.status != 200:
            raise self._refused(answer, path)
        return answer

    def _unreachable(self, exc: BaseException) -> ApiError:
        untrusted = "CERTIFICATE_VERIFY_FAILED" in str(exc)
        todo = (
            "Check ca_cert, or that the kubeconfig belongs to this cluster"
            if untrusted
            else f"Check that its server runs, that it can be reached from here, and the address (from {self._source})"
        )
        return ApiError(
            f"The Kubernetes API at {self.host} cannot be reached: {_cause(exc)}. {todo}.", transient=not untrusted
        )

    def _refused(self, answer: Any, path: str) -> ApiError:
        status = int(answer.status)
        try:
            message = _status_message(answer.data)
        except (urllib3.exceptions.HTTPError, OSError):
            message = ""
        todo = {
            401: f"It refuses the credentials from {self._source}: fetch the kubeconfig again or renew the token",
            403: "These credentials lack that permission",
            404: "Is that address a Kubernetes API?",
        }.get(status, "")
        text = f"The Kubernetes API at {self.host} answered {status} for {path}"
        return ApiError(
            ". ".join(part.rstrip(".") for part in (f"{text}: {message}" if message else text, todo) if part) + ".",
            status=status,
            transient=status == 429 or status >= 500,
        )

    def read(self, path: str, query: Mapping[str, Any] | None = None) -> bytes:
        """A whole answer."""
        try:
            return bytes(self.request(path, query or {}).data)
        except (urllib3.exceptions.HTTPError, OSError) as exc:  # the connection broke within the body
            raise self._unreachable(exc) from exc

    def page(self, target: Target, **query: str) -> tuple[list[Object], str]:
        """The present objects, and the resource version to watch on from."""
        try:
            body = json.loads(self.read(target.path, query))
            items, version = body.get("items") or [], str(body["metadata"]["resourceVersion"])
        except (ValueError, KeyError, AttributeError, TypeError) as exc:
            raise ApiError(f"{self.host} does not answer like a Kubernetes API for {target.path}: {exc!r}.") from exc
        return list(items), version

    def objects(self, kind: str, namespace: str = "", labels: str = "", fields: str = "") -> list[Object]:
        """All objects of a kind, in one namespace or everywhere."""
        selectors = {"labelSelector": labels, "fieldSelector": fields}
        return self.page(Target(kind, namespace), **{key: value for key, value in selectors.items() if value})[0]

    def nodes(self) -> list[Object]:
        return self.objects("Node")

    def log_tail(self, namespace: str, pod: str, container: str, lines: int = 5, previous: bool = True) -> str:
        """The last lines of a container's log."""
        query = {"container": container, "tailLines": lines, "previous": str(previous).lower()}
        return self.read(f"/api/v1/namespaces/{namespace}/pods/{pod}/log", query).decode("utf-8", "replace").strip()
