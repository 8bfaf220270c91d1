# SPDX-License-Identifier: GPL-3.0-or-later
"""The fleet's watchers by certificates, on the lab's clusters: Secrets by the page's commands, and one variable."""

from __future__ import annotations

import base64
import json
import ssl
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlencode

import pytest
from loopback import eventually, get
from test_tls import Authority, assert_closed, series
from watched import ALONE, EDGE, LOGS_PORT, METRICS_PORT, NAMESPACE, ROBOTS, Watched

SECRET, SHIPPER = "telemetry-tls", "telemetry-tls-shipper"
SECONDS = 120  # until what was restarted has sent something
PLAIN = ("site", "--tags", "observability")


@pytest.fixture
def ours(fleet: Watched, tmp_path: Path) -> Iterator[Authority]:
    """An authority, whose certificates each cluster has; without them again afterwards."""
    made = Authority(tmp_path / "ours", fleet.hosts.address(EDGE))
    # the shipper's is made as robot2's
    every = [(EDGE, SECRET, "hub"), (EDGE, SHIPPER, "robot2"), (ALONE, SECRET, "robot2")]
    for host, name, own in every:
        files = {path.name: path.read_bytes() for path in made.secret(own, tmp_path / f"{host}-{name}").iterdir()}
        body = {
            "metadata": {"name": name},
            "type": "kubernetes.io/tls",
            "data": {file: base64.b64encode(content).decode() for file, content in files.items()},
        }
        fleet.core(host).create_namespaced_secret(NAMESPACE, body)
    yield made
    assert fleet.run(*PLAIN).status == 0
    for host, name, _own in every:
        fleet.core(host).delete_namespaced_secret(name, NAMESPACE)


def lines(url: str, robot: str, since: float, context: ssl.SSLContext) -> int:
    """Numbered lines of a robot's that were written since then and have come."""
    query = {"query": f'{{robot="{robot}",app="counter"}}', "start": f"{since:.3f}", "limit": "10"}
    found = json.loads(get(f"{url}/loki/api/v1/query_range?{urlencode(query)}", context))
    return sum(len(one["values"]) for one in found["data"]["result"])


def test_hub_and_robots_by_certificates_alone(fleet: Watched, ours: Authority, tmp_path: Path) -> None:
    hub, theirs = fleet.hosts.address(EDGE), Authority(tmp_path / "theirs", fleet.hosts.address(EDGE))
    given = {"observability_tls_secret_name": SECRET, "observability_hub_url": f"https://{hub}"}
    run = fleet.run(*PLAIN, **given)
    assert run.status == 0, run
    assert run.changed > 0, run
    since, mine = time.time(), ours.caller("robot2")
    metrics, logs = (f"https://{hub}:{port}" for port in (METRICS_PORT, LOGS_PORT))
    for robot in ROBOTS:
        fresh = f'timestamp(up{{robot="{robot}"}}) > {since:.0f}'
        eventually(f"samples of {robot}", lambda: series(metrics, fresh, mine), SECONDS)  # noqa: B023
        eventually(f"lines of {robot}", lambda: lines(logs, robot, since, mine), SECONDS)  # noqa: B023
        fleet.say(f"{robot}: samples and lines by certificates, {time.time() - since:.0f} s after the run's end")
    assert_closed(f"{metrics}/api/v1/query?query=1", ours, theirs)
    assert_closed(f"{metrics}/api/v1/write", ours, theirs)
    assert_closed(f"{logs}/loki/api/v1/labels", ours, theirs)
    again = fleet.run(*PLAIN, **given)
    assert (again.status, again.changed) == (0, 0), again
