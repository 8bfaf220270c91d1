# SPDX-License-Identifier: GPL-3.0-or-later
"""The metrics against a real master and real nodes."""

from __future__ import annotations

import time
import xmlrpc.client
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from exporter_scene import ExporterScene, Metrics
from scene import until

TOLERANCE = 0.02
BUSY_TOLERANCE = 0.05  # between scrapes a second apart, on a machine that may be busy


@pytest.fixture
def scene(tmp_path: Path) -> Iterator[ExporterScene]:
    made = ExporterScene(tmp_path)
    made.start_master()
    try:
        yield made
    finally:
        made.end()


def messages(found: Metrics, topic: str, node: str, direction: str = "out") -> float:
    return found("ros_topic_messages_total", topic=topic, node=node, direction=direction)


def between_polls(scene: ExporterScene, first: Metrics, last: Metrics, node: str) -> tuple[float, float]:
    """Messages per second by the exporter, and by the publisher's own count, between the polls of two scrapes."""
    name = "ros_exporter_last_poll_timestamp_seconds"
    began, ended = first(name), last(name)
    ours = messages(last, "/fast", node) - messages(first, "/fast", node)
    theirs = scene.published(node, ended) - scene.published(node, began)
    return ours / (ended - began), theirs / (ended - began)


def system_state(scene: ExporterScene) -> Any:
    master: Any = xmlrpc.client.ServerProxy(scene.uri)
    return master.getSystemState("/tester")[2]


def peers(scene: ExporterScene, node: str) -> set[str]:
    master: Any = xmlrpc.client.ServerProxy(scene.uri)
    slave: Any = xmlrpc.client.ServerProxy(master.lookupNode("/tester", node)[2])
    return {row[1] for row in slave.getBusInfo("/tester")[2]}


def test_the_rate_of_a_fast_topic_with_two_subscribers_and_none_of_our_own(scene: ExporterScene) -> None:
    scene.start("counted", "/talker")
    scene.until_registered("/talker")
    scene.start("listener", "/listener_1", "/fast")
    scene.start("listener", "/listener_2", "/fast")
    until("both", lambda: all(scene.log(f"/listener_{i}")[-1]["count"] > 100 for i in (1, 2)))
    before = system_state(scene)
    scene.start_exporter(timeout=5)
    connections = {"topic": "/fast", "node": "/talker", "direction": "out"}
    scene.until("two connections", "ros_topic_connections", 2, **connections)
    scrapes, met = [], set()
    began = time.monotonic()
    for number in range(24):  # as Prometheus does: at an interval, with whatever the last poll found
        time.sleep(max(0.0, began + number - time.monotonic()))
        scrapes.append(scene.scrape())
        met |= peers(scene, "/talker")
    first, last = scrapes[3], scrapes[-1]
    ours, theirs = between_polls(scene, first, last, "/talker")
    seconds = last.at - first.at
    scraped = (messages(last, "/fast", "/talker") - messages(first, "/fast", "/talker")) / seconds
    heard = messages(last, "/fast", "/listener_1", "in") - messages(first, "/fast", "/listener_1", "in")
    name = "ros_exporter_last_poll_timestamp_seconds"
    print("\nage at each scrape:", *(f"{found.at - found(name):.2f}" for found in scrapes))
    print(f"500 Hz: {ours:.1f}/s counted, {scraped:.1f}/s as scraped, {theirs:.1f}/s by the publisher")
    assert ours == pytest.approx(theirs, rel=TOLERANCE)
    assert scraped == pytest.approx(theirs, rel=BUSY_TOLERANCE)
    assert heard / seconds == pytest.approx(theirs, rel=BUSY_TOLERANCE)
    assert last("ros_topic_publishers", topic="/fast") == 1
    assert last("ros_topic_subscribers", topic="/fast") == 2
    sent = last("ros_topic_bytes_total", **connections) - first("ros_topic_bytes_total", **connections)
    assert sent / seconds == pytest.approx(2 * 12 * theirs, rel=BUSY_TOLERANCE)  # to two, eight bytes and their length
    # it measured all the time, and nobody could tell
    assert system_state(scene) == before
    assert met == {"/listener_1", "/listener_2"}
    assert {value for _labels, value in last.all("ros_exporter_scrape_errors_total")} == {0.0}
