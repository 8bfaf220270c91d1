# SPDX-License-Identifier: GPL-3.0-or-later
"""What the role renders, read by the programs it is for; every line comes under its labels, and an alert arrives."""

from __future__ import annotations

import json
import os
import subprocess
import time
from collections.abc import Mapping
from contextlib import ExitStack
from functools import partial
from operator import itemgetter
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.files import stack_files
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.stack import stack_objects
from ansible_collections.rosops.fleet.tests.unit.observability.specs import full
from loopback import Program, eventually, free_port, get, image_files, moved, program, running
from rosops_apps.metrics import Metrics
from watchers import Loki

ALERTMANAGER = {"route": {"receiver": "none"}, "receivers": [{"name": "none"}]}
PROFILES: dict[str, dict[str, Any]] = {
    "standalone": {"remote_nodes": ["edge1"]},
    "hub": {"profile": "hub", "remote_nodes": ["edge1"], "alertmanager_config": ALERTMANAGER},
    "robot": {"profile": "robot", "robot": "robot2", "hub_url": "http://127.0.0.1"},
}
TLS = {"tls_secret_name": "telemetry-tls"}
PROFILES["hub by TLS"] = {**PROFILES["hub"], **TLS}
PROFILES["robot by TLS"] = {**PROFILES["robot"], **TLS, "hub_url": "https://127.0.0.1"}
GATE = "--feature-gates=stanza.synchronousLogEmitter"
NO_TLS: Mapping[str, str] = MappingProxyType({})
PARTS = 3  # of a long line
# Namespace, pod and container of log files, and the stream that their lines belong to.
PODS = {
    ("robot-robot1", "add-two-ints-6c8b9d7f5c-x2x4z", "node"): {
        **{"robot": "robot1", "namespace": "robot-robot1", "app": "add-two-ints"},
        **{"pod": "add-two-ints-6c8b9d7f5c-x2x4z", "placement": "local"},
    },
    ("observability", "node-exporter-b7k9q", "node-exporter"): {
        **{"namespace": "observability", "app": "node-exporter", "pod": "node-exporter-b7k9q", "placement": "local"}
    },
}


def rendered(profile: str) -> dict[str, str]:
    """File -> text, of every ConfigMap."""
    spec = full(PROFILES[profile])
    maps = [
        one for one in stack_objects(spec, stack_files([], "", default_dashboards=True)) if one["kind"] == "ConfigMap"
    ]
    return {f"{one['metadata']['name']}/{name}": text for one in maps for name, text in one.get("data", {}).items()}


READERS = {
    "log-shipper/otelcol.yml": ("otelcol-contrib", "validate", "--config=FILE", GATE),
    "loki/loki.yml": ("loki", "-verify-config", "-config.file=FILE"),
    "prometheus/prometheus.yml": ("promtool", "check", "config", "--syntax-only", "FILE"),
}


@pytest.mark.parametrize("profile", PROFILES)
def test_the_programs_read_it(tmp_path: Path, profile: str) -> None:
    """Each ends well with its file; a robot has neither Prometheus nor Loki."""
    there = rendered(profile)
    for file, (name, *arguments) in READERS.items():
        if file in there:
            path = tmp_path / "config.yml"
            path.write_text(there[file], encoding="utf-8")
            command = [program(name), *(one.replace("FILE", str(path)) for one in arguments)]
            given = {**os.environ, "NODE_NAME": "robot1"}
            done = subprocess.run(command, capture_output=True, text=True, check=False, env=given, timeout=60)  # noqa: S603
            assert done.returncode == 0, done.stdout + done.stderr


def test_promtool_finds_nothing_amiss_in_the_apps_own_metrics() -> None:
    metrics = Metrics("service", "/add_two_ints")
    metrics.answered(0.002)
    command = [program("promtool"), "check", "metrics"]
    done = subprocess.run(command, input=metrics.text(), capture_output=True, text=True, check=False, timeout=60)  # noqa: S603
    assert (done.returncode, done.stdout + done.stderr) == (0, "")


