# SPDX-License-Identifier: GPL-3.0-or-later
"""The lab's builds of the real programs do their work: samples and alerts go all the way on loopback.

That log lines do is a case of test_configs.
"""

from __future__ import annotations

import json
import urllib.parse
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from loopback import Program, eventually, free_port, get_json, image_files, program, running

# Enough for an alert to go all the way.
ALWAYS_FIRING = {
    "groups": [{"name": "test", "rules": [{"alert": "Always", "expr": "up == 1", "labels": {"severity": "info"}}]}]
}
ALERTMANAGER = {"route": {"receiver": "none"}, "receivers": [{"name": "none"}]}


def write(path: Path, config: dict[str, Any]) -> str:
    """JSON, which is YAML, too."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(config, indent=1))
    return str(path)


def prometheus_config(targets: dict[str, int], alertmanager: int, rules: str) -> dict[str, Any]:
    return {
        "global": {"scrape_interval": "1s", "evaluation_interval": "1s"},
        "rule_files": [rules],
        "alerting": {"alertmanagers": [{"static_configs": [{"targets": [f"127.0.0.1:{alertmanager}"]}]}]},
        "scrape_configs": [
            {"job_name": job, "static_configs": [{"targets": [f"127.0.0.1:{port}"], "labels": {"robot": "robot1"}}]}
            for job, port in targets.items()
        ],
    }


def vmagent_config(target: int) -> dict[str, Any]:
    job = {"job_name": "by-vmagent", "static_configs": [{"targets": [f"127.0.0.1:{target}"]}]}
    return {"global": {"scrape_interval": "1s"}, "scrape_configs": [job]}


def query(prometheus: Program, expression: str) -> list[dict[str, Any]]:
    found = get_json(f"{prometheus.url}/api/v1/query?query={urllib.parse.quote(expression)}")
    result: list[dict[str, Any]] = found["data"]["result"]
    return result


def test_samples_and_alerts(tmp_path: Path, stack: ExitStack) -> None:
    paths = [program(name) for name in ("prometheus", "alertmanager", "node_exporter", "vmagent-prod")]
    prometheus_path, alertmanager_path, exporter_path, vmagent_path = paths
    own, alerts, exporter, agent = (free_port() for _program in range(4))
    address = "127.0.0.1"
    rules = write(tmp_path / "rules.yml", ALWAYS_FIRING)
    config = write(
        tmp_path / "prometheus.yml", prometheus_config({"prometheus": own, "node-exporter": exporter}, alerts, rules)
    )
    stack.enter_context(
        running(tmp_path / "exporter", exporter, exporter_path, f"--web.listen-address={address}:{exporter}")
    )
    # It reads templates beside it, as Debian has it: only in its image's files is it whole.
    root = image_files(alertmanager_path, "/bin/alertmanager", tmp_path / "image")
    write(root / "alertmanager.yml", ALERTMANAGER)
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
            f"-promscrape.config={write(tmp_path / 'vmagent.yml', vmagent_config(exporter))}",
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
