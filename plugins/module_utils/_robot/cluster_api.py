# SPDX-License-Identifier: GPL-3.0-or-later
"""The Kubernetes API from inside a pod, as far as the keeper's Role reaches; a robot's Lease in the keeper's hand."""

from __future__ import annotations

import contextlib
import http.client
import json
import ssl
import time
from pathlib import Path
from typing import Callable, Iterable, Iterator, Mapping
from urllib.parse import quote, urlencode

from .._common.documents import json_of
from .._common.errors import FleetError, KubeError
from .._step.objects import Object, annotations_of, lease_with, name_of
from .._step.record import Record, record_name, record_of
from .._step.words import BACK_TO, FLEET, KEEPER, KEPT, LEASE, LEASE_SECONDS, MANAGER, SOAKING, UPDATING

ACCOUNT = "/var/run/secrets/kubernetes.io/serviceaccount"
OURS = f"app.kubernetes.io/managed-by={MANAGER}"
SECONDS = 5.0
REFUSED = (403, 404)  # the API's answers where a namespace is no more, or the keeper's Role is not yet there
REFRESH = 10.0  # between looks for robots that were added: without it the pods of a new one are not Ready
GROUPS = {
    "ConfigMap": "api/v1",
    "Deployment": "apis/apps/v1",
    "Event": "api/v1",
    "Lease": "apis/coordination.k8s.io/v1",
    "Pod": "api/v1",
}
JSON, APPLY, MERGE = "application/json", "application/apply-patch+yaml", "application/merge-patch+json"
STRATEGIC = "application/strategic-merge-patch+json"
# A watch ends by itself, as one over a link that was cut is told of nothing for ever.
WATCH_SECONDS, SILENT_SECONDS = 15, 20.0


class ApiError(KubeError):
    """One request failed; `status` is 0 where there was no answer."""

    def __init__(self, message: str, status: int = 0) -> None:
        super().__init__(message)
        self.status = status


