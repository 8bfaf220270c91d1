# SPDX-License-Identifier: GPL-3.0-or-later
"""Wait until everything is rolled out: one watch feeds the view, every change is judged at once.

The cluster, the clock and the way to say something are handed in.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

from ...module_utils._common.documents import Result
from ...module_utils._common.errors import NotReadyError
from ...module_utils._common.poll import FAIL, PASS, WAIT, overall
from ...module_utils._step.objects import Object, is_ready, name_of
from ...module_utils._step.words import HOPELESS
from .cache import Ref, View, targets_for
from .client import Kube
from .connection import PATIENCE, ApiError
from .message import ProbeNews, Verdicts, cause_first, notes_on, progress
from .pods import REFUSED, UNSCHEDULABLE, Verdict, error_end, grace_of, restarts, running, uid_of, waits_for_probe
from .verdicts import Tracker, judge, leaving_pods, present_pods
from .watch import StreamEvent, Watch

SAY_SECONDS = 10.0  # below the idle time-outs of the tools that run playbooks
BEGUN_SECONDS = 1.0  # after that what runs has found its command
NO_PLACE = (UNSCHEDULABLE, REFUSED)  # no room on a node, or in a quota


@dataclass(frozen=True)
class WaitOptions:
    """How long to wait, and what a test replaces."""

    timeout: float = 300.0
    grace: float = 10.0
    fail_on_restart: bool = False
    watched: float = 0.0  # seconds for which all of it has to stay rolled out
    before: dict[str, dict[str, int]] = field(default_factory=dict)  # by pod uid, restarts that are none of its rollout
    begun: bool = False  # enough that the new pods run, or have no place yet; with minReadySeconds, that they are Ready
    say: Callable[[str], None] = lambda _text: None
    now: Callable[[], float] = time.monotonic
    watch: Callable[[Kube, Iterable[Ref]], Watch] = Watch


class _Wait:
    """What is known at the moment."""

    def __init__(self, refs: Sequence[Ref], options: WaitOptions) -> None:
        self.refs, self.options = refs, options
        self.view, self.tracker, self.news = View(), Tracker(options.grace), ProbeNews()
        self.well: float | None = None  # since when all of it is rolled out
        self.up: dict[str, float] = {}  # by pod uid, since when one was seen to run that is to begin
        self.unlisted = set(targets_for(refs))
        self.lost: dict[Ref, ApiError] = {}
        self.leaving: dict[str, float] = {}  # by pod uid, until when it may take to end
        self.start = self.seen = self.counted = self.gone = options.now()

    def end(self) -> float:
        """When the time is over: that of the objects begins when the API has shown them."""
        return self.start + PATIENCE if self.unlisted else self.seen + self.options.timeout

    def stayed(self, verdict: str) -> bool:
        """Whether all of it has been rolled out for as long as it has to be."""
        now = self.options.now()
        self.well = (now if self.well is None else self.well) if verdict == PASS else None
        return self.well is not None and now >= self.well + self.options.watched

    def count(self) -> None:
        """The time that old pods have for their end, before new ones come or after, is not the new ones' time."""
        now = self.options.now()
        self.seen += max(min(now, self.gone) - self.counted, 0.0)
        pods = [pod for ref in self.refs for pod in leaving_pods(ref, self.view)]
        self.gone = max([self.leaving.setdefault(uid_of(pod), now + grace_of(pod)) for pod in pods], default=now)
        self.counted = now

    def take(self, change: StreamEvent) -> None:
        target, blind = change.target, bool(self.unlisted)
        if change.what == "listed":
            self.unlisted.discard(target)
            self.lost.pop(target, None)
            self.view.replace(target.kind, target.namespace, change.objects)
        elif change.error is None:
            for obj in change.objects:
                (self.view.put if change.what == "set" else self.view.drop)(target.kind, obj)
        elif change.what == "lost":
            self.lost[target] = change.error
        elif change.error.status != 403 or target.kind != "StorageClass":
            raise change.error
        else:  # it only says why a claim is pending, so the wait can do without
            self.view.hidden.add(target.kind)
            self.unlisted.discard(target)
        if blind and not self.unlisted:
            self.seen = self.options.now()

    def look(self) -> tuple[Verdicts, str]:
        """The verdicts now, and all in one. Until every stream has listed, nothing passes: it may only be unseen."""
        now, rows = self.options.now(), {}
        for ref in self.refs:
            verdict, pods = judge(ref, self.view, self.refs), present_pods(ref, self.view)
            if self.unlisted:
                verdict = Verdict(WAIT, self.unreachable() or "is being looked up")
            elif verdict.verdict != FAIL:
                verdict = self._with_pods(pods, verdict)
                if self.options.begun and verdict.verdict == WAIT and self._have_begun(ref, pods, verdict, now):
                    verdict = replace(verdict, verdict=PASS, suspect="")
            rows[ref] = self.tracker.settle(ref, verdict, now)
        return rows, overall([one.verdict for one in rows.values()])

    def _have_begun(self, ref: Ref, pods: Sequence[Object], verdict: Verdict, now: float) -> bool:
        """Whether they run, and not only until they see that they cannot; or have no place yet.

        Those that have to be Ready for a while before the old ones go (minReadySeconds) have begun when they are.
        """
        wanted = self.view.get(ref.kind, ref.namespace, ref.name) or {}
        if (wanted.get("spec") or {}).get("minReadySeconds"):
            return any(map(is_ready, pods))
        up = [self.up.setdefault(uid_of(pod), now) for pod in pods if running(pod)]
        return verdict.suspect in NO_PLACE or any(now - since >= BEGUN_SECONDS for since in up)

    def _with_pods(self, pods: Sequence[Object], verdict: Verdict) -> Verdict:
        """The verdict with what the present pods have to add: an end with an error, and the last words of a probe."""
        for pod in pods if self.options.fail_on_restart else ():
            # a pod that was Ready when first seen had its restarts in an earlier life
            before = self.options.before.setdefault(uid_of(pod), restarts(pod) if is_ready(pod) else {})
            if ended := error_end(pod, before):
                return ended
        waiting = [pod for pod in pods if waits_for_probe(pod)]
        said = [f"pod {name_of(pod)}: {line}" for pod in waiting if (line := self.news.lines.get(uid_of(pod)))]
        if verdict.verdict == PASS or not said:
            return verdict
        if hopeless := [text for text in said if HOPELESS in text]:
            return Verdict(FAIL, hopeless[0])
        rest = [] if len(said) == len(waiting) and not verdict.suspect else [verdict.reason]
        return replace(verdict, reason="; ".join([*said[:3], *rest]))

    def starting(self) -> list[Object]:
        """The present pods of which only a probe knows why they are not ready."""
        if self.unlisted or self.lost:
            return []
        return [pod for ref in self.refs for pod in present_pods(ref, self.view) if waits_for_probe(pod)]

    def unreachable(self) -> str:
        return str(next(iter(self.lost.values()), ""))

    def elapsed(self) -> float:
        return self.options.now() - self.start


