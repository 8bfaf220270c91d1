# SPDX-License-Identifier: GPL-3.0-or-later
"""What a wait tells: what is still open, and why it failed, with what the cluster has to say beyond the status.

A pod's status tells that a container is not ready, only the kubelet's events tell why. A probe of this collection
starts its line with `cannot become ready: ` where waiting cannot mend it. Of a probe by HTTP the kubelet tells no more
than the status, so what a sidecar with our hooks has to say stands in its log. Both are asked for only while a probe
can say something new, and seldom: the API server answers a list of events from all that it has.
"""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Iterable, Mapping, Sequence

from ...module_utils._common.poll import PASS
from ...module_utils._step.objects import Object, is_terminating, name_of
from ...module_utils._step.words import HOPELESS
from .._model.names import SIDECAR
from .cache import Ref, View
from .client import Kube
from .connection import ApiError
from .pods import IMAGE_ERRORS, Verdict, condition, containers, ends, space_of, uid_of

FIELDS = "reason=Unhealthy,involvedObject.kind=Pod"
_PROBE = r"\w+ probe failed: ?"
# in front of the tenth of its kind the kubelet puts a remark
_HEAD = re.compile(rf"\s*(?:\(combined from similar events\): )?({_PROBE})?")
SECONDS = 1.0
SECONDS_AFTER_ERROR = 5.0
SHOWN = 12  # lines of a progress message
LOG_LINES, TELLING_LINES = 200, 5  # that are read of a log, and that are told
_ERROR = re.compile(r"\b(ERROR|FATAL|Traceback|[A-Za-z.]*(Error|Exception)\b|rosops\.fleet:|not found|[Ss]egmentation)")
_WHERE = re.compile(
    rf"(pod [^\s:,]+(?:, container [^\s:,]+)?): (?:{_PROBE})?(?:(?:not|cannot become) ready: )?(.+)", re.S
)
_COLOUR = re.compile(r"\x1b\[[0-9;]*m")
_NAME, _NUMBER = re.compile(r"^\[[^\]]*\]"), re.compile(r"\d+")  # `[camera-3] killing on exit`

Verdicts = Mapping[Ref, Verdict]  # the last one on each object


def progress(rows: Verdicts, elapsed: float, unreachable: str) -> str:
    """What is still open, in a few lines."""
    still = [f"  {ref}: {verdict.reason}" for ref, verdict in rows.items() if verdict.verdict != PASS]
    if not still:
        return "rollout: all of it is there, and watched for a while"
    lines = [f"rollout: {len(still)} of {len(rows)} still open after {elapsed:.0f} s"]
    if unreachable:
        lines.append(f"  no news at the moment: {unreachable}")
    more = [f"  and {len(still) - SHOWN} more"] if len(still) > SHOWN else []
    return "\n".join([*lines, *still[:SHOWN], *more])


def cause_first(ref: Ref, reason: str) -> str:
    """What is wrong, as the app or the kubelet has it, and then whose it is."""
    found = _WHERE.match(reason)
    where, why = (f", {found[1]}", found[2]) if found else ("", reason)
    return f"{why} ({ref}{where})"


def notes_on(kube: Kube, bad: Verdicts, view: View) -> list[str]:
    """What the cluster has to say beyond the status: the last warnings, and the last words of what crashed.

    It only explains a failure that is already certain, so it does without what it may not read.
    """
    notes: list[str] = []
    said = " ".join(verdict.reason for verdict in bad.values())
    for namespace in sorted({ref.namespace for ref in bad if ref.namespace})[:3]:
        ours = tuple(f"{ref.name}-" for ref in bad if ref.namespace == namespace)  # and what is named after them
        with contextlib.suppress(ApiError):
            for pod in view.all("Pod", namespace):
                if f"{name_of(pod)}-".startswith(ours):
                    notes += _last_words(kube, pod, said)
        with contextlib.suppress(ApiError):
            events = kube.objects("Event", namespace, fields="type=Warning")
            notes += _warnings(one for one in events if _is_news(one, view, namespace, ours, said))
    return notes[:SHOWN]


def _is_news(event: Object, view: View, namespace: str, ours: tuple[str, ...], said: str) -> bool:
    """Not about something that is gone or going, and not what the verdict says already."""
    about = event.get("involvedObject") or {}
    kind, name, message = str(about.get("kind")), str(about.get("name")), str(event.get("message") or "")
    found = view.get(kind, namespace, name)
    if not f"{name}-".startswith(ours):
        return False
    if kind == "Pod" and (not found or is_terminating(found) or uid_of(found) != about.get("uid")):
        return False
    if kind == "ReplicaSet" and found and not (found.get("spec") or {}).get("replicas"):
        return False
    if event.get("reason") == "Unhealthy" and f"pod {name}: " in said:
        return False
    bare = message.replace("Error: ", "")
    return event.get("reason") != "BackOff" and bare not in IMAGE_ERRORS and bare not in said


