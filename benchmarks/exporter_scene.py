# SPDX-License-Identifier: GPL-3.0-or-later
"""What shows the metrics, as its pod runs it, beside a master and nodes on loopback; and what a scrape of it shows."""

from __future__ import annotations

import subprocess
import urllib.request
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from prometheus_client.openmetrics.parser import text_string_to_metric_families
from scene import Scene, until


class Metrics:
    """One scrape, read by a strict parser."""

    def __init__(self, text: str) -> None:
        self.samples = [
            (sample.name, dict(sample.labels), float(sample.value))
            for family in text_string_to_metric_families(text)
            for sample in family.samples
        ]

    def all(self, name: str, **labels: str) -> list[tuple[dict[str, str], float]]:
        return [
            (found, value)
            for sample, found, value in self.samples
            if sample == name and labels.items() <= found.items()
        ]  # fmt: skip

    def __call__(self, name: str, **labels: str) -> float:
        """The one value; LookupError if there is none."""
        values = self.all(name, **labels)
        if len(values) != 1:
            raise LookupError(f"{name}{labels}: {values}")
        return values[0][1]


class ExporterScene(Scene):
    def __init__(self, directory: Path) -> None:
        super().__init__(directory)
        self.exporter_port = self.reserve_port()

    def start_exporter(self, interval: float, timeout: float) -> subprocess.Popen[bytes]:
        """As beside an external master: it keeps nothing, and so leaves the graph alone."""
        process = self.start_code(
            "keeper", "--keep", "off", "--port", str(self.exporter_port), "--interval", f"{interval:g}",
            "--timeout", f"{timeout:g}",
        )  # fmt: skip
        until("a scrape", self.scrape)
        return process

    def scrape(self) -> Metrics:
        with urllib.request.urlopen(f"http://127.0.0.1:{self.exporter_port}/metrics", timeout=5) as reply:
            return Metrics(reply.read().decode())

    def published(self, name: str, at: float) -> float:
        """How many messages the publisher itself says it had published at that time."""
        after = until("its next count", lambda: next((line for line in self.log(name) if line["at"] > at), None))
        before: Mapping[str, Any] = [line for line in self.log(name) if line["at"] <= at][-1]
        part = (at - before["at"]) / (after["at"] - before["at"])
        return float(before["count"] + part * (after["count"] - before["count"]))


def zipped_scrape(scene: ExporterScene) -> int:
    """As Prometheus asks; the bytes that came."""
    url = f"http://127.0.0.1:{scene.exporter_port}/metrics"
    request = urllib.request.Request(url, headers={"Accept-Encoding": "gzip"})  # noqa: S310
    with urllib.request.urlopen(request, timeout=10) as reply:  # noqa: S310
        return len(reply.read())
