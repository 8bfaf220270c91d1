# SPDX-License-Identifier: GPL-3.0-or-later
"""Requests to the Kubernetes API, and what their failures mean: with `watch.py`, the only Kubernetes I/O here.

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
import re
import time
from collections import Counter
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Self, TypeVar
from urllib.parse import urlencode

from ...module_utils._common.documents import Arguments, json_of
from ...module_utils._common.errors import KubeError
from ...module_utils._step.objects import Object
from ...module_utils._step.words import MANAGER
from .._upstream import kubernetes_core
from .access import BROKEN, Access, access_from

with contextlib.suppress(ImportError):  # it comes with the library kubernetes, without which access_from refuses
    import urllib3
    from kubernetes import config as kube_config

Answer = TypeVar("Answer")
Query = Mapping[str, str | int]

CONNECT_SECONDS = 5.0
READ_SECONDS = 30.0
MAX_ANSWER = 256 * 1024 * 1024  # bytes: all pods of a fleet of 1000 robots are half of that
PATIENCE = 60.0  # a server that is just restarting is back by then, also on a small computer
SAID_FROM, SAID_EVERY = 5.0, 20.0  # a wait that takes longer is said
FIRST_PAUSE, LONGEST_PAUSE = 0.2, 2.0
RACES = 5  # somebody else may write an object between our look at it and our write

TODO = {
    401: "It refuses the credentials from {source}: fetch the kubeconfig again or renew the token",
    403: "These credentials lack that permission",
    404: "Is that address a Kubernetes API, 1.30 or newer?",
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


def _cause(exc: BaseException) -> str:
    """The innermost cause in one line, without urllib3's object names."""
    text = str(exc)
    if known := re.search("Connection refused|No route to host|Name or service not known|Network is unreachable", text):
        return known.group().lower()
    if any(part in text for part in ("EOF occurred", "Connection reset", "RemoteDisconnected", "Connection aborted")):
        return "it closed the connection"
    if "timed out" in text.lower():
        return "no answer in time"
    if "CERTIFICATE_VERIFY_FAILED" in text:
        return f"its certificate is not trusted ({text.rpartition('CERTIFICATE_VERIFY_FAILED] ')[2].rstrip(')')})"
    return text.rpartition(": ")[2].removesuffix("'))") or type(exc).__name__