def wait_for_rollout(kube: Kube, refs: Sequence[Ref], options: WaitOptions) -> Result:
    """All rolled out: the result as data. Otherwise NotReadyError: at once when one failed, or at the time-out."""
    wait = _Wait(refs, options)
    say_at = wait.start + SAY_SECONDS
    with options.watch(kube, targets_for(refs)) as stream:
        while True:
            rows, verdict = wait.look()
            if verdict == WAIT and wait.news.ask(kube, wait.starting(), options.now()):
                rows, verdict = wait.look()
            now = options.now()
            if wait.stayed(verdict):
                return _result(rows, wait.elapsed())
            wait.count()
            over = now >= wait.end() and wait.well is None
            if over and wait.unlisted and wait.lost:
                raise next(iter(wait.lost.values()))
            if verdict == FAIL or over:
                break
            if now >= say_at:
                options.say(progress(rows, wait.elapsed(), wait.unreachable()))
                say_at += SAY_SECONDS
            ends = [say_at, wait.tracker.due(), now + BEGUN_SECONDS if wait.up else None]
            if wait.well is None:
                ends += [max(wait.end(), wait.gone), wait.news.due if wait.starting() else None]
            else:  # what is only watched has no news to tell, and no end of its time
                ends.append(wait.well + options.watched)
            for change in stream.changes(min(end for end in ends if end is not None) - now):
                wait.take(change)
    raise _not_ready(kube, wait, rows, verdict)


def look_once(kube: Kube, refs: Sequence[Ref]) -> Result:
    """The verdicts as they are now, for check mode: no wait, and nothing fails."""
    view, start = View(), time.monotonic()
    for target in targets_for(refs):
        try:
            view.replace(target.kind, target.namespace, kube.objects(target.kind, target.namespace))
        except ApiError as exc:
            if exc.status != 403:
                raise
            view.hidden.add(target.kind)
    return _result({ref: judge(ref, view, refs) for ref in refs}, time.monotonic() - start)


def _result(rows: Verdicts, elapsed: float) -> Result:
    objects = [{**ref.as_dict(), "verdict": one.verdict, "reason": one.reason} for ref, one in rows.items()]
    return {"objects": objects, "elapsed": round(elapsed, 3)}


def _not_ready(kube: Kube, wait: _Wait, rows: Verdicts, verdict: str) -> NotReadyError:
    bad = {ref: one for ref, one in rows.items() if one.verdict == (FAIL if verdict == FAIL else WAIT)}
    elapsed = wait.elapsed()
    what = "cannot be rolled out" if verdict == FAIL else f"are not rolled out after {elapsed:.0f} s"
    notes = [] if wait.unlisted or wait.lost else notes_on(kube, bad, wait.view)
    causes = [cause_first(ref, one.reason) for ref, one in bad.items()]
    lines = [*causes, *notes, f"  {len(bad)} of {len(rows)} {what}: {', '.join(map(str, bad))}"]
    if wait.unreachable() and not wait.unlisted:
        lines.append(f"  The last news is old: {wait.unreachable()}")
    return NotReadyError("\n".join(lines), **_result(rows, elapsed))
