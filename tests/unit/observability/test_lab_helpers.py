# SPDX-License-Identifier: GPL-3.0-or-later
"""The pure parts of the lab's tests: what counts as missing, and whose memory it is."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import SimpleNamespace

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "observability"))

import gaps
import memory


def test_numbers_of_two_runs() -> None:
    lines = [f"run=1.0 number={number}" for number in (1, 2, 4, 4)] + ["run=2.0 number=1", "no number"]
    assert gaps.numbers(lines) == {"1.0": gaps.Numbers(1, 4, 1, 1), "2.0": gaps.Numbers(1, 1, 0, 0)}


def test_holes_and_how_many_samples_they_are() -> None:
    assert gaps.holes([10, 20, 30, 40], 10, 10, 45) == []
    found = gaps.holes([10, 20, 60, 70], 10, 10, 100)
    assert found == [gaps.Hole(20, 60), gaps.Hole(70, 100)]
    assert gaps.missed(found, 10) == 5
    assert gaps.holes([], 10, 0, 50) == [gaps.Hole(0, 50)]


def test_pods_by_their_uid() -> None:
    def pod(uid: str, name: str, labels: dict[str, str], **annotations: str) -> SimpleNamespace:
        metadata = SimpleNamespace(uid=uid, name=name, namespace="n", labels=labels, annotations=annotations)
        return SimpleNamespace(metadata=metadata)

    seen = {"a": {"rss": 2, "own": 1, "cgroup": 3}, "b": {"rss": 5, "own": 4}, "gone": {"rss": 1}}
    held = memory.parse(
        json.dumps(seen), [pod("a", "x-5d4-abcde", {"rosops.fleet/app": "x"}), pod("b", "y-5d4-abcde", {})]
    )
    assert held == [memory.Held("n", "x-5d4-abcde", "x", 3, 2, 1), memory.Held("n", "y-5d4-abcde", "y", 0, 5, 4)]
