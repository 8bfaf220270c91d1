# SPDX-License-Identifier: GPL-3.0-or-later
"""A control loop of 1 kHz in a pod of its own on the robot, and how late its ticks come while others are updated."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Sequence
from types import TracebackType

from .cluster import ROBOT, Cluster, wait_for
from .numbers import percentile
from .plain_manifests import as_list
from .scenario import FIRST, REPOSITORY, REQUESTED
from .windows import Span

NAME = "loop"
TICKS = 1000  # a second
READY_SECONDS = 60
PROGRAM = f"""
import time
due = time.monotonic()
while True:
    began, late = time.time() + due - time.monotonic(), []
    for _tick in range({TICKS}):
        due += 1 / {TICKS}
        time.sleep(max(0.0, due - time.monotonic()))
        late.append(int((time.monotonic() - due) * 1e6))
    print(f"{{began:.4f}}", *late, flush=True)
"""
Tick = tuple[float, int]  # when it was due by the wall clock, and by how many microseconds it came late


class ControlLoop:
    """Runs for as long as it is open."""

    def __init__(self, cluster: Cluster) -> None:
        self._cluster = cluster

    def __enter__(self) -> ControlLoop:
        container = {
            "name": NAME,
            "image": f"{REPOSITORY}:{FIRST}",
            "command": ["python3", "-c", PROGRAM],
            "resources": {"requests": REQUESTED},
        }
        pod = {
            "apiVersion": "v1",
            "kind": "Pod",
            "metadata": {"name": NAME, "namespace": NAME},
            "spec": {"nodeName": ROBOT, "terminationGracePeriodSeconds": 1, "containers": [container]},
        }
        space = {"apiVersion": "v1", "kind": "Namespace", "metadata": {"name": NAME}}
        self._cluster.kubectl("apply -f -", json.dumps(as_list([space, pod])).encode())
        wait_for("the control loop", lambda: "" if self._told() else "it has told nothing", READY_SECONDS)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._cluster.kubectl(f"delete namespace {NAME}")

    def _told(self) -> str:
        return self._cluster.kubectl(f"-n {NAME} logs {NAME}", check=False)

    def ticks(self, until: float) -> list[Tick]:
        """All up to then: what it tells of a second comes when that is over."""
        found = list[Tick]()

        def missing() -> str:
            found[:] = parsed(self._told().splitlines())
            return "" if found and found[-1][0] >= until else f"nothing is told of the time from {until:.0f} on"

        wait_for("the control loop's ticks", missing, max(0.0, until - time.time()) + READY_SECONDS, interval=1.0)
        return found


def parsed(lines: Iterable[str]) -> list[Tick]:
    """A line is when its second began, and the lateness of each of its ticks.

    >>> parsed(["100.0 7 12 9"])[1:]
    [(100.002, 12), (100.003, 9)]
    """
    words = [line.split() for line in lines]
    return [
        (round(float(began) + number / TICKS, 4), int(late))
        for began, *every in words
        for number, late in enumerate(every, 1)
    ]


def lateness(ticks: Sequence[Tick], span: Span) -> dict[str, float | None]:
    """Of the ticks in the span, in microseconds."""
    late = [one for at, one in ticks if span.holds(at)]
    return {"p50_us": percentile(late, 50), "p999_us": percentile(late, 99.9), "worst_us": max(late, default=None)}
