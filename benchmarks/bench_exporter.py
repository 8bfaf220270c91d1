# SPDX-License-Identifier: GPL-3.0-or-later
"""What the ROS exporter costs beside 20 real rospy nodes, and how exact its rate of a 500 Hz topic is.

    python benchmarks/bench_exporter.py

Needs Debian's ROS 1 packages on this machine. CPU time, not wall time: it is what the exporter takes from a robot, and
it hardly depends on what else runs. It polls and is scraped every 10 s, as in a cluster. The last line printed is
the result as JSON; the exit status is 1 where a limit is missed.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import tempfile
import time
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[1]
sys.path[:0] = [
    str(CHECKOUT / ".ansible" / "collections"),
    *(str(CHECKOUT / "tests" / name) for name in ("ros", "tools")),
]

from exporter_scene import ExporterScene, Metrics, zipped_scrape  # noqa: E402 - found through the lines above
from process_memory import cpu_seconds  # noqa: E402
from scene import until  # noqa: E402

SHARE, RSS_MB, EXACT = 0.02, 30.0, 0.02
INTERVAL = 10.0
PAIRS = 7  # publisher and subscriber each; with more subscribers, a service, an action and its client: 20 nodes


def start(scene: ExporterScene) -> list[str]:
    """The master and 20 nodes."""
    scene.start_master()
    scene.start("counted", "/talker_0", "/fast", "500")
    scene.start("listener", "/listener_0", "/fast")
    scene.start("listener", "/second", "/fast")
    names = ["/talker_0", "/listener_0", "/second", "/helper", "/worker", "/boss"]
    for number in range(1, PAIRS):
        scene.start("counted", f"/talker_{number}", f"/topic_{number}", "10")
        scene.start("listener", f"/listener_{number}", f"/topic_{number}")
        names += [f"/talker_{number}", f"/listener_{number}"]
    scene.start("listener", "/third", "/topic_1")
    scene.start("listener", "/fourth", "/topic_2")
    scene.start("service", "/helper")
    scene.start("server", "/worker")
    scene.start("client", "/boss", "/work", "1", "1000")
    return [*names, "/third", "/fourth"]


def rss_mb(pid: int, field: str = "VmRSS") -> float:
    status = Path(f"/proc/{pid}/status").read_text()
    return round(next(int(line.split()[1]) for line in status.splitlines() if line.startswith(field)) / 1024, 1)


def rates(scene: ExporterScene, first: Metrics, last: Metrics) -> tuple[float, float]:
    """Messages per second between two polls, by the exporter and by the publisher."""
    began, ended = (found("ros_exporter_last_poll_timestamp_seconds") for found in (first, last))
    counts = [
        found("ros_topic_messages_total", topic="/fast", node="/talker_0", direction="out") for found in (first, last)
    ]
    own = scene.published("/talker_0", ended) - scene.published("/talker_0", began)
    return (counts[1] - counts[0]) / (ended - began), own / (ended - began)


def measure(scene: ExporterScene, seconds: float) -> dict[str, float]:
    names = start(scene)
    until("20 nodes", lambda: set(names) <= set(scene.registered()), 120)
    process = scene.start_exporter(interval=INTERVAL, timeout=5.0)
    until("all of them up", lambda: sum(value for _l, value in scene.scrape().all("ros_node_up")) == len(names), 90)
    time.sleep(INTERVAL)
    first, began, used = scene.scrape(), time.monotonic(), cpu_seconds(process.pid)
    sizes = []
    while time.monotonic() - began < seconds:
        time.sleep(INTERVAL)
        sizes.append(zipped_scrape(scene))
    share = (cpu_seconds(process.pid) - used) / (time.monotonic() - began)
    last = scene.scrape()
    time.sleep(0.5)
    ours, theirs = rates(scene, first, last)
    return {
        "nodes": len(names),
        "seconds": round(time.monotonic() - began, 1),
        "share": share,
        "rss_mb": rss_mb(process.pid),
        "rss_peak_mb": rss_mb(process.pid, "VmHWM"),
        "series": len(last.samples),
        "scrape_bytes_zipped": max(sizes),
        "poll_seconds": last("ros_exporter_poll_duration_seconds"),
        "rate": ours,
        "publishers_own": theirs,
        "errors": sum(value for _labels, value in last.all("ros_exporter_scrape_errors_total")),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=120, help="how long to measure")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as directory:
        scene = ExporterScene(Path(directory))
        try:
            found = measure(scene, arguments.seconds)
        finally:
            scene.end()
    off = abs(found["rate"] / found["publishers_own"] - 1)
    load = os.getloadavg()[0]
    print(f"{found['nodes']} nodes, {found['series']} series, {found['seconds']:.0f} s, load {load:.1f}")
    print(f"CPU     {found['share']:.2%} of a core (limit {SHARE:.0%})")
    print(f"memory  {found['rss_mb']} MB, at most {found['rss_peak_mb']} MB (limit {RSS_MB:g} MB)")
    by_both = f"{found['rate']:.1f}/s, {found['publishers_own']:.1f}/s by the publisher"
    print(f"500 Hz  {by_both}: {off:.2%} (limit {EXACT:.0%})")
    print(f"a poll takes {found['poll_seconds']:.2f} s, a scrape has {found['scrape_bytes_zipped']} bytes")
    passed = found["share"] <= SHARE and found["rss_peak_mb"] <= RSS_MB and off <= EXACT
    more = {"bench": "exporter", "passed": passed, "load": load, "cores": os.cpu_count(), "machine": platform.machine()}
    print(json.dumps({**found, **more}))
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
