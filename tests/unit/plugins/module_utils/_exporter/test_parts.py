# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The exporter's other parts: claims' usage, /statistics, the distance of polls from scrapes, the HTTP side."""

from __future__ import annotations

import gzip
import os
import struct
import threading
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any, Iterator

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.claims import BLOCK, PERIOD, Claims, look, used
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.families import COUNTER, GAUGE, Family
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.http import Server
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.poller import too_near
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.statistics import MAX_AGE, Totals, decode

parser = pytest.importorskip("prometheus_client.openmetrics.parser")

# ---- claims


def blocks(path: Path) -> int:
    return path.lstat().st_blocks * BLOCK


def test_what_claims_hold(tmp_path: Path) -> None:
    mine = tmp_path / "pvc-1_robot-r1_data-pvc"
    (mine / "deep" / "er").mkdir(parents=True)
    one, other = mine / "a", mine / "deep" / "er" / "b"
    one.write_bytes(b"x" * 50_000)
    other.write_bytes(b"y" * 9_000)
    (mine / "same").hardlink_to(one)
    (mine / "out").symlink_to("/etc")
    (mine / "loop").symlink_to(mine)
    for name in ("pvc-2_robot-r2_data-pvc", "pvc-3_robot-r1", "lost+found", "x_robot-r1_y"):
        (tmp_path / name).mkdir()
    (tmp_path / "pvc-4_robot-r1_file").write_text("no directory")
    every = [one, other, mine / "deep", mine / "deep" / "er", mine / "out", mine / "loop"]
    assert look(str(tmp_path), "robot-r1") == {"data-pvc": sum(map(blocks, every))}


def test_names_with_underscores_are_the_claims_own(tmp_path: Path) -> None:
    (tmp_path / "pvc-1_ns_with_more").mkdir()
    assert list(look(str(tmp_path), "ns")) == ["with_more"]


def test_nothing_there(tmp_path: Path) -> None:
    assert look(str(tmp_path / "none"), "robot-r1") == {}


@pytest.mark.skipif(os.getuid() == 0, reason="root may read everything")
def test_what_may_not_be_read_is_left_out(tmp_path: Path) -> None:
    (tmp_path / "closed").mkdir(mode=0)
    assert used(str(tmp_path)) >= 0


def test_at_most_once_a_minute(tmp_path: Path) -> None:
    pauses: list[float] = []

    class Enough(Exception):  # noqa: N818 - no error
        pass

    def pause(seconds: float) -> None:
        pauses.append(seconds)
        if len(pauses) == 3:
            raise Enough

    with pytest.raises(Enough):
        Claims(str(tmp_path), "ns", pause).run()
    assert min(pauses) >= PERIOD


# ---- /statistics


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


def test_drops_add_up_and_silence_ends_a_series() -> None:
    totals = Totals()
    totals.add(statistics((0, 0), 4), 10)
    totals.add(statistics((2, 0), 3), 20)
    totals.add(statistics((3, 0), 1, "/other"), 20 + MAX_AGE)
    totals.add(b"short", 20)
    assert totals.rows(21) == [(("/other", "/pub", "/sub"), 3.0, 1), (("/t", "/pub", "/sub"), 2.0, 7)]
    assert [row[0][0] for row in totals.rows(20 + MAX_AGE)] == ["/other"]


# ---- polls and scrapes


@pytest.mark.parametrize(
    ("at", "near"), [(100.1, True), (101.4, True), (101.6, False), (105, False), (108.4, False), (108.6, True)]
)
def test_polls_keep_away_from_scrapes(at: float, near: bool) -> None:
    assert too_near(100, 110, at, 10) is near


def test_one_shift_is_enough() -> None:
    """Scrapes every ten seconds, as the polls, at whatever time: after one shift they are not near again."""
    for tenth in range(100):
        scrape, last, due, shifts = 100 + tenth / 10, 100.0, 110.0, 0
        for _round in range(5):
            if too_near(last, due, scrape, 10):
                shifts += 1
                due += 3
            while due <= scrape + 10:
                last, due = due, due + 10
            scrape += 10
        assert shifts <= 1, tenth


# ---- HTTP


FAMILIES = [
    Family("ros_master_up", GAUGE, "Whether it answers", [({}, 1.0)]),
    Family("ros_topic_messages_total", COUNTER, "Messages", [({"topic": '/a"\\\n', "node": "/n"}, 5.0)]),
    Family("ros_node_up", GAUGE, "None of them", []),
]


class Served:
    def __init__(self) -> None:
        self.scrapes, self.health = 0, True
        self.server = Server(("127.0.0.1", 0), lambda: FAMILIES, self.scraped, lambda: self.health)
        threading.Thread(target=self.server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()

    def scraped(self) -> None:
        self.scrapes += 1

    def get(self, path: str, **headers: str) -> Any:
        url = f"http://127.0.0.1:{self.server.server_address[1]}{path}"
        return urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=5)  # noqa: S310

    def code(self, path: str) -> int:
        try:
            with self.get(path) as reply:
                return int(reply.status)
        except urllib.error.HTTPError as error:
            return error.code


@pytest.fixture
def served() -> Iterator[Served]:
    made = Served()
    yield made
    made.server.shutdown()
    made.server.server_close()


def test_a_scrape(served: Served) -> None:
    with served.get("/metrics") as reply:
        kind, text = reply.headers["Content-Type"], reply.read().decode()
    assert kind.startswith("application/openmetrics-text; version=1.0.0")
    found = list(parser.text_string_to_metric_families(text))
    assert [family.name for family in found] == ["ros_master_up", "ros_topic_messages"]
    assert found[1].samples[0].labels == {"topic": '/a"\\\n', "node": "/n"}
    assert found[1].samples[0].name == "ros_topic_messages_total"
    assert served.scrapes == 1


def test_a_zipped_scrape_is_the_same(served: Served) -> None:
    with served.get("/metrics") as reply:
        plain = reply.read()
    with served.get("/metrics", **{"Accept-Encoding": "gzip"}) as reply:
        assert reply.headers["Content-Encoding"] == "gzip"
        assert gzip.decompress(reply.read()) == plain


def test_probes(served: Served) -> None:
    assert [served.code(path) for path in ("/ready", "/healthy", "/nothing")] == [200, 200, 404]
    served.health = False
    assert [served.code(path) for path in ("/ready", "/healthy")] == [200, 503]
    assert served.scrapes == 0
