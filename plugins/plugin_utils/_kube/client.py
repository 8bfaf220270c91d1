# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Requests to the Kubernetes API: with `watch.py`, the collection's only Kubernetes I/O.

The requests go through the connection pool of the official client and not through its API classes: those build model
classes that nobody here needs, their dynamic client asks for the API's resources first, and their watch cannot be
stopped while it waits.

The client's libraries take 0.2 s of CPU time to import. They are imported at module level on purpose: Ansible's
strategies load an action plugin in the main process and fork a worker per host and task, which has them then (seen: one
import in a run of 15 such tasks).
"""

from __future__ import annotations

import contextlib
import copy
import json
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, TypeVar
from urllib.parse import urlencode

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError
from ansible_collections.rosops.fleet.plugins.module_utils._host.k3s import without_secrets
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.access import Access, access_from, forget_key_files
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.applied import HIDDEN, Applied, applied
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import Ref
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.managed_fields import (
    foreign_fields,
    taken_over,
    without_fields,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.pods import Object
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.resources import (
    RESOURCES,
    Resource,
    Target,
    base_of,
    known,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.secrets import secrets_in, without

with contextlib.suppress(ImportError):  # it comes with the library kubernetes, without which access_from refuses
    import urllib3

Answer = TypeVar("Answer")

CONNECT_SECONDS = 5.0
READ_SECONDS = 30.0
PATIENCE = 60.0  # a server that is just restarting is back by then, also on a small computer
SAID_FROM, SAID_EVERY = 5.0, 20.0  # a wait that takes longer is said
FIRST_PAUSE, LONGEST_PAUSE = 0.2, 2.0
FENCED = ("Deployment",)  # what the keeper writes, too
RACES = 5  # somebody else may write an object between our look at it and our write
LISTED_FROM = 3  # so many objects of a kind in a namespace are looked up by one list, fewer one by one
# Who owns the fields that the collection applies. Server-side apply removes a field that its owner no longer sends:
# that is how a label taken out of the inventory leaves the node.
MANAGER = "rosops.fleet"
OURS_ALONE = ("DaemonSet", "Deployment", "Service")  # kinds whose whole spec is ours: nobody else sets a part

TODO = {
    401: "It refuses the credentials from {source}: fetch the kubeconfig again or renew the token",
    403: "These credentials lack that permission",
    404: "Is that address a Kubernetes API?",
    409: "Somebody else changed it at the same time: run again",
    422: "Kubernetes does not accept that value, or that field cannot be changed once the object is there",
}
JSON, APPLY, MERGE = "application/json", "application/apply-patch+yaml", "application/merge-patch+json"


class ApiError(KubeError):
    """One request failed. `transient` says that the same request may succeed a moment later, `misfit` that these
    credentials are not this API's."""

    def __init__(
        self, message: str, status: int = 0, transient: bool = False, misfit: bool = False, **details: Any
    ) -> None:
        super().__init__(message, **details)
        self.status = status
        self.transient = transient
        self.misfit = misfit or status == 401


def broken_off(exc: BaseException) -> bool:
    """Whether this is what a broken connection raises while an answer is read."""
    return isinstance(exc, (urllib3.exceptions.HTTPError, OSError))


