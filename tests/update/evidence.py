# SPDX-License-Identifier: GPL-3.0-or-later
"""What the apps noticed of an update: their own accounts of a stretch of time -> what was lost or failed. Pure."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from rosops_apps import goals, sequence

STATS, PUBLISHED = "temperature-stats.jsonl", "temperature-published.jsonl"
REQUESTS, GOALS = "add-two-ints.jsonl", "prime-factors.jsonl"
SERVER = "prime-factors-server-"
SUCCEEDED, ABANDONED = "succeeded", "abandoned"

Records = Sequence[dict[str, Any]]
Logs = Mapping[str, Records]  # by the file's name; of several files of one name all lines


@dataclass(repr=False)
class Losses:
    """One robot's account of a stretch of time."""

    messages: int = 0
    lost: int = 0
    given_up: int = 0  # the sensor itself stalled (a busy machine) and says so
    duplicates: int = 0
    gap_ms: float = 0.0
    oldest_ms: float = 0.0  # age of a message when it came
    requests: int = 0
    answer_ms: float = 0.0
    p95_ms: float = 0.0
    failed: list[str] = field(default_factory=list)
    goals: int = 0
    goal_ms: float = 0.0
    unsuccessful: list[str] = field(default_factory=list)
    twice: list[str] = field(default_factory=list)
    abandoned: int = 0  # by the client itself, when it was stopped

    @property
    def nothing(self) -> bool:
        """No message lost, no request failed, no goal lost, aborted or executed twice."""
        return not (self.lost or self.failed or self.unsuccessful or self.twice)

    def __repr__(self) -> str:
        said = (
            f"{self.messages} messages, {self.lost} lost, {self.duplicates} duplicates, "
            f"longest gap {self.gap_ms:.0f} ms, oldest {self.oldest_ms:.0f} ms; "
            f"{self.requests} requests, {len(self.failed)} failed, p95 {self.p95_ms:.0f} ms, "
            f"longest {self.answer_ms:.0f} ms; {self.goals} goals, {len(self.unsuccessful)} not succeeded, "
            f"{len(self.twice)} executed twice, longest {self.goal_ms:.0f} ms"
        )
        said += f"; the sensor itself gave up {self.given_up} readings" if self.given_up else ""
        said += f"; {self.abandoned} goals given up by their client" if self.abandoned else ""
        details = [*dict.fromkeys(self.failed), *self.unsuccessful, *self.twice]
        return said + (f" ({'; '.join(details[:5])})" if details else "")


def losses(logs: Logs, since: float, until: float) -> Losses:
    """What one robot's apps noticed between two times (seconds since 1970)."""
    found = Losses()
    within = {name: [line for line in lines if since <= line["time"] <= until] for name, lines in logs.items()}
    stats = within.get(STATS, [])
    holes = sequence.holes(_ranges(stats))
    missing = sum(last - first + 1 for first, last in holes)
    found.given_up = _common(holes, given_up(within.get(PUBLISHED, [])))
    found.lost = missing - found.given_up
    found.messages = sum(last - first + 1 for first, last in sequence.join_ranges(_ranges(stats)))
    found.duplicates = _grown(stats, "duplicates")
    found.gap_ms = max((line["longest_gap_ms"] for line in stats), default=0.0)
    found.oldest_ms = max((line["oldest_age_ms"] for line in stats), default=0.0)
    requests = within.get(REQUESTS, [])
    found.requests = len(requests)
    answers = sorted(line["latency_ms"] for line in requests)
    found.answer_ms = max(answers, default=0.0)
    found.p95_ms = answers[len(answers) * 95 // 100] if answers else 0.0
    found.failed = [_failure(line, since) for line in requests if not line["ok"]]
    ended = within.get(GOALS, [])
    found.goals = len(ended)
    found.goal_ms = max((line["completion_ms"] for line in ended if line["outcome"] == SUCCEEDED), default=0.0)
    found.abandoned = sum(line["outcome"] == ABANDONED for line in ended)
    found.unsuccessful = [
        f"goal {line['goal']}: {line['outcome']}, {line['wrong']} wrong"
        for line in ended
        if line["outcome"] not in (SUCCEEDED, ABANDONED) or line["wrong"]
    ]
    # over all of the time: a goal may have been started for the first time before it
    servers = [line for name, lines in logs.items() if name.startswith(SERVER) for line in lines]
    recent = {line["goal"] for line in servers if since <= line["time"] <= until}
    found.twice = [f"goal {goal} executed twice" for goal in goals.executed_twice(servers) if goal in recent]
    return found


def given_up(published: Records) -> list[list[int]]:
    """The ranges of numbers that a sensor says it skipped, because it could not keep up."""
    spans: list[list[int]] = []
    before: dict[str, Mapping[str, Any]] = {}
    for line in published:
        earlier = before.get(line["node"])
        before[line["node"]] = line
        if earlier is not None and line["skipped"] > earlier["skipped"]:
            spans += sequence.holes([*earlier["ranges"][-1:], *line["ranges"]])
    return sequence.join_ranges(spans)


def newest(lines: Records, key: str = "time") -> float:
    """The latest time in the lines; 0 without any."""
    return max((float(line.get(key, 0)) for line in lines), default=0.0)


def parse(text: str) -> list[dict[str, Any]]:
    """Lines of JSON; a line that was torn or cut off is passed over, as the apps themselves do."""
    found = []
    for line in text.splitlines():
        try:
            record = json.loads(line)
        except ValueError:
            continue
        if isinstance(record, dict) and "time" in record:
            found.append(record)
    return found


def _failure(request: Mapping[str, Any], since: float) -> str:
    """Why, and when: what came of it is often told by what was going on then."""
    error = request.get("error", f"wrong answer {request.get('sum')}")
    return f"{error} after {request['latency_ms']:.0f} ms, asked {request['time'] - since:.1f} s in"


def _ranges(lines: Records) -> list[list[int]]:
    return [list(part) for line in lines for part in line["ranges"]]


def _common(some: Iterable[Sequence[int]], others: Sequence[Sequence[int]]) -> int:
    """How many numbers lie in a range of both."""
    pairs = ((max(a[0], b[0]), min(a[1], b[1])) for a in some for b in others)
    return sum(last - first + 1 for first, last in pairs if last >= first)


def _grown(lines: Records, key: str) -> int:
    """By how much a process's own count grew, summed over the processes."""
    counts: dict[str, list[int]] = {}
    for line in lines:
        counts.setdefault(line["node"], []).append(line[key])
    return sum(max(values) - min(values) for values in counts.values())
