# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/benchmarks.md and its pictures, out of what is committed beside the trials and nothing else."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from lab_environment import CHECKOUT
from published import Table, published

from .measure import ACTION_SECONDS, COUNT
from .pictures import KINDS, pictures
from .scenario import ARMS, PUBLISHED, RATE, of_arm
from .tables import loop_table, loss_table, markdown, number, phase_table, success, tables, theirs, usage_table
from .trials import TRIALS, Trials
from .verdicts import MISS, PASS, TITLES, UNKNOWN, judge, verdicts

PAGE = CHECKOUT / "docs" / "benchmarks.md"
REST = TRIALS.with_name("at_rest.json")
TRIED = TRIALS.with_name("tried.md")
LOOP = TRIALS.with_name("loop.jsonl")  # trials with a control loop beside, whose figures are its alone
PICTURES = CHECKOUT / "docs" / "benchmarks"
ABOUT = ("machine", "kernel", "system", "hosts", "k3s", "containerd", "ros", "ansible", "collection", "date")

HEAD = """# Benchmarks

<!-- Written by `make bench-docs` from benchmarks/update/results/trials.jsonl: change those, not this page. -->

The dissertation's experiment on real ROS 1 nodes in the lab's cluster: the same applications are updated by plain
Kubernetes (`kubectl apply` and its rolling update, readiness by a file, as the dissertation has it) and by
`playbooks/update.yml`, in turn, trial after trial, quiet and with stress-ng at 80 % of the robot's CPU and memory.
A sensor publishes at 500 Hz; a service is asked 20 times a second; goals of an action take about 220 ms of work.
The robot runs the apps of the one case that is measured, and its one core is not full.

* `pubsub/minor`: another tag of the subscriber. `pubsub/major`: another library with it. `pubsub/simultaneous`:
  publisher and subscriber at once. `pubsub-roscpp-queue10`: the same in C++ with a publisher's queue of 10.
* `service/server`: an adder becomes a subtracter. `action/server`: a server of prime factors.
* `pubsub-twelve`: twelve apps in one step; one pair of them is measured.
"""

FIGURES = f"""## Figures

Means over the trials of each trial's own figure, in brackets the worst trial's. `ended`: how many of the
updates came to their end. The rows `seed` are the dissertation's, on its own machine. A dash is not measured.

Two spans are told apart, for both arms by the same rule. The **run** is from the command to its end, which is
what whoever gives it waits for. The **step** is the part in which pods change: for plain all of its run, for
fleet about half, as Ansible starts, looks at host and graph, and reports. `before` and `control` are as long as
the step, in the round's quiet beginning.

* A trial looks at about {COUNT:,} messages of an update, or at all of a longer run. So the dissertation's
  100,000 are ten trials of ours; no trial of 100,000 has been made.
* `oldest` is the age of the oldest message when it came. What is lost has no age.
* `twice` is how long two versions were at work side by side: messages that came a second time, by the rate of
  {RATE:g}/s. A subscriber gets them twice; the demo's drops the second.
* `ran back` counts messages older than the one before, as two publishers that overlap make them. The first ten
  trials did not count them, and the programs in C++ do not.
* A sensor in C++ that was held up for more than 10 ms gives up the readings of that time, as they would push out
  what waits in its queue of 10. Such a reading counts as lost where the new process had sent it before anybody was
  connected, and as never published where no other process had it.
* Completion and the longest goal are of those sent within {ACTION_SECONDS:g} s from the command, or until 5 s
  after its end if that is later. `fleet-no-hold` is fleet with `ros_master_goal_forwarding: false`.
* `plain-before` and `fleet-before` are trials of versions before, made on other days. In nearly all of them the
  robot ran the apps of all cases at once, 28 on one core, and the hosts used 65 to 191 % of the two cores before
  any update. Nothing above is judged by them.
* `release-before` is fleet with the playbooks of an earlier commit, which `collection` above names. Its rounds are
  those of plain and fleet, on hosts of their own, and most of them on another day: the figures before an update tell
  how quick the machine was. Its requests that failed were look-ups of the master that were refused, as they are by
  what earlier looks left in the kernel; versions since then leave nothing there.
"""