class Cluster:
    """What the keeper reads and writes; ApiError where that fails. Threads may share it."""

    def __init__(self, environ: Mapping[str, str], account: str, now: Callable[[], float] = time.monotonic) -> None:
        """The cluster that this pod runs in; KubeError where it was given no access."""
        self.host, self.account, self.now = environ.get("KUBERNETES_SERVICE_HOST", ""), Path(account), now
        if not self.host:
            raise KubeError("this is no pod of a cluster (no KUBERNETES_SERVICE_HOST)")
        missing = [name for name in ("token", "ca.crt", "namespace") if not (self.account / name).exists()]
        if missing:
            raise KubeError(f"no {missing[0]} is mounted at {account} (automountServiceAccountToken)")
        self.port = int(environ.get("KUBERNETES_SERVICE_PORT") or 443)
        self.home = (self.account / "namespace").read_text("utf-8").strip()
        self._robots: tuple[float, list[str]] | None = None
        self._left: list[http.client.HTTPSConnection] = []  # connections that nobody uses just now

    # ---- objects

    def namespaces(self) -> list[str]:
        """The own one, and for the keeper of a shared master those of its robots."""
        if self.home != FLEET:
            return [self.home]
        if self._robots is None or self.now() - self._robots[0] >= REFRESH:
            found = self._list(_path(FLEET, "ConfigMap"), f"{KEPT}=true")
            self._robots = (self.now(), sorted(name_of(item) for item in found))
        return [self.home, *self._robots[1]]

    def leases(self) -> dict[str, Object | None]:
        """Namespace -> its Lease, of all that are looked at; for many it is one request, too."""
        spaces = self.namespaces()
        if self.home != FLEET:
            return {name: self.lease(name) for name in spaces}
        # out of the server's memory, as a single one
        query = {"fieldSelector": f"metadata.name={LEASE}", "resourceVersion": "0"}
        found = self._send("GET", f"/{GROUPS['Lease']}/leases", query).get("items") or []
        there = {str(item["metadata"]["namespace"]): item for item in found}
        return {name: there.get(name) for name in spaces}

    def lease(self, namespace: str, newest: bool = False) -> Object | None:
        # out of the server's memory: an older one is refused when it is written
        return self._get(_path(namespace, "Lease", LEASE), {} if newest else {"resourceVersion": "0"})

    def write_lease(self, namespace: str, lease: Object) -> Object | None:
        """The Lease as it is now; None if somebody else was faster."""
        method, name = ("PUT", LEASE) if "resourceVersion" in lease["metadata"] else ("POST", "")
        try:
            return self._send(method, _path(namespace, "Lease", name), {}, lease)
        except ApiError as error:
            if error.status == 409:
                return None
            raise

    def deployments(self, namespace: str) -> list[Object]:
        return self._list(_path(namespace, "Deployment"), OURS)

    def deployment(self, namespace: str, name: str) -> Object | None:
        return self._get(_path(namespace, "Deployment", name), {})

    def pods(self, namespace: str) -> list[Object]:
        return self._list(_path(namespace, "Pod"), OURS)

    def pods_since(self, namespace: str) -> tuple[list[Object], str]:
        """The same, and from which version on a watch goes on from there."""
        found = self._send("GET", _path(namespace, "Pod"), {"labelSelector": OURS})
        return list(found.get("items") or []), str(found["metadata"]["resourceVersion"])

    def watch_pods(self, namespace: str, version: str) -> Iterator[Object]:
        """What happens to them from that version on, for some seconds: `{type, object}` as the API sends it."""
        query = {"labelSelector": OURS, "watch": "1", "allowWatchBookmarks": "1", "resourceVersion": version}
        path = f"{_path(namespace, 'Pod')}?{urlencode({**query, 'timeoutSeconds': str(WATCH_SECONDS)})}"
        link = self._connection(SILENT_SECONDS)
        try:
            answer = self._asked(link, "GET", path)
            if answer.status >= 300:
                raise ApiError(f"the Kubernetes API answered {answer.status} to a watch of {namespace}", answer.status)
            for line in answer:
                yield json_of(line)
        except (OSError, http.client.HTTPException, ValueError) as error:
            raise self._unreachable(error) from error
        finally:
            link.close()

    def set_condition(self, namespace: str, pod: Object, condition: Object) -> None:
        """One of this very pod's."""
        body = {"metadata": {"uid": pod["metadata"]["uid"]}, "status": {"conditions": [condition]}}
        self._send("PATCH", f"{_path(namespace, 'Pod', name_of(pod))}/status", {}, body, STRATEGIC)

    def config_map(self, namespace: str, name: str) -> Object | None:
        return self._get(_path(namespace, "ConfigMap", name), {})

    def apply(self, namespace: str, item: Object) -> None:
        """Server-side apply of a Deployment or ConfigMap that is there, as a run would do it."""
        path = _path(namespace, item["kind"], name_of(item))
        self._send("PATCH", path, {"fieldManager": MANAGER, "force": "true"}, item, APPLY)

    def unmark(self, namespace: str, item: Object, key: str) -> None:
        """Take a mark off a Deployment; refused if somebody has written it since."""
        others = {UPDATING, SOAKING} & {*annotations_of(item)} - {key}  # which an undo may have brought back
        notes = dict.fromkeys((key,) if others else (key, BACK_TO))
        metadata = {"annotations": notes, "resourceVersion": item["metadata"].get("resourceVersion")}
        path = _path(namespace, "Deployment", name_of(item))
        self._send("PATCH", path, {"fieldManager": MANAGER}, {"metadata": metadata}, MERGE)

    def evict(self, namespace: str, pod: Object, seconds: int | None) -> None:
        """This very pod, with so many seconds to end; None: as many as it says itself."""
        name = name_of(pod)
        grace = {} if seconds is None else {"gracePeriodSeconds": seconds}
        body = {
            "apiVersion": "policy/v1",
            "kind": "Eviction",
            "metadata": {"name": name, "namespace": namespace},
            "deleteOptions": {**grace, "preconditions": {"uid": pod["metadata"]["uid"]}},
        }
        self._send("POST", f"{_path(namespace, 'Pod', name)}/eviction", {}, body)

    def tell(self, namespace: str, pod: Object, reason: str, message: str) -> None:
        """A warning among the pod's Events."""
        name, at = name_of(pod), self.stamp()
        about = {"apiVersion": "v1", "kind": "Pod", "name": name, "namespace": namespace}
        body = {
            "apiVersion": "v1",
            "kind": "Event",
            "metadata": {"name": f"{name}.{''.join(filter(str.isdigit, at))}", "namespace": namespace},
            "involvedObject": {**about, "uid": pod["metadata"]["uid"]},
            "type": "Warning",
            "reason": reason,
            "message": message,
            "firstTimestamp": at,
            "lastTimestamp": at,
            "count": 1,
            "source": {"component": KEEPER},
        }
        self._send("POST", _path(namespace, "Event"), {}, body)

    @staticmethod
    def stamp() -> str:
        return lease_time(time.time())

    # ---- requests

    def _get(self, path: str, query: Mapping[str, str]) -> Object | None:
        try:
            return self._send("GET", path, query)
        except ApiError as error:
            if error.status == 404:
                return None
            raise

    def _list(self, path: str, labels: str) -> list[Object]:
        return list(self._send("GET", path, {"labelSelector": labels}).get("items") or [])

    def _send(
        self, method: str, path: str, query: Mapping[str, str], body: Object | None = None, content: str = JSON
    ) -> Object:
        target = f"{path}?{urlencode(query)}" if query else path
        data = None if body is None else json.dumps(body).encode()
        status, said = self._exchange(method, target, data, content)
        try:
            found: Object = json_of(said)
            message = "" if status < 300 else str(found.get("message", ""))
        except (AttributeError, ValueError):
            raise ApiError(f"the Kubernetes API at {self.host} answered {status} and no JSON for {path}") from None
        if status >= 300:
            raise ApiError(f"the Kubernetes API answered {status} for {method} {path}: {message}", status)
        return found

    def _exchange(self, method: str, target: str, data: bytes | None, content: str) -> tuple[int, bytes]:
        """Over a connection that an earlier request has left, and that the server may have closed, else over a new one.

        Who waits for an answer holds up nobody. A connection is kept because a handshake is what costs: the robot's
        link to the API may be a radio.
        """
        link: http.client.HTTPSConnection | None = None
        with contextlib.suppress(IndexError):  # another thread may take the last one
            link = self._left.pop()
        kept = link is not None
        try:
            link = link or self._connection(SECONDS)
            answer = self._asked(link, method, target, data, content)
            found = answer.status, answer.read()
        except (OSError, http.client.HTTPException, ValueError) as error:
            if link is not None:
                link.close()
            if kept:
                return self._exchange(method, target, data, content)
            raise self._unreachable(error) from error
        self._left.append(link)
        return found

    def _asked(
        self,
        link: http.client.HTTPSConnection,
        method: str,
        target: str,
        data: bytes | None = None,
        content: str = JSON,
    ) -> http.client.HTTPResponse:
        token = (self.account / "token").read_text("utf-8").strip()  # anew each time: the kubelet renews it
        headers = {"User-Agent": MANAGER, "Authorization": f"Bearer {token}", "Content-Type": content}
        link.request(method, target, data, {"Accept": JSON, **headers})
        return link.getresponse()

    def _unreachable(self, error: Exception) -> ApiError:
        why = str(error) or type(error).__name__
        return ApiError(f"the Kubernetes API at {self.host} cannot be reached: {why}")

    def _connection(self, seconds: float) -> http.client.HTTPSConnection:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.load_verify_locations(str(self.account / "ca.crt"))
        return http.client.HTTPSConnection(self.host, self.port, timeout=seconds, context=context)


