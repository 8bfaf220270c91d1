# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The lab's builds of the real programs do their work: samples, alerts and log lines go all the way on loopback."""

from __future__ import annotations

import subprocess
import urllib.parse
from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import minimal
import pytest
from loopback import Program, eventually, free_port, get, get_json, image_files, program, running

LINES = 100


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as programs:
        yield programs


def query(prometheus: Program, expression: str) -> list[dict[str, Any]]:
    found = get_json(f"{prometheus.url}/api/v1/query?query={urllib.parse.quote(expression)}")
    result: list[dict[str, Any]] = found["data"]["result"]
    return result


def log_lines(loki: Program, selector: str) -> list[tuple[dict[str, str], str]]:
    found = get_json(f"{loki.url}/loki/api/v1/query_range?query={urllib.parse.quote(selector)}")
    return [(stream["stream"], line[1]) for stream in found["data"]["result"] for line in stream["values"]]


def all_lines(loki: Program, robot: str) -> list[tuple[dict[str, str], str]]:
    """Nothing until all of them are there."""
    lines = log_lines(loki, f'{{robot="{robot}", app="talker"}}')
    return lines if len(lines) == LINES else []


def test_samples_and_alerts(tmp_path: Path, stack: ExitStack) -> None:
    paths = [program(name) for name in ("prometheus", "alertmanager", "node_exporter", "vmagent-prod")]
    prometheus_path, alertmanager_path, exporter_path, vmagent_path = paths
    own, alerts, exporter, agent = (free_port() for _program in range(4))
    address = "127.0.0.1"
    rules = minimal.write(tmp_path / "rules.yml", minimal.always_firing())
    config = minimal.write(
        tmp_path / "prometheus.yml",
        minimal.prometheus({"prometheus": own, "node-exporter": exporter}, alerts, rules),
    )
    stack.enter_context(
        running(tmp_path / "exporter", exporter, exporter_path, f"--web.listen-address={address}:{exporter}")
    )
    # It reads templates beside it, as Debian has it: only in its image's files is it whole.
    root = image_files(alertmanager_path, "/bin/alertmanager", tmp_path / "image")
    minimal.write(root / "alertmanager.yml", minimal.alertmanager())
    alertmanager = stack.enter_context(
        running(
            *(tmp_path / "alertmanager", alerts, "chroot", str(root), "/bin/alertmanager"),
            "--config.file=/alertmanager.yml",
            f"--web.listen-address={address}:{alerts}",
            "--cluster.listen-address=",
        )
    ).ready("/-/ready")
    prometheus = stack.enter_context(
        running(
            *(tmp_path / "prometheus", own, prometheus_path, f"--config.file={config}"),
            f"--storage.tsdb.path={tmp_path / 'tsdb'}",
            f"--web.listen-address={address}:{own}",
            "--web.enable-remote-write-receiver",
        )
    ).ready("/-/ready")
    stack.enter_context(
        running(
            *(tmp_path / "vmagent", agent, vmagent_path, f"-httpListenAddr={address}:{agent}"),
            f"-promscrape.config={minimal.write(tmp_path / 'vmagent.yml', minimal.vmagent(exporter))}",
            f"-remoteWrite.url={prometheus.url}/api/v1/write",
            f"-remoteWrite.tmpDataPath={tmp_path / 'queue'}",
        )
    )
    version = get_json(f"{prometheus.url}/api/v1/status/buildinfo")["data"]["version"]
    assert version == "3.2.1"
    eventually("a scraped sample", lambda: query(prometheus, 'node_boot_time_seconds{job="node-exporter"}'))
    eventually("a sample by vmagent", lambda: query(prometheus, 'node_boot_time_seconds{job="by-vmagent"}'))
    eventually(
        "the alert in Alertmanager",
        lambda: [
            alert
            for alert in get_json(f"{alertmanager.url}/api/v2/alerts")
            if alert["labels"]["alertname"] == "Always" and alert["labels"]["robot"] == "robot1"
        ],
    )


def test_log_lines(tmp_path: Path, stack: ExitStack) -> None:
    loki_path, otelcol_path = program("loki"), program("otelcol-contrib")
    http, grpc, otelcol_own = free_port(), free_port(), free_port()
    loki_config = minimal.write(tmp_path / "loki.yml", minimal.loki(tmp_path / "data", http, grpc))
    log = tmp_path / "pod.log"
    log.write_text("".join(f"line {number}\n" for number in range(LINES)))
    loki = stack.enter_context(running(tmp_path / "loki", http, loki_path, f"-config.file={loki_config}"))
    loki.ready("/ready")
    collector = stack.enter_context(
        running(
            *(tmp_path / "otelcol", otelcol_own, otelcol_path),
            "--config",
            minimal.write(tmp_path / "otelcol.yml", minimal.otelcol(log, tmp_path / "queue", http, otelcol_own)),
        )
    )
    lines = eventually(f"the lines of robot1\n{collector.tail}", partial(all_lines, loki, "robot1"))
    assert {line for _labels, line in lines} == {f"line {number}" for number in range(LINES)}
    labels = log_lines(loki, '{robot="robot1"}')[0][0]
    assert (labels["placement"], labels["container"]) == ("local", "node")
    assert "otelcol_exporter_sent_log_records" in get(f"{collector.url}/metrics")


@pytest.mark.parametrize(("arguments", "status"), [(["up == 1"], 0), (["up == == 1"], 1)])
def test_promtool_tells_good_rules_from_bad(tmp_path: Path, arguments: list[str], status: int) -> None:
    rules = minimal.always_firing()
    rules["groups"][0]["rules"][0]["expr"] = arguments[0]
    path = minimal.write(tmp_path / "rules.yml", rules)
    command = [program("promtool"), "check", "rules", path]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - a command of our own
    assert done.returncode == status, done.stdout + done.stderr