LOOPS = """## A control loop beside an update

A pod of its own on the robot ticks 1,000 times a second, in Python and without a priority of its own; the table tells
how late its ticks came, in microseconds: means over the trials."""

AGAIN = """## Run it again

<!-- not run: hours, and each needs a lab -->

    make bench                      # goes on where the last run was cut off; a lab of its own, removed at the end
    make bench MINUTES=30           # begins no trial that would not be over by then
    make bench BENCH="--cases pubsub/minor --data /tmp/mine.jsonl"
    make bench BENCH="--arms fleet-no-hold --cases action/server"   # goals are not held
    make bench BENCH="--before ../earlier --trials 3"   # release-before: another checkout's playbooks
    make bench BENCH="--loop --data benchmarks/update/results/loop.jsonl --trials 2 --stress no"
    make bench-docs                 # this page and its pictures out of the trials
    make bench-probe BENCH=--publish   # what ours costs a robot at rest, per part
    make bench-fleet BENCH=--publish   # what the engine costs per robot
    make bench-look BENCH=--publish    # what a look at a large graph costs
    make bench-site BENCH="--robots 10 --hertz 20 --publish"   # the playbooks with ten robots

What a round gave is one line in `benchmarks/update/results/trials.jsonl`; a round that is there is not made again.
Take lines away to have them measured anew. Logs and counters of a run stay in `benchmarks/results/`, which is not
in the repository. The robot's container has cores of its own; the control node and the edge host have the others.
"""


def text(
    trials: Trials, rest: Mapping[str, Any] | None = None, more: Iterable[Table] = (), beside: Trials | None = None
) -> str:
    """The page; `rest` is the result of `make bench-probe`, `more` what other benchmarks have published; `beside` are
    trials with a control loop."""
    if not trials.all:
        parts = ["No trial has been made yet. The dissertation's own figures, which ours will stand beside:", theirs()]
    else:
        parts = [
            *_measured(trials),
            "## What it must show\n\nThe worst trial counts where something was lost, and for the age under stress; "
            "the rest are means.",
            _bars(trials),
            FIGURES.rstrip(),
            _not_measured(trials),
            tables(trials.records),
            "## Where messages went",
            loss_table(trials.details),
            "## Where the time goes\n\nSeconds by phase.",
            phase_table(trials.details),
            TRIED.read_text(encoding="utf-8").rstrip(),
            "## CPU and memory",
            usage_table(trials.details),
        ]
    return "\n\n".join(
        [
            HEAD.rstrip(),
            *parts,
            *([LOOPS, loop_table(beside.details)] if beside and beside.all else []),
            *([at_rest(rest)] if rest else []),
            *map(section, more),
            _pictures(),
            AGAIN,
        ]
    )


def _measured(trials: Trials) -> list[str]:
    """A run may have gone on elsewhere, or with other code: all of it is said."""
    counts = Counter((trial.arm, trial.stress) for trial in {one.which: one for one in trials.all}.values())
    lines = [f"* {key}: {said}" for key in ABOUT if (said := _said(trials, key))]
    made = "; ".join(f"{arm}, {'under stress' if stress else 'quiet'}: {many}"
                     for (arm, stress), many in sorted(counts.items()))  # fmt: skip
    return ["## What was measured, on what", "\n".join([*lines, f"* trials: {made}"])]


def _said(trials: Trials, key: str) -> str:
    """What the trials were measured on; where that is not the same for all of them, with their arms."""
    arms: dict[str, dict[str, None]] = {}
    for trial in trials.all:
        if value := str(trial.about.get(key) or ""):
            arms.setdefault(value, {})[trial.arm] = None
    return "; ".join(value if len(arms) == 1 else f"{value} ({', '.join(of)})" for value, of in arms.items())


