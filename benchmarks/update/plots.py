# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plots of a run. Every one says what it was measured on."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import matplotlib as mpl

mpl.use("Agg")  # no display

from matplotlib import pyplot
from matplotlib.axes import Axes

from . import seed
from .groups import Group, groups
from .results import Results
from .verdicts import kind

COLOURS = {"plain": "#c0504d", "fleet": "#1f77b4", "seed": "#7f7f7f"}
OFFSETS = {"plain": -0.17, "fleet": 0.17}
NAMED = ("machine", "kernel", "k3s", "ros", "ansible", "collection", "date")


def draw(results: Results, about: Mapping[str, Any]) -> None:
    """Every plot that there is something for, a file per condition."""
    footer = "; ".join(str(about[key]) for key in NAMED if about.get(key))
    every = groups(results.records)
    for stress in sorted({group.stress for group in every}):
        chosen = [group for group in every if group.stress is stress]
        details = [item for item in results.details if item["stress"] is stress]
        suffix = "-stress" if stress else ""

        def save(
            name: str, title: str, fill: Callable[[Axes], bool], suffix: str = suffix, stress: bool = stress
        ) -> None:
            figure, axes = pyplot.subplots(figsize=(10, 5.5))
            if fill(axes):
                axes.set_title(f"{title}{', robot under stress' if stress else ''}")
                axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize=8)
                figure.text(0.01, 0.01, footer, fontsize=6, color="#555555", wrap=True)
                figure.tight_layout(rect=(0, 0.05, 1, 1))
                figure.savefig(results.directory / f"{name}{suffix}.png", dpi=120)
            pyplot.close(figure)

        pubsub = [group for group in chosen if kind(group) == "pubsub"]
        save("lost", "Messages published and never received, each trial", partial(_lost, pubsub))
        save("gap", "Longest gap between messages, each trial", partial(_gap, pubsub))
        save("latency", "Before and during the update, mean of the trials", partial(_latency, chosen))
        save("step", "Wall time of an update by phase, mean of the trials", partial(_phases, details))
        save("cpu", "CPU of the arm's pods, of both hosts", partial(_cpu, details))


def _cases(axes: Axes, names: Sequence[str]) -> dict[str, int]:
    places = {name: number for number, name in enumerate(dict.fromkeys(names))}
    axes.set_xticks(list(places.values()), list(places), rotation=15, ha="right", fontsize=8)
    axes.set_xlim(-0.6, len(places) - 0.4)
    return places


def _dots(axes: Axes, chosen: Sequence[Group], key: str, places: Mapping[str, int], **style: Any) -> None:
    for arm, offset in OFFSETS.items():
        points = [
            (places[group.case] + offset + 0.02 * (number % 5 - 2), value)
            for group in chosen
            if group.arm == arm
            for number, value in enumerate(group.values(key))
        ]
        if points:
            xs, ys = zip(*points, strict=True)
            axes.scatter(xs, ys, color=COLOURS[arm], label=f"{arm}{style.get('tag', '')}",
                         marker=style.get("marker", "o"), alpha=0.7)  # fmt: skip


def _lost(chosen: Sequence[Group], axes: Axes) -> bool:
    if not any(group.values("lost") for group in chosen):
        return False
    places = _cases(axes, [group.case for group in chosen])
    _dots(axes, chosen, "lost", places)
    theirs = [(places[case], lost) for case, lost in seed.LOST.items() if case in places]
    if theirs:
        xs, ys = zip(*theirs, strict=True)
        axes.scatter(xs, ys, color=COLOURS["seed"], marker="_", s=400, label="seed (of 100,000)")
    axes.set_yscale("symlog", linthresh=1)
    axes.set_ylim(bottom=-0.3)
    axes.set_ylabel("messages lost")
    return True


def _gap(chosen: Sequence[Group], axes: Axes) -> bool:
    if not any(group.values("gap_ms") for group in chosen):
        return False
    places = _cases(axes, [group.case for group in chosen])
    _dots(axes, chosen, "gap_ms", places)
    _dots(axes, chosen, "gap_control_ms", places, marker="x", tag=", no update")
    axes.set_yscale("log")
    axes.set_ylabel("ms")
    return True


def _latency(chosen: Sequence[Group], axes: Axes) -> bool:
    bars: list[tuple[str, str, float, float]] = []
    for group in chosen:
        kinds = {
            "service": ("p95_before_ms", "p95_run_ms"),
            "action": ("completion_before_ms", "completion_during_ms"),
        }
        if kind(group) in kinds:
            calm, busy = (group.mean(key) for key in kinds[kind(group)])
            if calm is not None and busy is not None:
                bars.append((group.case, group.arm, calm, busy))
    if not bars:
        return False
    present = {case for case, *_rest in bars}
    theirs = {"service/server": seed.SERVICE_P95_MS, "action/server": seed.ACTION_MS}
    bars += [(case, "seed", pair["before"], pair["during"]) for case, pair in theirs.items() if case in present]
    for number, (_case, arm, calm, busy) in enumerate(bars):
        axes.bar(number - 0.2, calm, 0.38, color=COLOURS[arm], alpha=0.45)
        axes.bar(number + 0.2, busy, 0.38, color=COLOURS[arm])
        axes.annotate(f"{busy / calm:.2f} x", (number, max(calm, busy)), ha="center", va="bottom", fontsize=8)
        axes.plot([], [], color=COLOURS[arm], label=None if arm in [item[1] for item in bars[:number]] else arm)
    axes.set_xticks(range(len(bars)), [f"{case}\n{arm}" for case, arm, *_rest in bars], fontsize=7, rotation=15)
    axes.set_ylabel("ms: p95 (service), mean completion (action); pale: before")
    return True


def _phases(details: Sequence[Mapping[str, Any]], axes: Axes) -> bool:
    kept: dict[tuple[str, str], list[Mapping[str, float]]] = {}
    for item in details:
        if item["phases"] and not item["problem"]:
            kept.setdefault((f"{item['app']}/{item['update']}", item["arm"]), []).append(item["phases"])
    if not kept:
        return False
    names = list(dict.fromkeys(name for steps in kept.values() for step in steps for name in step))
    bottoms = [0.0] * len(kept)
    for name in names:
        heights = [sum(step.get(name, 0.0) for step in steps) / len(steps) for steps in kept.values()]
        axes.bar(range(len(kept)), heights, bottom=bottoms, label=name)
        bottoms = [low + height for low, height in zip(bottoms, heights, strict=True)]
    axes.set_xticks(range(len(kept)), [f"{case}\n{arm}" for case, arm in kept], fontsize=6, rotation=30, ha="right")
    axes.set_ylabel("s")
    return True


def _cpu(details: Sequence[Mapping[str, Any]], axes: Axes) -> bool:
    drawn = False
    for arm, offset in OFFSETS.items():
        trials = {item["trial"]: item for item in details if item["arm"] == arm}
        for place, part in enumerate(("quiet", "updates")):
            known = [item[f"usage_{part}"]["pods_cpu"] for item in trials.values()]
            known = [value for value in known if value is not None]
            if known:
                label = arm if place == 0 else None
                axes.bar(place + offset, sum(known) / len(known), 0.3, color=COLOURS[arm], label=label)
                drawn = True
    axes.set_xticks([0, 1], ["without an update", "from the first update to the end"])
    axes.set_ylabel("per cent of one core")
    return drawn