def cri(texts: list[str]) -> str:
    """As containerd writes them; every third line is cut in parts."""
    lines, began = [], time.time_ns() - len(texts) * 1_000_000
    for index, text in enumerate(texts):
        nanoseconds = began + index * 1_000_000
        when = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(nanoseconds // 10**9)) + f".{nanoseconds % 10**9:09d}Z"
        size = len(text) // PARTS
        parts = [text[:size], text[size : 2 * size], text[2 * size :]] if index % 3 == 0 else [text]
        lines += [f"{when} stdout {'F' if part is parts[-1] else 'P'} {part}" for part in parts]
    return "".join(f"{line}\n" for line in lines)


def started_loki(profile: str, directory: Path, stack: ExitStack, tls: Mapping[str, str] = NO_TLS) -> Program:
    """What the role renders, with other directories; with certificates where `tls` says where they lie."""
    port = free_port()
    (directory / "rules").mkdir(parents=True)
    words = {"/etc/loki-rules": str(directory / "rules"), "/loki": str(directory / "loki"), **tls}
    config = yaml.safe_load(moved(rendered(profile)["loki/loki.yml"], words))
    here = {"http_listen_address": "127.0.0.1", "grpc_listen_address": "127.0.0.1"}
    config["server"].update(here, http_listen_port=port, grpc_listen_port=free_port())
    (directory / "loki.yml").write_text(yaml.safe_dump(config))
    command, scheme = (program("loki"), f"-config.file={directory}/loki.yml"), "https" if tls else "http"
    return stack.enter_context(running(directory, port, *command, scheme=scheme))


def started_shipper(
    profile: str, directory: Path, stack: ExitStack, texts: list[str], words: Mapping[str, str]
) -> Program:
    """The same of the log shipper, on a host where each of PODS has written these texts."""
    own = free_port()
    for namespace, pod, container in PODS:
        log = directory / "pods" / f"{namespace}_{pod}_0a1b2c3d-0000-4000-8000-000000000000" / container / "0.log"
        log.parent.mkdir(parents=True)
        log.write_text(cri(texts))
    here = {"/var/log/pods": str(directory / "pods"), "/var/lib/rosops-fleet/log-shipper": str(directory / "state")}
    config = yaml.safe_load(moved(rendered(profile)["log-shipper/otelcol.yml"], {**here, **words}))
    [reader] = config["service"]["telemetry"]["metrics"]["readers"]
    reader["pull"]["exporter"]["prometheus"].update(host="127.0.0.1", port=own)
    config["service"]["telemetry"]["logs"]["level"] = "info"  # that of what it tries again
    (directory / "otelcol.yml").write_text(yaml.safe_dump(config))
    command = (program("otelcol-contrib"), f"--config={directory}/otelcol.yml", GATE)
    return stack.enter_context(running(directory, own, *command)).ready("/metrics")


def test_lines_and_labels(tmp_path: Path, stack: ExitStack, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every line once, whole, under exactly these labels."""
    monkeypatch.setenv("NODE_NAME", "robot1")
    texts = [f"number {index} " + "x" * 40 for index in range(30)]
    server = started_loki("standalone", tmp_path / "server", stack).ready("/ready")
    hub = {"http://loki.observability:3100": server.url}
    brought = started_shipper("standalone", tmp_path / "shipper", stack, texts, hub)
    loki = Loki(server.url)
    began = time.time() - 600

    def all_of(selector: str) -> list[str]:
        found = loki.lines(selector, began, time.time())
        return found if len(found) >= len(texts) else []

    for labels in PODS.values():
        selector = "{" + ",".join(f'{key}="{value}"' for key, value in labels.items()) + "}"
        lines = eventually(f"lines of {selector}\n{brought.tail}", partial(all_of, selector))
        assert lines == texts
        for stream in loki.over(selector, began, time.time()):
            beside = set(stream["stream"]) - set(labels)
            assert {"container", "stream"} <= beside <= {"container", "stream", "detected_level"}, stream["stream"]
    streams = loki.streams('{namespace!=""}', began, time.time())
    assert sorted(streams, key=itemgetter("pod")) == sorted(PODS.values(), key=itemgetter("pod"))


def test_an_alert_goes_all_the_way(tmp_path: Path, stack: ExitStack) -> None:
    """From Prometheus to Alertmanager, which the lab's fleet has not."""
    own, alerts = free_port(), free_port()
    # It reads templates beside it, as Debian has it: only in its image's files is it whole.
    root = image_files(program("alertmanager"), "/bin/alertmanager", tmp_path / "image")
    (root / "alertmanager.yml").write_text(json.dumps(ALERTMANAGER))
    alertmanager = stack.enter_context(
        running(
            *(tmp_path / "alertmanager", alerts, "chroot", str(root), "/bin/alertmanager"),
            *("--config.file=/alertmanager.yml", f"--web.listen-address=127.0.0.1:{alerts}"),
            "--cluster.listen-address=",
        )
    ).ready("/-/ready")
    words = {"alertmanager.observability:9093": f"127.0.0.1:{alerts}", "/etc/prometheus-rules": str(tmp_path)}
    config = yaml.safe_load(moved(rendered("hub")["prometheus/prometheus.yml"], words))
    config["global"]["evaluation_interval"] = "1s"
    path = tmp_path / "prometheus.json"
    path.write_text(json.dumps({**config, "scrape_configs": []}))
    rule = {"alert": "Always", "expr": "vector(1)", "labels": {"robot": "robot1"}}
    (tmp_path / "rules.yml").write_text(json.dumps({"groups": [{"name": "test", "rules": [rule]}]}))
    prometheus = (
        f"--config.file={path}",
        f"--storage.tsdb.path={tmp_path}/tsdb",
        f"--web.listen-address=127.0.0.1:{own}",
        "--rules.alert.resend-delay=1s",  # a first alert comes before Alertmanager is discovered; by default a minute
    )
    stack.enter_context(running(tmp_path / "prometheus", own, program("prometheus"), *prometheus)).ready("/-/ready")
    found = eventually("the alert in Alertmanager", lambda: json.loads(get(f"{alertmanager.url}/api/v2/alerts")))
    assert [one["labels"] for one in found] == [{"alertname": "Always", "robot": "robot1"}]