def _path(namespace: str, kind: str, name: str = "") -> str:
    return f"/{GROUPS[kind]}/namespaces/{namespace}/{kind.lower()}s" + (f"/{quote(name, '')}" if name else "")


def lease_time(seconds: float) -> str:
    """A time since 1970 as a Lease has it."""
    whole = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(seconds))
    return f"{whole}.{int(seconds % 1 * 1e6):06d}Z"


class LostError(FleetError):
    """Somebody else has the Lease."""


class Claim:
    """The Lease while the keeper changes something: the API refuses a write if somebody else made one since."""

    def __init__(self, cluster: Cluster, namespace: str, found: Object | None) -> None:
        self.cluster, self.namespace = cluster, namespace
        self.found: Object = found or {"metadata": {"name": LEASE, "namespace": namespace}}

    def renew(self) -> None:
        """Before whatever is done next; LostError where it is another one's now."""
        if not self.write(KEEPER):
            raise LostError("somebody else changes it now")

    def write(self, holder: str = "") -> bool:
        """With this holder, or nobody, to let it go; False: it was another one's, and stays so."""
        body = lease_with(holder, self.found, KEEPER, LEASE_SECONDS, self.cluster.stamp())
        written = self.cluster.write_lease(self.namespace, body)
        self.found = written or self.found
        return written is not None


def read_records(cluster: Cluster, namespace: str, apps: Iterable[str]) -> dict[str, Record]:
    """Those of the apps, and of all others of their steps."""
    found: dict[str, Record] = {}
    todo = list(apps)
    while todo:
        app = todo.pop()
        found[app] = record_of(cluster.config_map(namespace, record_name(app)))
        todo += [other for other in found[app].apps if other not in found and other not in todo]
    return found