class ApiConnection:
    """To one cluster's API. Thread-safe; `close` it, or use it as a context.

    What may succeed a moment later (nothing listens, the connection broke, 429, 5xx) is tried again for `patience`
    seconds per request; `say` is told why, once it takes long. Only `request` and `page` are not: a watch does that by
    itself, and tells about it.
    """

    def __init__(
        self,
        auth: Arguments | Access,
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
        self._in_the_name_of: tuple[tuple[str, str], ...] = ()

    @property
    def host(self) -> str:
        return str(self._access.configuration.host)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *unused: object) -> None:
        self.close()

    def within(self, patience: float) -> Self:
        """The same connection for requests that are given up after that many seconds. Not to be closed by itself."""
        hurried = copy.copy(self)
        hurried._patience = patience
        return hurried

    def allowed_by(self, permit: Callable[[], None]) -> Self:
        """The same connection; `permit` is called before every try of a write, and raises where it must not be made."""
        asking = copy.copy(self)
        asking._permit = permit
        return asking

    def acting_as(self, user: str, *groups: str) -> Self:
        """The same connection in the name of somebody else, of whom the API server then asks what he may."""
        other = copy.copy(self)
        other._in_the_name_of = (("Impersonate-User", user), *(("Impersonate-Group", group) for group in groups))
        return other

    def close(self) -> None:
        self._pool.clear()
        kubernetes_core.remove_key_files(kube_config)  # made of a kubeconfig's inline keys

    def _headers(self, content: str) -> Any:
        headers = urllib3.HTTPHeaderDict({"Accept": JSON, "User-Agent": MANAGER})
        if content:
            headers["Content-Type"] = content
        for setting in self._access.configuration.auth_settings().values():
            headers[setting["key"]] = setting["value"].strip()  # a file of a token ends with a line end
        for name, value in (*self._access.headers, *self._in_the_name_of):
            headers.add(name, value)
        return headers

    def request(  # noqa: PLR0913 - its parts
        self,
        method: str,
        path: str,
        query: Query,
        body: Object | None = None,
        content: str = "",
        read_seconds: float = READ_SECONDS,
    ) -> Any:
        """An answer whose body is still to be read. Anything but success is an ApiError. Tried once."""
        url = f"{self.host}{path}" + (f"?{urlencode(query)}" if query else "")
        timeout = urllib3.Timeout(connect=CONNECT_SECONDS, read=read_seconds)
        data = None if body is None else json.dumps(body).encode()
        try:
            how = {"headers": self._headers(content), "timeout": timeout, "preload_content": False, "retries": False}
            answer = self._pool.request(method, url, body=data, **how)
        except BROKEN as exc:
            raise self._unreachable(exc) from exc
        except ValueError:  # whose words repeat it
            raise ApiError(f"The credentials from {self._access.source} have characters that no header has.") from None
        if not 200 <= answer.status < 300:
            raise self._refused(answer, path if method == "GET" else f"{method} {path}")
        return answer

    def _unreachable(self, exc: BaseException) -> ApiError:
        untrusted, source = "CERTIFICATE_VERIFY_FAILED" in str(exc), self._access.source
        todo = f"Check that its server runs, that it can be reached from here, and the address (from {source})"
        if untrusted:
            todo = "Check ca_cert, or that the kubeconfig belongs to this cluster"
        proxy = getattr(self._pool, "proxy", None)  # without what logs in there
        way = f"by the proxy {proxy.host}:{proxy.port}: " if proxy else ""
        text = f"The Kubernetes API at {self.host} cannot be reached: {way}{_cause(exc)}. {todo}."
        return ApiError(text, transient=not untrusted, misfit=untrusted)

    def _refused(self, answer: Any, what: str) -> ApiError:
        status, message = int(answer.status), ""
        with contextlib.suppress(*BROKEN, ApiError, ValueError, AttributeError):
            said = body_of(answer)
            message = said[:200].decode("utf-8", "replace").strip()  # of whatever answered, if no Status
            message = str(json_of(said).get("message") or "")
        todo = TODO.get(status, "").format(source=self._access.source)
        if status == 404 and message.startswith("namespaces "):
            todo = "Its namespace has to be applied first"
        if status == 403 and message and " cannot " not in message:
            todo = ""  # these are no rights: a quota, a webhook, a namespace that goes
        text = f"The Kubernetes API at {self.host} answered {status} for {what}" + (f": {message}" if message else "")
        text = ". ".join(part.rstrip(".") for part in (text, todo) if part)
        return ApiError(f"{text}.", status, transient=status in (410, 429) or status >= 500)

    def _patiently(self, work: Callable[[], Answer]) -> Answer:
        """Do it again until it succeeds, while it fails in a way that passes."""
        began, pause, said, said_at = self._now(), FIRST_PAUSE, Counter[str](), SAID_FROM
        while True:
            try:
                return work()
            except ApiError as exc:
                said[str(exc)] += 1
                spent = self._now() - began
                if not exc.transient or spent >= self._patience:
                    other = [f"; before: {text}" for text in said if text != str(exc)] or ["."]
                    if (tries := said.total()) > 1:
                        exc.args = (f"{exc} It was tried {tries} times in {spent:.0f} s{other[-1]}",)
                    raise
                if spent >= said_at:
                    self._say(f"{exc} It is tried again for {self._patience - spent:.0f} s")
                    said_at += SAID_EVERY
                self._sleep(min(pause, self._patience - spent))
                pause = min(pause * 2, LONGEST_PAUSE)

    def _read(self, method: str, path: str, query: Query, *body: Any) -> bytes:
        """A whole answer. Tried once."""
        try:
            return body_of(self.request(method, path, query, *body))
        except BROKEN as exc:  # the connection broke within the body
            raise self._unreachable(exc) from exc

    def _object(self, method: str, path: str, query: Query, *body: Any) -> Object:
        """The object that is the answer."""

        def ask() -> bytes:
            if method != "GET":
                self._permit()
            return self._read(method, path, query, *body)

        answer = self._patiently(ask)
        try:
            return dict(json_of(answer))
        except (ValueError, TypeError) as exc:
            raise self._stranger(path, exc) from exc

    def page(self, path: str, query: Query = MappingProxyType({})) -> tuple[list[Object], str]:
        """The objects of a list, and the resource version to watch on from. Tried once."""
        try:
            body = json_of(self._read("GET", path, query))
            return list(body.get("items") or []), str(body["metadata"]["resourceVersion"])
        except (ValueError, KeyError, AttributeError, TypeError) as exc:
            raise self._stranger(path, exc) from exc

    def _stranger(self, path: str, exc: Exception) -> ApiError:
        return ApiError(f"{self.host} does not answer like a Kubernetes API for {path}: {exc!r}.")


def body_of(answer: Any) -> bytes:
    """The whole of an answer that `request` gave; ApiError where it is longer than any that is asked for."""
    found = bytes(answer.read(MAX_ANSWER + 1))
    if len(found) > MAX_ANSWER:
        answer.close()
        raise ApiError(f"an answer of more than {MAX_ANSWER} bytes was not read to its end")
    return found


def anew(work: Callable[[], Answer]) -> Answer:
    """`work` looks at an object and writes it; once more where somebody else has written it in between."""
    for _race in range(RACES - 1):
        try:
            return work()
        except ApiError as exc:
            if exc.status != 409:
                raise
    return work()
