# SPDX-License-Identifier: GPL-3.0-or-later
"""Latency and drops out of /statistics."""

from __future__ import annotations

import struct
from types import SimpleNamespace

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._exporter import statistics as statistics_of
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.statistics import MAX_AGE, Statistics, decode


def statistics(age: tuple[int, int], dropped: int, topic: str = "/t") -> bytes:
    """rosgraph_msgs/TopicStatistics, field by field."""
    texts = b"".join(struct.pack("<I", len(text)) + text.encode() for text in (topic, "/pub", "/sub"))
    return (
        texts
        + struct.pack("<4I", 1, 2, 3, 4)  # window
        + struct.pack("<3i", 100, dropped, 9000)
        + struct.pack("<6i", 0, 1, 0, 2, 0, 3)  # period
        + struct.pack("<2i", *age)
        + struct.pack("<4i", 9, 9, 9, 9)
    )


def test_a_statistics_message() -> None:
    assert decode(statistics((1, 250_000_000), 4)) == (("/t", "/pub", "/sub"), 1.25, 4)
    assert decode(statistics((-1, 900_000_000), 0))[1] == pytest.approx(-0.1)  # clocks differ


def test_drops_add_up_and_silence_ends_a_series(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [10.0]
    monkeypatch.setattr(statistics_of, "time", SimpleNamespace(monotonic=lambda: now[0]))
    totals = Statistics("http://127.0.0.1:1/", 1.0)

    def take(at: float, body: bytes, **header: str) -> None:
        now[0] = at
        totals.took(("/statistics", "/p", "http://p:1/"), header, body)

    take(10.0, statistics((0, 0), 4))
    take(20.0, statistics((2, 0), 3), type="rosgraph_msgs/TopicStatistics")
    take(20.0, statistics((9, 0), 9), type="a/B")
    take(20.0, b"short")
    take(21.0, statistics((3, 0), 1, "/other"))
    assert totals.rows() == [(("/other", "/pub", "/sub"), 3.0, 1), (("/t", "/pub", "/sub"), 2.0, 7)]
    now[0] = 20.0 + MAX_AGE
    assert [row[0][0] for row in totals.rows()] == ["/other"]