def _bars(trials: Trials) -> str:
    findings = judge(trials.records)
    worst = verdicts(findings)
    lines = []
    for limit, title in TITLES.items():
        lines.append(f"{limit}. **{worst[limit]}** {title}")
        lines += [
            f"   * {item.verdict}: {item.text}" for item in findings if item.limit == limit and item.verdict != PASS
        ]
    failed = [f"* {item['app']}/{item['update']}, {item['arm']}, trial {item['trial']}: "
              f"{item['problem'].splitlines()[0].rstrip(':')}"
              for item in trials.details if item.get("problem")]  # fmt: skip
    ended = (
        f"Updates that came to their end (deployment success, the dissertation's table 1): {success(trials.records)}."
    )
    return "\n".join([*lines, "", f"{ended} Not so:", "", *(failed or ["* none"])])


def _not_measured(trials: Trials) -> str:
    """What is published and in no trial: it is said, not left out."""
    there = {(item["arm"], bool(item["stress"]), f"{item['app']}/{item['update']}") for item in trials.records}
    wanted = [
        (arm, stress, case) for arm in ARMS for stress in (False, True) for case in PUBLISHED if of_arm(arm, case)
    ]
    missing: dict[str, list[str]] = {}
    for arm, stress, case in wanted:
        if (arm, stress, case) not in there:
            missing.setdefault(case, []).append(f"{arm}{' under stress' if stress else ''}")
    lines = [f"* {UNKNOWN}: {case}: {', '.join(arms)}" for case, arms in missing.items()]
    return "\n".join(["In no trial:", "", *(lines or ["* none"])])


def at_rest(found: Mapping[str, Any]) -> str:
    """What `make bench-probe` found."""
    rows = [
        [
            row["part"] + ("" if row["ours"] else " (not in the sum)"),
            f"{row['cpu']:.2f}",
            number(row["rss_mb"] or None, 1),
        ]
        for row in found["rest"]
    ]
    rows.append(["ours together", f"{found['cpu']:.2f}", number(found["rss_mb"], 1)])
    where = f"{found['cores']} cores ({found['machine']}, {found['python']})"
    return f"""## A robot at rest

With ten apps, on {where}; thousandths of one core. Nobody runs anything.

{markdown(["part", "1/1000 of a core", "MB"], rows)}

Asking the master by a new Python every two seconds, as it was done before, takes {found["earlier"]}/1000 of this
core, and took {found["earlier_elsewhere"]:g}/1000 of a slow one. On that one ours together is at most
{found["cpu_slow"]}/1000, where {found["limit"]:g} and {found["limit_mb"]:g} MB are allowed:
**{PASS if found["passed"] else MISS}**."""


def section(table: Table) -> str:
    """What another benchmark has published."""
    return f"## {table.title}\n\n{table.about}\n\n{markdown(table.heads, table.rows)}"


def _pictures() -> str:
    lines = ["## Pictures"]
    for name, what in KINDS.values():
        for suffix, words in (("", ""), ("-stress", ", under stress")):
            for kind, said in (("time", "over the time of a run"), ("distribution", "distribution")):
                lines.append(f"![{what} {said}{words}](benchmarks/{name}-{kind}{suffix}.svg)")
    return "\n\n".join(lines)


def files(path: Path = TRIALS) -> dict[Path, str]:
    """Every file that the trials give."""
    trials = Trials(path)
    rest = json.loads(REST.read_text(encoding="utf-8")) if REST.exists() else None
    return {
        PAGE: text(trials, rest, published(), Trials(LOOP)),
        **{PICTURES / name: content for name, content in pictures(trials.details).items()},
    }


def main() -> int:
    for path, content in files().items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content, encoding="utf-8")
    return 0
