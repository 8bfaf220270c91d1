# SPDX-License-Identifier: GPL-3.0-or-later
"""One case of one round: its logs and its step -> its record and what else is worth keeping. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from . import goals, messages, requests
from .jsonlog import Lines
from .records import Record, record
from .scenario import RATE, Case
from .series import series
from .step import Step
from .windows import Span, after_start, around, before

GUARD = 1.0  # seconds on either side of an update that still count as it: logs are written once a second
ACTION_SECONDS = 30.0
COUNT = 10_000  # messages that are looked at in each update
Logs = Mapping[str, Mapping[str, Lines]]


@dataclass(frozen=True)
class Round:
    """What the cases of a round have in common."""

    arm: str
    stress: bool
    trial: int
    count: int  # messages that a case's span has
    quiet: Span  # the round's beginning, without an update
    whole: Span


@dataclass(frozen=True)
class Measured:
    """A case's record, and beside it what the record has no key for."""

    record: Record
    details: dict[str, Any]


def measure(case: Case, step: Step, logs: Logs, this: Round) -> Measured:
    """The case's figures."""
    named = {"app": case.app, "update": case.update, "arm": this.arm, "stress": this.stress, "trial": this.trial}
    ended_well = not step.problem
    timed = {
        "step_s": step.seconds if ended_well else None,
        "busy_wait_s": step.busy_wait if ended_well else None,
        "run_s": step.run.seconds,
    }
    kind = case.app.split("-")[0]
    values, details = {"pubsub": _pubsub, "service": _service, "action": _action}[kind](case, step, logs, this)
    return Measured(
        record({**named, **timed, **values}),
        {
            **named,
            "problem": step.problem,
            "outcome": step.outcome,
            "update_span": _rounded(step.span),
            "run_span": _rounded(step.run),
            "phases": dict(step.phases),
            **details,
        },
    )


def _rounded(span: Span) -> list[float]:
    return [round(span.start, 3), round(span.end, 3)]


def _guarded(span: Span) -> Span:
    return Span(span.start - GUARD, span.end + GUARD)


def _lines(logs: Logs, app: str) -> Lines:
    """All records of an app; its log is one file."""
    return [line for file in logs.get(app, {}).values() for line in file]


def _pubsub(case: Case, step: Step, logs: Logs, this: Round) -> tuple[dict[str, Any], dict[str, Any]]:
    published, received = _lines(logs, case.source.name), _lines(logs, case.sink.name)
    update, run = _guarded(step.span), _guarded(step.run)
    control = before(this.quiet, update.seconds)
    span = around(run, this.count / RATE, this.whole.start)
    account = messages.messages(published, received, span, RATE)
    within = messages.messages(published, received, update, RATE)
    aside = messages.messages(published, received, control, RATE)
    values = {
        **messages.as_fields(account),
        **messages.order(received, run, RATE),
        "gap_ms": messages.gap_ms(received, run, RATE),
        "gap_control_ms": messages.gap_ms(received, control, RATE),
        "oldest_ms": messages.oldest_age_ms(received, update),
        "oldest_run_ms": messages.oldest_age_ms(received, run),
        "oldest_control_ms": messages.oldest_age_ms(received, control),
    }
    return values, {
        "lost": account.lost if account else None,
        "dropped_by_queues": messages.dropped_by_queues(received, span),
        "not_sent": account.not_sent if account else None,
        "lost_ranges": account.lost_ranges if account else None,
        "lost_during": within.lost if within else None,
        "lost_control": aside.lost if aside else None,
        "control_s": round(control.seconds, 3),
        "series": series(
            ((line["time"], line["longest_gap_ms"]) for line in received if line.get("longest_gap_ms") is not None),
            step.run,
        ),
        "subscriber_processes": messages.processes(received),
        "publisher_skipped": max((int(line.get("skipped") or 0) for line in published), default=None),
    }


def _service(case: Case, step: Step, logs: Logs, this: Round) -> tuple[dict[str, Any], dict[str, Any]]:
    asked = _lines(logs, case.sink.name)
    account = requests.requests(asked, Span(this.quiet.start, this.whole.end))
    update = _guarded(step.span)
    control = before(this.quiet, update.seconds)
    calm, whole = requests.latency_ms(asked, control), requests.latency_ms(asked, step.run)
    values = {
        "sent": account.sent if account else None,
        "failed": account.failed if account else None,
        **{f"p{share}_before_ms": calm[share] for share in requests.SHARES},
        "p95_step_ms": requests.latency_ms(asked, update)[95],
        **{f"p{share}_run_ms": whole[share] for share in requests.SHARES},
    }
    return values, {
        "control_s": round(control.seconds, 3),
        "series": series(((line["time"], line["latency_ms"]) for line in asked if "request" in line and line.get("ok")),
                         step.run),
        "wrong": account.wrong if account else None,
        "operations": list(account.operations) if account else None,
    }  # fmt: skip


def _action(case: Case, step: Step, logs: Logs, this: Round) -> tuple[dict[str, Any], dict[str, Any]]:
    span = after_start(step.run, ACTION_SECONDS)
    calm = before(this.quiet, span.seconds)
    client, server = _lines(logs, case.sink.name), _lines(logs, case.source.name)
    account = goals.goals(client, server, Span(this.quiet.start, this.whole.end))
    values = {
        "sent": account.sent if account else None,
        "lost": account.lost if account else None,
        "aborted": account.aborted if account else None,
        "twice": account.twice if account else None,
        "completion_before_ms": goals.completion_ms(client, calm),
        "completion_during_ms": goals.completion_ms(client, span),
        "completion_longest_ms": goals.longest_ms(client, span),
    }
    return values, {
        "control_s": round(calm.seconds, 3),
        "series": series(
            (
                (line["sent"], line["completion_ms"])
                for line in client
                if line.get("outcome") == goals.SUCCEEDED and line.get("completion_ms") is not None
            ),
            span,
        ),
    }
