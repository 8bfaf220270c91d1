# SPDX-License-Identifier: GPL-3.0-or-later
"""What the experiment must show, judged by its records. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from .groups import Group, by_arm, groups
from .records import Record

PASS, MISS, UNKNOWN = "PASS", "MISS", "NOT MEASURED"
P95_FACTOR, COMPLETION_FACTOR, COMPLETION_STRESSED, STEP_FACTOR = 1.3, 1.2, 1.3, 2.0
AGE_STRESSED_MS = 250.0  # "the maximum observed latency remained under 250 ms", chapter 4.2
LOSSES = {"pubsub": ("lost",), "service": ("failed",), "action": ("lost", "aborted", "twice")}
# Told apart, not judged: a persistent proxy cannot reconnect.
APART = ("service-persistent",)


@dataclass(frozen=True)
class Finding:
    """One limit, held against one group of trials."""

    limit: int
    verdict: str
    text: str


TITLES = {
    1: "pub/sub: no message lost in any trial",
    2: f"service: no request failed; p95 of the run at most {P95_FACTOR:g} x before, and not above plain's",
    3: f"action: no goal aborted, lost or executed twice; completion at most {COMPLETION_FACTOR:g} x before, "
    f"{COMPLETION_STRESSED:g} x under stress",
    4: f"fleet loses nothing where plain loses something; its step takes at most {STEP_FACTOR:g} x the time",
    5: f"pub/sub: the oldest message not above plain's, and below {AGE_STRESSED_MS:g} ms under stress",
}


def judge(records: Iterable[Record]) -> list[Finding]:
    """All bars. A limit with no record at all is not measured, never passed."""
    every = groups(records)
    fleet = [group for group in every if group.arm == "fleet" and group.app not in APART]
    findings = [
        *(_nothing(1, group) for group in fleet if kind(group) == "pubsub"),
        *(_nothing(2, group) for group in fleet if kind(group) == "service"),
        *(_factor(2, group, "p95_run_ms", "p95_before_ms", P95_FACTOR) for group in fleet if kind(group) == "service"),
        *(_nothing(3, group) for group in fleet if kind(group) == "action"),
        *(
            _factor(
                3,
                group,
                "completion_during_ms",
                "completion_before_ms",
                COMPLETION_STRESSED if group.stress else COMPLETION_FACTOR,
            )
            for group in fleet
            if kind(group) == "action"
        ),
        *(_young(group) for group in fleet if kind(group) == "pubsub" and group.stress),
        *_side_by_side(every),
    ]
    without = [limit for limit in TITLES if limit not in {finding.limit for finding in findings}]
    return sorted([*findings, *(Finding(limit, UNKNOWN, "no trial") for limit in without)], key=lambda item: item.limit)


def verdicts(findings: Iterable[Finding]) -> Mapping[int, str]:
    """Bar -> the worst that was found."""
    found: dict[int, str] = {}
    for finding in findings:
        found[finding.limit] = min(found.get(finding.limit, PASS), finding.verdict, key=(MISS, UNKNOWN, PASS).index)
    return found


def kind(group: Group) -> str:
    """pubsub, service or action."""
    return group.app.split("-")[0]


def condition(group: Group) -> str:
    """For a line of text."""
    return f"{group.case}{', under stress' if group.stress else ''}"


def _word(holds: bool | None) -> str:
    return UNKNOWN if holds is None else PASS if holds else MISS


def _nothing(limit: int, group: Group) -> Finding:
    keys = LOSSES[kind(group)]
    total = group.total(*keys)
    said = ", ".join(f"{key} {_plain(group.total(key))} (worst {_plain(group.worst(key))})" for key in keys)
    text = f"{condition(group)}: {said} of {_plain(group.total('sent'))} in {len(group.records)} trials"
    return Finding(limit, _word(_held(total, group)), text)


def _held(total: float | None, group: Group) -> bool | None:
    """Whether nothing was lost. An update that did not come to its end has proven nothing."""
    if total is None or total > 0:
        return None if total is None else False
    return True if len(group.values("step_s")) == len(group.records) else None


def _factor(limit: int, group: Group, later: str, earlier: str, most: float) -> Finding:
    ratio = group.ratio(later, earlier)
    text = f"{condition(group)}: {_plain(group.mean(earlier))} -> {_plain(group.mean(later))} ms, {_plain(ratio)} x"
    return Finding(limit, _word(None if ratio is None else ratio <= most), text)


def _side_by_side(every: Iterable[Group]) -> Iterable[Finding]:
    for arms in by_arm(every).values():
        if not {"plain", "fleet"} <= set(arms):
            continue
        plain, fleet = arms["plain"], arms["fleet"]
        if fleet.app not in APART:
            keys = LOSSES[kind(fleet)]
            theirs, ours = plain.total(*keys), fleet.total(*keys)
            holds = None if theirs is None else True if theirs == 0 else _held(ours, fleet)
            text = f"{condition(fleet)}: {' + '.join(keys)}: plain {_plain(theirs)}, fleet {_plain(ours)}"
            yield Finding(4, _word(holds), text)
        if kind(fleet) == "service" and fleet.app not in APART:
            yield _not_above(2, "p95 of the run", "p95_run_ms", plain, fleet)
        if kind(fleet) == "pubsub":
            yield _not_above(5, "oldest message", "oldest_ms", plain, fleet)
        theirs, ours = plain.step_seconds(), fleet.step_seconds()
        ratio = ours / theirs if ours is not None and theirs else None
        text = f"{condition(fleet)}: step: plain {_plain(theirs)} s, fleet {_plain(ours)} s, {_plain(ratio)} x"
        yield Finding(4, _word(None if ratio is None else ratio <= STEP_FACTOR), text)


def _not_above(limit: int, what: str, key: str, plain: Group, fleet: Group) -> Finding:
    theirs, ours = plain.mean(key), fleet.mean(key)
    text = f"{condition(fleet)}: {what}: plain {_plain(theirs)} ms, fleet {_plain(ours)} ms"
    return Finding(limit, _word(None if ours is None or theirs is None else ours <= theirs), text)


def _young(group: Group) -> Finding:
    worst = group.worst("oldest_ms")
    text = f"{condition(group)}: oldest message of all trials: {_plain(worst)} ms"
    return Finding(5, _word(None if worst is None else worst < AGE_STRESSED_MS), text)


def _plain(value: float | None) -> str:
    if value is None:
        return "?"
    return f"{value:.0f}" if float(value).is_integer() else f"{value:.2f}"
