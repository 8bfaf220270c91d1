# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a pod's probes say: the status tells that a container is not ready, only the kubelet's events tell why.

A probe of this collection starts its line with `cannot become ready: ` where waiting cannot mend it. Of a probe by HTTP
the kubelet tells no more than the status, so what a sidecar with our hooks has to say stands in its log. Both are asked
for only while they can say something new, and seldom: the API server answers a list of events from all that it has.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

from ...module_utils._step.objects import Object, name_of
from .._model.names import SIDECAR
from .client import Kube
from .connection import ApiError
from .pods import meta, uid_of

HOPELESS = "cannot become ready: "
COMBINED = "(combined from similar events): "  # what the kubelet puts in front of the tenth of its kind
FIELDS = "reason=Unhealthy,involvedObject.kind=Pod"
_HEAD = re.compile(r"\w+ probe failed: ?")
SECONDS = 1.0
SECONDS_AFTER_ERROR = 5.0


def probe_line(message: str) -> str:
    """'Startup probe failed: why', in one line: the hopeless one where there are more, else the last."""
    plain = message.strip()
    plain = plain[len(COMBINED) :] if plain.startswith(COMBINED) else plain
    head = _HEAD.match(plain)
    lines = [line.strip() for line in plain[head.end() if head else 0 :].splitlines() if line.strip()]
    chosen = next((line for line in lines if HOPELESS in line), lines[-1] if lines else "")
    return f"{head[0] if head else ''}{chosen}".strip()


def _when(event: Object) -> tuple[str, bool]:
    series = event.get("series") or {}
    times = (series.get("lastObservedTime"), event.get("lastTimestamp"), event.get("eventTime"))
    # whole seconds: of two within one, the hopeless one is the later, as a probe that printed it does not recover
    return next((str(time)[:19] for time in times if time), ""), HOPELESS in str(event.get("message"))


def latest(events: Iterable[Object]) -> dict[str, str]:
    """By pod uid, the newest of its Unhealthy events: of an earlier pod of the same name nothing is taken over."""
    found: dict[str, str] = {}
    for event in sorted((one for one in events if one.get("reason") == "Unhealthy"), key=_when):
        uid = str((event.get("involvedObject") or {}).get("uid") or "")
        found[uid] = probe_line(str(event.get("message") or ""))
    return found


class ProbeNews:
    """The pods' last lines, asked for at most once a second per namespace."""

    def __init__(self) -> None:
        self.lines: dict[str, str] = {}  # by pod uid
        self._due: dict[str, float] = {}

    def due(self, namespaces: Iterable[str], now: float) -> float:
        """When one of these may be asked next."""
        return min((self._due.get(namespace, now) for namespace in namespaces), default=math.inf)

    def ask(self, kube: Kube, namespaces: Iterable[str], now: float, beside: Iterable[Object] = ()) -> bool:
        """Ask those that are due; whether there was one. `beside`: pods whose hooks are in a sidecar."""
        due = [namespace for namespace in namespaces if self._due.get(namespace, now) <= now]
        for namespace in due:
            try:
                self.lines.update(latest(kube.objects("Event", namespace, fields=FIELDS)))
                self.lines.update(
                    {
                        uid_of(pod): kube.log_tail(namespace, name_of(pod), SIDECAR, 1, previous=False)
                        for pod in beside
                        if meta(pod).get("namespace") == namespace
                    }
                )
                self._due[namespace] = now + SECONDS
            except ApiError as error:  # the wait can do without: the watch tells what matters
                self._due[namespace] = math.inf if error.status == 403 else now + SECONDS_AFTER_ERROR
        return bool(due)
