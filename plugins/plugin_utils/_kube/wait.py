# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Wait until everything is rolled out: one watch feeds the view, every change is judged at once.

The cluster, the clock and the way to say something are handed in.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError, NotReadyError
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import FAIL, PASS, WAIT, overall
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import is_ready, is_terminating, name_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import (
    CLUSTER_WIDE,
    Ref,
    View,
    parse_refs,
    watched,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.client import PATIENCE, ApiError
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.pods import (
    IMAGE_ERRORS,
    REFUSED,
    UNSCHEDULABLE,
    Object,
    Verdict,
    condition,
    containers,
    error_end,
    grace_of,
    is_up,
    meta,
    restarts,
    sidecars,
    uid_of,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.probe_events import HOPELESS, ProbeNews
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.resources import Target
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.verdicts import (
    Tracker,
    judge,
    leaving_pods,
    present_pods,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.watch import Change, Watch
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.names import SIDECAR

ROLLOUT_ARGS: dict[str, dict[str, Any]] = {
    "objects": {"type": "list", "elements": "dict", "required": True, "aliases": ["definitions"]},
    "timeout": {"type": "float", "default": 300},
    "unschedulable_grace": {"type": "float", "default": 10},
    "fail_on_restart": {"type": "bool", "default": False},
}

SAY_SECONDS = 10.0  # below the idle time-outs of the tools that run playbooks
SHARED_FROM = 5  # from so many namespaces on, one stream for the whole cluster is cheaper than one each
BEGUN_SECONDS = 1.0  # after that what runs has found its command
NO_PLACE = (UNSCHEDULABLE, REFUSED)  # no room on a node, or in a quota
SHOWN = 12  # lines of a progress message
LOG_LINES, TELLING_LINES = 200, 5  # that are read of a log, and that are told
_ERROR = re.compile(r"\b(ERROR|FATAL|Traceback|[A-Za-z.]*(Error|Exception)\b|rosops\.fleet:|not found|[Ss]egmentation)")
_WHERE = re.compile(
    r"(pod [^\s:,]+(?:, container [^\s:,]+)?): (?:\w+ probe failed: )?(?:(?:not|cannot become) ready: )?(.+)", re.S
)
_COLOUR = re.compile(r"\x1b\[[0-9;]*m")
_NAME, _NUMBER = re.compile(r"^\[[^\]]*\]"), re.compile(r"\d+")  # `[camera-3] killing on exit`


class Cluster(Protocol):
    """What is needed of `client.Kube`."""

    @property
    def host(self) -> str: ...

    def objects(self, kind: str, namespace: str = "", labels: str = "", fields: str = "") -> list[Object]: ...

    def log_tail(self, namespace: str, pod: str, container: str, lines: int = 5, previous: bool = True) -> str: ...


class Stream(Protocol):
    """What is needed of `watch.Watch`."""

    def __enter__(self) -> Stream: ...

    def __exit__(self, *unused: object) -> None: ...

    def follow(self, targets: Iterable[Target]) -> None: ...

    def changes(self, timeout: float) -> list[Change]: ...


def say_nothing(_text: str) -> None:
    """For callers that have no way to say something."""


@dataclass(frozen=True)
class Settings:
    """How long to wait, and what a test replaces."""

    timeout: float = 300.0
    grace: float = 10.0
    fail_on_restart: bool = False
    watched: float = 0.0  # seconds for which all of it has to stay rolled out
    before: dict[str, dict[str, int]] = field(default_factory=dict)  # by pod uid, restarts that are none of its rollout
    begun: bool = False  # enough that the new pods run, or have no place yet; with minReadySeconds, that they are Ready
    say: Callable[[str], None] = say_nothing
    now: Callable[[], float] = time.monotonic
    watch: Callable[[Any, Iterable[Target]], Stream] = Watch


@dataclass(frozen=True)
class Row:
    """One object and the last verdict on it."""

    ref: Ref
    verdict: Verdict

    def as_dict(self) -> dict[str, str]:
        return {
            "kind": self.ref.kind,
            "name": self.ref.name,
            "namespace": self.ref.namespace,
            "verdict": self.verdict.verdict,
            "reason": self.verdict.reason,
        }

    def __str__(self) -> str:
        return f"{self.ref}: {self.verdict.reason}"


def targets_for(refs: Iterable[Ref]) -> list[Target]:
    """One stream per kind and namespace, or one for the whole cluster where there are many namespaces."""
    found: list[Target] = []
    for kind, namespaces in sorted(watched(refs).items()):
        if kind in CLUSTER_WIDE or len(namespaces) >= SHARED_FROM:
            found.append(Target(kind))
        else:
            found.extend(Target(kind, namespace) for namespace in sorted(namespaces))
    return found


class _Wait:
    """What is known at the moment."""

    def __init__(self, refs: Sequence[Ref], settings: Settings) -> None:
        self.refs, self.settings = refs, settings
        self.view, self.tracker, self.news = View(), Tracker(settings.grace), ProbeNews()
        self.well: float | None = None  # since when all of it is rolled out
        self.up: dict[str, float] = {}  # by pod uid, since when one was seen to run that is to begin
        self.unlisted = set(targets_for(refs))
        self.lost: dict[Target, ApiError] = {}
        self.leaving: dict[str, float] = {}  # by pod uid, until when it may take to end
        self.start = self.seen = self.counted = self.gone = settings.now()

    def end(self) -> float:
        """When the time is over: that of the objects begins when the API has shown them."""
        return self.start + PATIENCE if self.unlisted else self.seen + self.settings.timeout

    def stayed(self, verdict: str) -> bool:
        """Whether all of it has been rolled out for as long as it has to be."""
        now = self.settings.now()
        self.well = (now if self.well is None else self.well) if verdict == PASS else None
        return self.well is not None and now >= self.well + self.settings.watched

    def count(self) -> None:
        """The time that old pods have for their end, before new ones come or after, is not the new ones' time."""
        now = self.settings.now()
        self.seen += max(min(now, self.gone) - self.counted, 0.0)
        pods = [pod for ref in self.refs for pod in leaving_pods(ref, self.view)]
        self.gone = max([self.leaving.setdefault(uid_of(pod), now + grace_of(pod)) for pod in pods], default=now)
        self.counted = now

    def take(self, change: Change, stream: Stream) -> None:
        target, blind = change.target, bool(self.unlisted)
        if change.what == "listed":
            self.unlisted.discard(target)
            self.view.replace(target.kind, target.namespace, change.objects)
        for obj in change.objects if change.what in ("set", "gone") else ():
            (self.view.put if change.what == "set" else self.view.drop)(target.kind, obj)
        if change.what == "lost" and change.error:
            self.lost[target] = change.error
        elif change.what in ("back", "listed"):
            self.lost.pop(target, None)
        elif change.what == "refused" and change.error:
            self._refused(target, change.error, stream)
        if blind and not self.unlisted:
            self.seen = self.settings.now()

    def _refused(self, target: Target, error: ApiError, stream: Stream) -> None:
        namespaces = watched(self.refs).get(target.kind, set())
        if error.status == 403 and target.kind == "StorageClass":
            self.view.hidden.add(target.kind)  # only says why a claim is pending, so the wait can do without
            self.unlisted.discard(target)
        elif error.status == 403 and not target.namespace and namespaces:
            each = [Target(target.kind, namespace) for namespace in sorted(namespaces)]
            self.unlisted.discard(target)
            self.unlisted.update(each)
            stream.follow(each)  # not allowed to see the whole cluster: then namespace by namespace
        else:
            raise error

    def rows(self) -> list[Row]:
        """The verdicts now. Until every stream has listed, nothing passes: what is missing may only be unseen."""
        now, rows = self.settings.now(), []
        for ref in self.refs:
            verdict, pods = judge(ref, self.view, self.refs), present_pods(ref, self.view)
            if self.unlisted:
                verdict = Verdict(WAIT, self.unreachable() or "is being looked up")
            elif verdict.verdict != FAIL:
                verdict = self._with_pods(pods, verdict)
                if self.settings.begun and verdict.verdict == WAIT and self._have_begun(ref, pods, verdict, now):
                    verdict = Verdict(PASS, verdict.reason)
            rows.append(Row(ref, self.tracker.settle(ref, verdict, now)))
        return rows

    def _have_begun(self, ref: Ref, pods: Sequence[Object], verdict: Verdict, now: float) -> bool:
        """Whether they run, and not only until they see that they cannot; or have no place yet.

        Those that have to be Ready for a while before the old ones go (minReadySeconds) have begun when they are.
        """
        wanted = self.view.get(ref.kind, ref.namespace, ref.name) or {}
        if (wanted.get("spec") or {}).get("minReadySeconds"):
            return any(map(is_ready, pods))
        up = [self.up.setdefault(uid_of(pod), now) for pod in pods if is_up(pod)]
        return verdict.suspect in NO_PLACE or any(now - since >= BEGUN_SECONDS for since in up)

    def _with_pods(self, pods: Sequence[Object], verdict: Verdict) -> Verdict:
        """The verdict with what the present pods have to add: an end with an error, and the last words of a probe."""
        for pod in pods if self.settings.fail_on_restart else ():
            # a pod that was Ready when first seen had its restarts in an earlier life
            before = self.settings.before.setdefault(uid_of(pod), restarts(pod) if is_ready(pod) else {})
            ended = error_end(pod, before)
            if ended:
                return ended
        lines = [(pod, self.news.lines.get(uid_of(pod))) for pod in pods if _waits(pod)]
        said = [(pod, line) for pod, line in lines if line and line.text]
        for pod, line in said if verdict.verdict == WAIT else ():
            if line.hopeless:
                return Verdict(FAIL, f"pod {name_of(pod)}: {line.text}")
        if verdict.verdict == PASS or not said:
            return verdict
        heard = [f"pod {name_of(pod)}: {line.text}" for pod, line in said[:3]]
        rest = [] if len(said) == len(lines) and not verdict.suspect else [verdict.reason]
        return Verdict(verdict.verdict, "; ".join([*heard, *rest]), verdict.suspect)

    def begun_at(self, now: float) -> float | None:
        """When the next of those that run will have run for long enough."""
        due = [since + BEGUN_SECONDS for since in self.up.values() if since + BEGUN_SECONDS > now]
        return min(due, default=None)

    def starting(self) -> set[str]:
        """Namespaces where a present pod is up but not ready: only its probe knows why."""
        if self.unlisted or self.lost:
            return set()
        return {ref.namespace for ref in self.refs if any(_waits(pod) for pod in present_pods(ref, self.view))}

    def hear(self, kube: Cluster) -> bool:
        pods = [pod for ref in self.refs for pod in present_pods(ref, self.view) if _waits(pod)]
        beside = [pod for pod in pods if SIDECAR in sidecars(pod)]
        return self.news.ask(kube, self.starting(), self.settings.now(), beside)

    def unreachable(self) -> str:
        return str(next(iter(self.lost.values()))) if self.lost else ""

    def elapsed(self) -> float:
        return self.settings.now() - self.start


def _waits(pod: Mapping[str, Any]) -> bool:
    return is_up(pod) and not is_ready(pod)


def _progress(rows: Sequence[Row], elapsed: float, unreachable: str) -> str:
    open_rows = [row for row in rows if row.verdict.verdict != PASS]
    if not open_rows:
        return "rollout: all of it is there, and watched for a while"
    lines = [f"rollout: {len(open_rows)} of {len(rows)} still open after {elapsed:.0f} s"]
    if unreachable:
        lines.append(f"  no news at the moment: {unreachable}")
    lines += [f"  {row}" for row in open_rows[:SHOWN]]
    if len(open_rows) > SHOWN:
        lines.append(f"  and {len(open_rows) - SHOWN} more")
    return "\n".join(lines)


def wait_for_rollout(kube: Cluster, refs: Sequence[Ref], settings: Settings) -> dict[str, Any]:
    """All rolled out: the result as data. Otherwise NotReadyError: at once when one failed, or at the time-out."""
    wait = _Wait(refs, settings)
    say_at = wait.start + SAY_SECONDS
    with settings.watch(kube, sorted(wait.unlisted, key=str)) as stream:
        while True:
            rows = wait.rows()
            if any(row.verdict.verdict == WAIT for row in rows) and wait.hear(kube):
                rows = wait.rows()
            verdict, now = overall([row.verdict.verdict for row in rows]), settings.now()
            if wait.stayed(verdict):
                return {"objects": [row.as_dict() for row in rows], "elapsed": round(now - wait.start, 3)}
            wait.count()
            over = now >= wait.end() and wait.well is None
            if over and wait.unlisted and wait.lost:
                raise next(iter(wait.lost.values()))
            if verdict == FAIL or over:
                break
            if now >= say_at:
                settings.say(_progress(rows, wait.elapsed(), wait.unreachable()))
                say_at += SAY_SECONDS
            ends = [max(wait.end(), wait.gone), say_at, wait.tracker.due(), wait.begun_at(now)]
            # what is only watched has no news to tell, and no end of its time
            ends += [wait.news.due(wait.starting(), now)] if wait.well is None else []
            ends[0] = ends[0] if wait.well is None else wait.well + settings.watched
            until = min(end for end in ends if end is not None)
            if wait.unlisted:
                until = min(until, now + 1.0)
            for change in stream.changes(until - now):
                wait.take(change, stream)
    raise _not_ready(kube, wait, rows, verdict)


def look_once(kube: Cluster, refs: Sequence[Ref]) -> dict[str, Any]:
    """The verdicts as they are now, for check mode: no wait, and nothing fails."""
    view, start = View(), time.monotonic()
    for target in targets_for(refs):
        try:
            view.replace(target.kind, target.namespace, kube.objects(target.kind, target.namespace))
        except ApiError as exc:
            if exc.status != 403:
                raise
            view.hidden.add(target.kind)
    rows = [Row(ref, judge(ref, view, refs)) for ref in refs]
    return {"objects": [row.as_dict() for row in rows], "elapsed": round(time.monotonic() - start, 3)}


# --- the message of a failure ---------------------------------------------------------------------------------------


def _not_ready(kube: Cluster, wait: _Wait, rows: Sequence[Row], verdict: str) -> KubeError | NotReadyError:
    bad = [row for row in rows if row.verdict.verdict == (FAIL if verdict == FAIL else WAIT)]
    elapsed = wait.elapsed()
    if verdict == FAIL:
        head = f"{len(bad)} of {len(rows)} cannot be rolled out"
    else:
        head = f"{len(bad)} of {len(rows)} are not rolled out after {elapsed:.0f} s"
    notes = [] if wait.unlisted or wait.lost else _notes(kube, bad, wait.view)
    which = ", ".join(str(row.ref) for row in bad)
    lines = [*(cause_first(row) for row in bad), *notes, f"  {head}: {which}"]
    if wait.unreachable() and not wait.unlisted:
        lines.append(f"  The last news is old: {wait.unreachable()}")
    return NotReadyError("\n".join(lines), objects=[row.as_dict() for row in rows], elapsed=round(elapsed, 3))


def cause_first(row: Row) -> str:
    """What is wrong, as the app or the kubelet has it, and then whose it is."""
    found = _WHERE.match(row.verdict.reason)
    where, why = (f", {found[1]}", found[2]) if found else ("", row.verdict.reason)
    return f"{why} ({row.ref}{where})"


def _notes(kube: Cluster, bad: Sequence[Row], view: View) -> list[str]:
    """What the cluster has to say beyond the status: the last warnings, and the last words of what crashed.

    It only explains a failure that is already certain, so it does without what it may not read.
    """
    notes: list[str] = []
    said = " ".join(row.verdict.reason for row in bad)
    try:
        for namespace in sorted({row.ref.namespace for row in bad if row.ref.namespace})[:3]:
            names = {row.ref.name for row in bad if row.ref.namespace == namespace}
            events = kube.objects("Event", namespace, fields="type=Warning")
            for pod in view.all("Pod", namespace):
                notes += _last_words(kube, pod, names, said)
            notes += _warnings((one for one in events if _is_news(one, view, namespace, said)), names)
    except KubeError:
        pass
    return notes[:SHOWN]


def _concerns(name: str, names: Iterable[str]) -> bool:
    return any(name == wanted or name.startswith(f"{wanted}-") for wanted in names)


def _is_news(event: Mapping[str, Any], view: View, namespace: str, said: str) -> bool:
    """Not about something that is gone or going, and not what the verdict says already."""
    about = event.get("involvedObject") or {}
    kind, name, message = str(about.get("kind")), str(about.get("name")), str(event.get("message") or "")
    found = view.get(kind, namespace, name)
    if kind == "Pod" and (not found or is_terminating(found) or uid_of(found) != about.get("uid")):
        return False
    if kind == "ReplicaSet" and found and not (found.get("spec") or {}).get("replicas"):
        return False
    if event.get("reason") == "Unhealthy" and f"pod {name}: " in said:
        return False
    bare = message.replace("Error: ", "")
    return event.get("reason") != "BackOff" and bare not in IMAGE_ERRORS and bare not in said


def _warnings(events: Iterable[Mapping[str, Any]], names: Iterable[str]) -> list[str]:
    """The newest warning of each object."""
    newest: dict[str, Mapping[str, Any]] = {}
    for event in sorted(events, key=lambda one: str(one.get("lastTimestamp") or one.get("eventTime") or "")):
        about = event.get("involvedObject") or {}
        if _concerns(str(about.get("name", "")), names):
            newest[f"{about.get('kind')} {about.get('name')}"] = event
    return [f"  event of {about}: {event.get('reason')}: {event.get('message')}" for about, event in newest.items()]


def _last_words(kube: Cluster, pod: Mapping[str, Any], names: Iterable[str], said: str) -> list[str]:
    name, namespace = str(meta(pod).get("name")), str(meta(pod).get("namespace"))
    recovered = condition(pod, "Ready").get("status") == "True" and f"pod {name}," not in said
    if not _concerns(name, names) or recovered:
        return []
    lines: list[str] = []
    for container in containers(pod):
        last = (container.get("lastState") or {}).get("terminated") or {}
        now = (container.get("state") or {}).get("terminated") or {}
        ended = last or (now if now.get("exitCode") else {})
        where = namespace, name, str(container.get("name"))
        if ended and not ended.get("message"):
            log = _log_of_the_end(kube, *where)
        elif not ended and f"pod {name}: " in said and HOPELESS in said:  # a node of it has ended, and it has not
            log = kube.log_tail(*where, LOG_LINES, previous=False)
        else:
            continue
        lines += [f"  log of pod {name}, container {where[2]}: {line}" for line in telling(log)]
    return lines


def _log_of_the_end(kube: Cluster, namespace: str, pod: str, container: str) -> str:
    """Of the container that ended: the previous one, or the present one if none was started since."""
    try:
        return kube.log_tail(namespace, pod, container, LOG_LINES)
    except ApiError:
        return kube.log_tail(namespace, pod, container, LOG_LINES, previous=False)


def telling(log: str, count: int = TELLING_LINES) -> list[str]:
    """So many lines of a log that say the most of an end, in the log's order.

    Errors and exceptions come before the rest. Of what is the same each time, as the end of each node, one is enough.
    """
    lines = [line for line in (_COLOUR.sub("", line).rstrip() for line in log.splitlines()) if line.strip()]
    places = {line: number for number, line in enumerate(lines)}  # the last place of each
    alike = {_NUMBER.sub("", _NAME.sub("", line)): number for line, number in places.items()}
    errors = [number for number in alike.values() if _ERROR.search(lines[number])]
    others = [number for number in alike.values() if number not in errors]
    chosen = [*sorted(errors)[-count:], *sorted(others, reverse=True)][:count]
    return [lines[number] for number in sorted(chosen)]


# --- for the module and the action ----------------------------------------------------------------------------------


def settings_from(params: Mapping[str, Any], say: Callable[[str], None] = say_nothing) -> Settings:
    return Settings(
        timeout=float(params["timeout"]),
        grace=float(params["unschedulable_grace"]),
        fail_on_restart=bool(params["fail_on_restart"]),
        say=say,
    )


def run(params: Mapping[str, Any], kube: Cluster, settings: Settings, check_mode: bool = False) -> dict[str, Any]:
    """The module's work with the cluster handed in."""
    refs = parse_refs(params["objects"])
    return look_once(kube, refs) if check_mode else wait_for_rollout(kube, refs, settings)