def _warnings(events: Iterable[Object]) -> list[str]:
    """The newest warning of each object."""
    newest: dict[str, Object] = {}
    for event in sorted(events, key=_when):
        about = event["involvedObject"]
        newest[f"{about.get('kind')} {about.get('name')}"] = event
    return [f"  event of {about}: {event.get('reason')}: {event.get('message')}" for about, event in newest.items()]


def _last_words(kube: Kube, pod: Object, said: str) -> list[str]:
    name, namespace = name_of(pod), space_of(pod)
    if condition(pod, "Ready").get("status") == "True" and f"pod {name}," not in said:  # it has recovered
        return []
    lines: list[str] = []
    for container in containers(pod):
        now, last = ends(container)
        ended = last or (now if now.get("exitCode") else {})
        node_ended = not ended and f"pod {name}: " in said and HOPELESS in said  # a node of it, and it has not
        if node_ended or (ended and not ended.get("message")):
            # if none was started since it ended, it is the present one
            log = kube.log_tail(namespace, name, str(container.get("name")), LOG_LINES, previous=bool(last))
            lines += [f"  log of pod {name}, container {container.get('name')}: {line}" for line in telling(log)]
    return lines


def telling(log: str) -> list[str]:
    """A few lines of a log that say the most of an end, in the log's order.

    Errors and exceptions come before the rest. Of what is the same each time, as the end of each node, one is enough.
    """
    lines = [line for line in (_COLOUR.sub("", line).rstrip() for line in log.splitlines()) if line.strip()]
    alike = {_NUMBER.sub("", _NAME.sub("", line)): number for number, line in enumerate(lines)}  # the last of each kind
    errors = [number for number in alike.values() if _ERROR.search(lines[number])]
    others = [number for number in alike.values() if number not in errors]
    chosen = [*sorted(errors)[-TELLING_LINES:], *sorted(others, reverse=True)][:TELLING_LINES]
    return [lines[number] for number in sorted(chosen)]


# --- what probes say --------------------------------------------------------------------------------------------------


def probe_line(message: str) -> str:
    """'Startup probe failed: why', in one line: the hopeless one where there are more, else the last."""
    _nothing, head, rest = _HEAD.split(message, maxsplit=1)
    lines = [line.strip() for line in rest.splitlines() if line.strip()] or ["its command says nothing"]
    chosen = next((line for line in lines if HOPELESS in line), lines[-1])
    return f"{head or ''}{chosen}"


def _when(event: Object) -> tuple[str, bool]:
    """In whole seconds. Of two within one the hopeless one is the later: a probe that printed it does not recover."""
    times = ((event.get("series") or {}).get("lastObservedTime"), event.get("lastTimestamp"), event.get("eventTime"))
    return next((str(time)[:19] for time in times if time), ""), HOPELESS in str(event.get("message"))


def latest(events: Iterable[Object]) -> dict[str, str]:
    """By pod uid, the newest of its Unhealthy events: of an earlier pod of the same name nothing is taken over."""
    found: dict[str, str] = {}
    for event in sorted((one for one in events if one.get("reason") == "Unhealthy"), key=_when):
        uid = str((event.get("involvedObject") or {}).get("uid") or "")
        found[uid] = probe_line(str(event.get("message") or ""))
    return found


class ProbeNews:
    """The pods' last lines, asked for at most once a second."""

    def __init__(self) -> None:
        self.lines: dict[str, str] = {}  # by pod uid
        self.due = 0.0  # when they may be asked for next

    def ask(self, kube: Kube, pods: Sequence[Object], now: float) -> bool:
        """Whether they were asked for."""
        if not pods or now < self.due:
            return False
        self.due = now + SECONDS
        try:
            for namespace in {space_of(pod) for pod in pods}:
                self.lines.update(latest(kube.objects("Event", namespace, fields=FIELDS)))
            for pod in pods:
                if SIDECAR in (one.get("name") for one in containers(pod)):
                    self.lines[uid_of(pod)] = kube.log_tail(space_of(pod), name_of(pod), SIDECAR, 1, previous=False)
        except ApiError as error:  # the wait can do without: the watch tells what matters
            self.due = math.inf if error.status == 403 else now + SECONDS_AFTER_ERROR
        return True