def _cause(exc: BaseException) -> str:
    """The innermost cause in one line, without urllib3's object names."""
    text = str(exc)
    for known_cause in (
        "Connection refused",
        "No route to host",
        "Name or service not known",
        "Network is unreachable",
    ):
        if known_cause in text:
            return known_cause.lower()
    if any(part in text for part in ("EOF occurred", "Connection reset", "RemoteDisconnected", "Connection aborted")):
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
    """One cluster's API. Thread-safe; `close` it, or use it as a context.

    What may succeed a moment later (nothing listens, the connection broke, 429, 5xx) is tried again for `patience`
    seconds per request; `say` is told why, once it takes long. Only `request` and `page` are not: a watch does that by
    itself, and tells about it.
    """

    def __init__(
        self,
        auth: Mapping[str, Any] | Access,
        patience: float = PATIENCE,
        say: Callable[[str], None] = lambda _text: None,
        now: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """`auth`: kubernetes.core's options, of which those that are missing come from the K8S_AUTH_* variables."""
        self._access = auth if isinstance(auth, Access) else access_from(auth)
        self._pool = self._access.pool
        self._patience, self._say, self._now, self._sleep = patience, say, now, sleep
        self._permit: Callable[[], None] = lambda: None
        self._found: dict[tuple[str, str], Resource] = {}

    @property
    def host(self) -> str:
        return str(self._access.configuration.host)

    def __enter__(self) -> Kube:
        return self

    def __exit__(self, *unused: object) -> None:
        self.close()

    def within(self, patience: float) -> Kube:
        """The same connection for requests that are given up after that many seconds. Not to be closed by itself."""
        hurried = copy.copy(self)
        hurried._patience = patience
        return hurried

    def allowed_by(self, permit: Callable[[], None]) -> Kube:
        """The same connection; `permit` is called before every try of a write, and raises where it must not be made."""
        asking = copy.copy(self)
        asking._permit = permit
        return asking

    def close(self) -> None:
        self._pool.clear()
        forget_key_files()

    # --- requests ---------------------------------------------------------------------------------------------------

    def _headers(self, content: str) -> Any:
        headers = urllib3.HTTPHeaderDict({"Accept": JSON, "User-Agent": MANAGER})
        if content:
            headers["Content-Type"] = content
        for setting in self._access.configuration.auth_settings().values():
            headers[setting["key"]] = setting["value"]
        for name, value in self._access.headers:
            headers.add(name, value)
        return headers

    def request(self, path: str, query: Mapping[str, Any], read_seconds: float = READ_SECONDS) -> Any:
        """Open a GET; the answer's body is still to be read. Anything but success is an ApiError. Tried once."""
        return self._open("GET", path, query, read_seconds=read_seconds)

    def _open(  # noqa: PLR0913 - the parts of a request
        self,
        method: str,
        path: str,
        query: Mapping[str, Any],
        body: Mapping[str, Any] | None = None,
        content: str = "",
        read_seconds: float = READ_SECONDS,
    ) -> Any:
        url = f"{self.host}{path}" + (f"?{urlencode(query)}" if query else "")
        timeout = urllib3.Timeout(connect=CONNECT_SECONDS, read=read_seconds)
        data = None if body is None else json.dumps(body).encode()
        try:
            answer = self._pool.request(
                method,
                url,
                body=data,
                headers=self._headers(content),
                preload_content=False,
                retries=False,
                timeout=timeout,
            )
        except (urllib3.exceptions.HTTPError, OSError) as exc:
            raise self._unreachable(exc) from exc
        if not 200 <= answer.status < 300:
            raise self._refused(answer, path if method == "GET" else f"{method} {path}")
        return answer

    def _unreachable(self, exc: BaseException) -> ApiError:
        untrusted = "CERTIFICATE_VERIFY_FAILED" in str(exc)
        source = self._access.source
        todo = (
            "Check ca_cert, or that the kubeconfig belongs to this cluster"
            if untrusted
            else f"Check that its server runs, that it can be reached from here, and the address (from {source})"
        )
        return ApiError(
            f"The Kubernetes API at {self.host} cannot be reached: {_cause(exc)}. {todo}.",
            transient=not untrusted,
            misfit=untrusted,
        )

    def _refused(self, answer: Any, what: str) -> ApiError:
        status = int(answer.status)
        try:
            message = _status_message(answer.data)
        except (urllib3.exceptions.HTTPError, OSError):
            message = ""
        todo = TODO.get(status, "").format(source=self._access.source)
        if status == 404 and message.startswith("namespaces "):
            todo = "Its namespace has to be applied first"
        text = f"The Kubernetes API at {self.host} answered {status} for {what}"
        return ApiError(
            ". ".join(part.rstrip(".") for part in (f"{text}: {message}" if message else text, todo) if part) + ".",
            status=status,
            transient=status == 429 or status >= 500,
        )

    def _patiently(self, work: Callable[[], Answer], also: Sequence[int] = ()) -> Answer:
        """Do it again until it succeeds, while it fails in a way that passes (or with a status of `also`)."""
        began, pause, said, said_at = self._now(), FIRST_PAUSE, Counter[str](), SAID_FROM
        while True:
            try:
                return work()
            except ApiError as exc:
                said[str(exc)] += 1
                spent = self._now() - began
                if not (exc.transient or exc.status in also) or spent >= self._patience:
                    tries = sum(said.values())
                    if tries == 1:
                        raise
                    other = [text for text in said if text != str(exc)]
                    text = f"{exc} It was tried {tries} times in {spent:.0f} s" + (
                        f"; before: {other[-1]}" if other else "."
                    )
                    raise ApiError(text, exc.status, exc.transient) from exc
                if spent >= said_at:
                    self._say(f"{exc} It is tried again for {self._patience - spent:.0f} s")
                    said_at += SAID_EVERY
                self._sleep(min(pause, self._patience - spent))
                pause = min(pause * 2, LONGEST_PAUSE)

    def _read(self, method: str, path: str, query: Mapping[str, Any], *body: Any) -> bytes:
        """A whole answer. Tried once."""
        try:
            return bytes(self._open(method, path, query, *body).data)
        except (urllib3.exceptions.HTTPError, OSError) as exc:  # the connection broke within the body
            raise self._unreachable(exc) from exc

    def _object(self, method: str, path: str, query: Mapping[str, Any], *body: Any, also: Sequence[int] = ()) -> Object:
        """The object that is the answer."""

        def ask() -> bytes:
            if method != "GET":
                self._permit()
            return self._read(method, path, query, *body)

        answer = self._patiently(ask, also)
        try:
            return dict(json.loads(answer))
        except (ValueError, TypeError) as exc:
            raise ApiError(f"{self.host} does not answer like a Kubernetes API for {path}: {exc!r}.") from exc

    # --- reading ----------------------------------------------------------------------------------------------------

    def page(self, target: Target, **query: str) -> tuple[list[Object], str]:
        """The present objects, and the resource version to watch on from. Tried once."""
        return self._page(target.path, query)

    def _page(self, path: str, query: Mapping[str, str]) -> tuple[list[Object], str]:
        try:
            body = json.loads(self._read("GET", path, query))
            items, version = body.get("items") or [], str(body["metadata"]["resourceVersion"])
        except (ValueError, KeyError, AttributeError, TypeError) as exc:
            raise ApiError(f"{self.host} does not answer like a Kubernetes API for {path}: {exc!r}.") from exc
        return list(items), version

    def objects(self, kind: str, namespace: str = "", labels: str = "", fields: str = "") -> list[Object]:
        """All objects of a kind, in one namespace or everywhere."""
        selectors = {"labelSelector": labels, "fieldSelector": fields}
        query = {key: value for key, value in selectors.items() if value}
        return self._listed(Target(kind, namespace).path, query)

    def nodes(self) -> list[Object]:
        return self.objects("Node")

    def get(self, ref: Ref) -> Object | None:
        """One object as it is, None if it is not there."""
        try:
            return self._object("GET", self._path(ref), {})
        except ApiError as exc:
            if exc.status == 404:
                return None
            raise

    def log_tail(self, namespace: str, pod: str, container: str, lines: int = 5, previous: bool = True) -> str:
        """The last lines of a container's log, for a message: without what looks like a secret."""
        query = {"container": container, "tailLines": lines, "previous": str(previous).lower()}
        path = f"{RESOURCES['Pod'].path(namespace, pod)}/log"
        text = self._patiently(lambda: self._read("GET", path, query)).decode("utf-8", "replace").strip()
        return without_secrets(text)

    # --- writing ----------------------------------------------------------------------------------------------------

    def apply(self, objects: Iterable[Mapping[str, Any]], dry_run: bool = False) -> list[Applied]:
        """Server-side apply of full definitions, in their order; the inventory is the truth, so conflicts are won.

        Fields that others own and the definition does not name are kept, but in the spec of the kinds OURS_ALONE: what
        others put into it goes.

        With `dry_run` the API server says what it would do. It cannot do so in a namespace that is not there: what
        belongs there would be new. An error names in its details, as `applied`, what was written before it.
        """
        wanted = [(ref_of(obj), obj) for obj in objects]
        present = self._present([ref for ref, _obj in wanted])
        query = {"fieldManager": MANAGER, "force": "true", **({"dryRun": "All"} if dry_run else {})}
        done: list[Applied] = []
        for ref, obj in wanted:
            try:
                fenced = ref.kind in FENCED and not dry_run
                before = present.get(ref) if ref in present and not fenced else self.get(ref)
                foreign = foreign_fields(before, obj, MANAGER) if before and ref.kind in OURS_ALONE else {}
                if foreign and not dry_run:
                    self._take_over(ref, obj)
                if fenced and before:
                    after = self._fenced(ref, obj, query, self.get(ref) if foreign else before)
                else:  # two robots that create the same object at once: one is told 409, and finds it there then
                    after = self._object("PATCH", self._path(ref), query, obj, APPLY, also=(409,))
                if foreign and dry_run:  # which cannot foresee it
                    after = without_fields(after, foreign_fields(after, obj, MANAGER))
            except ApiError as exc:
                if not (dry_run and exc.status == 404 and self._namespace_is_new(ref)):
                    exc.details["applied"] = [str(one.ref) for one in done if one.changed]
                    # Kubernetes repeats a value that it does not accept
                    exc.args = (without(str(exc), dict.fromkeys(secrets_in(obj), HIDDEN)),)
                    raise
                before, after = None, dict(obj)
            done.append(applied(ref, before, after))
        return done

    def _fenced(self, ref: Ref, wanted: Mapping[str, Any], query: Mapping[str, Any], there: Object | None) -> Object:
        """Apply it to the object as it is `there`, or as it is by then where somebody has written it since.

        A request that hangs in the API server while this run loses its Lease is refused when it gets through: whoever
        has the Lease by then has written the object.
        """
        for tries in range(1, RACES + 1):
            version = there["metadata"].get("resourceVersion") if there else None
            body = {**wanted, "metadata": {**wanted["metadata"], **({"resourceVersion": version} if version else {})}}
            try:
                return self._object("PATCH", self._path(ref), query, body, APPLY)
            except ApiError as exc:
                if exc.status != 409 or tries == RACES:
                    raise
            there = self.get(ref)
        raise AssertionError("the last try returns or raises")

    def _take_over(self, ref: Ref, wanted: Mapping[str, Any]) -> None:
        """Make what others put into the object ours, so that it goes when we do not apply it."""
        for tries in range(1, RACES + 1):
            there = self.get(ref)
            foreign = foreign_fields(there, wanted, MANAGER) if there else {}
            if there is None or not foreign:
                return
            there = {"apiVersion": ref.api_version, **there}
            taken = {
                "managedFields": taken_over(there, foreign, MANAGER),
                "resourceVersion": there["metadata"]["resourceVersion"],
            }
            try:
                self._object("PATCH", self._path(ref), {"fieldManager": MANAGER}, {"metadata": taken}, MERGE)
            except ApiError as exc:
                if exc.status != 409 or tries == RACES:
                    raise
            else:
                return

    def delete(
        self, refs: Iterable[Ref], dry_run: bool = False, uids: Mapping[Ref, str] | None = None
    ) -> list[Applied]:
        """Delete these, what they own in the background; what is not there is fine.

        Where a uid is said only just that object is deleted: another one of its name stays as it is.
        """
        done: list[Applied] = []
        query = {"propagationPolicy": "Background", **({"dryRun": "All"} if dry_run else {})}
        for ref in refs:
            before, after, uid = self.get(ref), None, (uids or {}).get(ref)
            if before is not None:
                body = (
                    [{"kind": "DeleteOptions", "apiVersion": "v1", "preconditions": {"uid": uid}}, JSON] if uid else []
                )
                try:
                    self._object("DELETE", self._path(ref), query, *body)
                except ApiError as exc:
                    if exc.status == 409 and uid:
                        after = before
                    elif exc.status != 404:
                        raise
            done.append(applied(ref, before, after))
        return done

    def merge(self, ref: Ref, part: Mapping[str, Any], dry_run: bool = False) -> Applied:
        """Merge a part into an object that is there (null removes a key, lists are replaced as a whole).

        A resourceVersion in it makes the API refuse, with status 409, what was worked out from an older object.
        """
        before = self.get(ref)
        query = {"fieldManager": MANAGER, **({"dryRun": "All"} if dry_run else {})}
        return applied(ref, before, self._object("PATCH", self._path(ref), query, part, MERGE))

    def create(self, obj: Mapping[str, Any]) -> Object:
        """A new object; status 409 if there is one of its name."""
        ref = ref_of(obj)
        return self._object("POST", self._resource(ref).path(ref.namespace), {}, obj, JSON)

    def replace(self, obj: Mapping[str, Any]) -> Object:
        """The whole object anew; status 409 if it is not of the resourceVersion that `obj` has."""
        return self._object("PUT", self._path(ref_of(obj)), {}, obj, JSON)

    # --- where objects are ------------------------------------------------------------------------------------------

    def _path(self, ref: Ref) -> str:
        return self._resource(ref).path(ref.namespace, ref.name)

    def _resource(self, ref: Ref) -> Resource:
        """Where objects of that kind are: known, or asked of the API."""
        if found := known(ref.kind, ref.api_version):
            return found
        key = (ref.api_version, ref.kind)
        if key not in self._found:
            base = base_of(ref.api_version)
            try:
                listed = self._object("GET", base, {}).get("resources") or []
            except ApiError as exc:
                if exc.status != 404:
                    raise
                listed = []
            places = [one for one in listed if one["kind"] == ref.kind and "/" not in one["name"]]
            if not places:
                raise ApiError(
                    f"The cluster at {self.host} knows no kind {ref.kind} in {ref.api_version or 'no API version'} "
                    f"(for {ref}). Check the spelling, or install what defines it.",
                    status=404,
                )
            self._found[key] = Resource(base, str(places[0]["name"]), bool(places[0]["namespaced"]))
        return self._found[key]

    def _present(self, refs: Sequence[Ref]) -> dict[Ref, Object | None]:
        """The objects as they are, where one list is cheaper than a look at each."""
        alike = Counter((ref.api_version, ref.kind, ref.namespace) for ref in refs)
        found: dict[Ref, Object | None] = {}
        for (version, kind, namespace), count in alike.items():
            resource = known(kind, version)
            if count < LISTED_FROM or resource is None or not (namespace and resource.namespaced):
                continue
            items = {item["metadata"]["name"]: item for item in self._listed(resource.path(namespace))}
            for ref in refs:
                if (ref.api_version, ref.kind, ref.namespace) == (version, kind, namespace):
                    item = items.get(ref.name)
                    found[ref] = item and {"apiVersion": version, "kind": kind, **item}  # a list's items do not say it
        return found

    def _listed(self, path: str, query: Mapping[str, str] = MappingProxyType({})) -> list[Object]:
        return self._patiently(lambda: self._page(path, query))[0]

    def _namespace_is_new(self, ref: Ref) -> bool:
        return bool(ref.namespace) and self.get(Ref("Namespace", ref.namespace)) is None


def ref_of(obj: Mapping[str, Any]) -> Ref:
    """Which object a full definition is of."""
    try:
        metadata = obj["metadata"]
        return Ref(
            str(obj["kind"]), str(metadata["name"]), str(metadata.get("namespace") or ""), str(obj["apiVersion"])
        )
    except (KeyError, TypeError, AttributeError) as exc:
        raise KubeError(
            f"This is no full definition of a Kubernetes object ({exc} is missing): {str(obj)[:200]}"
        ) from exc
