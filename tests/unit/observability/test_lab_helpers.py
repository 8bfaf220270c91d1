# SPDX-License-Identifier: GPL-3.0-or-later
"""The pure parts of the lab's tests: what counts as missing, and whose memory it is."""

from __future__ import annotations

import doctest
import json
import sys
from pathlib import Path
from types import SimpleNamespace

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "observability"))

import gaps
import memory


def test_the_examples_in_gaps() -> None:
    done = doctest.testmod(gaps)
    assert done.attempted == 4 and not done.failed


def test_pods_by_their_uid() -> None:
    def pod(uid: str, name: str, labels: dict[str, str], **annotations: str) -> SimpleNamespace:
        metadata = SimpleNamespace(uid=uid, name=name, namespace="n", labels=labels, annotations=annotations)
        return SimpleNamespace(metadata=metadata)

    seen = {"a": {"rss": 2, "own": 1, "cgroup": 3}, "b": {"rss": 5, "own": 4}, "gone": {"rss": 1}}
    held = memory.parse(
        json.dumps(seen), [pod("a", "x-5d4-abcde", {"rosops.fleet/app": "x"}), pod("b", "y-5d4-abcde", {})]
    )
    assert held == [memory.Held("n", "x-5d4-abcde", "x", 3, 2, 1), memory.Held("n", "y-5d4-abcde", "y", 0, 5, 4)]
