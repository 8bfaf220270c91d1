# SPDX-License-Identifier: GPL-3.0-or-later
"""The door of a robot's keeper (`module_utils/_robot/door.py`), through the API server: with the rights of whoever asks
there, and without a connection to the robot's host."""

from __future__ import annotations

import time
from collections.abc import Callable

from ...module_utils._common.documents import json_of
from ...module_utils._step.objects import Object
from ...module_utils._step.words import JOBS_PATH, KEEPER, KEEPER_PORT, LASTING
from .access import BROKEN
from .connection import JSON, ApiConnection, ApiError, body_of

ANSWER = 20.0  # seconds for an answer, beside those that the job itself may take
SHUT = 30.0  # seconds for which a door that did not answer is not asked again


class KeeperDoor:
    """That of one robot. ApiError where nobody answers there: no keeper, an older one, or one that cannot be reached.

    `home` is the namespace of the keeper, `namespace` that of the robot, and `holder` has its Lease when something is
    to be changed.
    """

    def __init__(
        self,
        kube: ApiConnection,
        home: str,
        namespace: str,
        holder: str,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._kube, self._query, self._now = kube, {"namespace": namespace, "holder": holder}, now
        self._service = f"/api/v1/namespaces/{home}/services/{KEEPER}:{KEEPER_PORT}/proxy"
        self._shut, self._why = 0.0, ApiError("")

    def there(self) -> None:
        """Whether the keeper is ready."""
        self._asked("GET", "/ready", None, ANSWER)

    def job(self, name: str, arguments: Object) -> Object:
        """The result of a job of `module_utils/_ros/jobs.py`; the keeper knows the addresses of its arguments."""
        seconds = sum(float(arguments.get(key) or 0.0) for key in LASTING)
        answer = self._asked("POST", f"{JOBS_PATH}{name}", arguments, seconds + ANSWER)
        try:
            return dict(json_of(answer))
        except (ValueError, TypeError) as error:
            raise ApiError(f"The keeper's door answers no JSON for {name}: {error}") from error

    def _asked(self, method: str, path: str, body: Object | None, seconds: float) -> bytes:
        if self._now() < self._shut:
            raise self._why
        query = self._query if body is not None else {}
        content = JSON if body is not None else ""
        try:
            return body_of(self._kube.request(method, f"{self._service}{path}", query, body, content, seconds))
        except ApiError as error:
            self._why = error
        except BROKEN as error:
            self._why = ApiError(f"The keeper's door broke off: {error}")
        self._shut = self._now() + SHUT
        raise self._why
