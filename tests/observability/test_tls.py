# SPDX-License-Identifier: GPL-3.0-or-later
"""The real programs with certificates, made as docs/observability.md says: who has none is refused, and so is one of
another authority; a robot's own gets through.
"""

from __future__ import annotations

import base64
import json
import re
import shutil
import ssl
import subprocess
import time
import urllib.error
import urllib.request
from contextlib import ExitStack
from pathlib import Path
from urllib.parse import urlencode

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.files import Files
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.spec import PORTS, TLS
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.stack import stack_objects, stack_secrets
from ansible_collections.rosops.fleet.tests.unit.observability.specs import full, templates
from doc_blocks import CHECKOUT, blocks_of
from loopback import Program, eventually, free_port, get, image_files, moved, program, running
from test_configs import PROFILES, rendered, started_loki, started_shipper

HUB, ROBOT = "hub by TLS", "robot by TLS"  # profiles


class Authority:
    """The files that the page's commands make: an authority, the certificates of the hub at an address and robot2's."""

    def __init__(self, directory: Path, hub: str = "127.0.0.1") -> None:
        page = (CHECKOUT / "docs" / "observability.md").read_text("utf-8")
        [block] = [one for one in blocks_of("observability.md", page) if one.text.startswith("openssl")]
        directory.mkdir()
        for command in block.commands:
            here = command.replace("192.0.2.10", hub)
            subprocess.run(here.split(), cwd=directory, check=True, capture_output=True, timeout=60)  # noqa: S603
        self.directory = directory

    def secret(self, name: str, target: Path, of: Authority | None = None) -> Path:
        """The Secret of the hub or of robot2 as a pod sees it; who made it may be another one than who is believed."""
        target.mkdir(exist_ok=True)
        own = (of or self).directory / name
        files = {
            "ca.crt": self.directory / "ca.crt",
            "tls.crt": own.with_suffix(".crt"),
            "tls.key": own.with_suffix(".key"),
        }
        for file, source in files.items():
            shutil.copy(source, target / file)
        return target

    def caller(self, name: str = "", of: Authority | None = None) -> ssl.SSLContext:
        """Who believes this authority and shows a certificate of `name`, or none."""
        context = ssl.create_default_context(cafile=str(self.directory / "ca.crt"))
        if name:
            own = (of or self).directory
            context.load_cert_chain(own / f"{name}.crt", own / f"{name}.key")
        return context


@pytest.fixture(name="ours")
def _ours(tmp_path: Path) -> Authority:
    return Authority(tmp_path / "ours")


@pytest.fixture(name="theirs")
def _theirs(tmp_path: Path) -> Authority:
    return Authority(tmp_path / "theirs")


def refusal(url: str, context: ssl.SSLContext) -> str:
    """The words with which a handshake is refused; no HTTP at all is spoken."""
    context.maximum_version = ssl.TLSVersion.TLSv1_2  # with 1.3 a caller may write on, and miss them
    with pytest.raises(OSError, match="alert") as caught:
        get(url, context)
    assert not isinstance(caught.value, urllib.error.HTTPError)
    return str(caught.value)


def assert_closed(url: str, ours: Authority, theirs: Authority) -> None:
    """To all who have no certificate of the authority, also in plain HTTP."""
    # in the words of newer and of older Go
    assert re.search("handshake failure|bad certificate", refusal(url, ours.caller()))
    assert re.search("unknown ca|bad certificate", refusal(url, ours.caller("robot2", theirs)))
    with pytest.raises(urllib.error.HTTPError, match="400"):
        get(url.replace("https:", "http:"), ours.caller("robot2"))
    with pytest.raises(OSError, match="CERTIFICATE_VERIFY_FAILED"):  # and who believes another hub goes away
        get(url, theirs.caller("robot2"))


def arguments(profile: str, part: str, words: dict[str, str]) -> list[str]:
    """Those of the part's container, with other words."""
    pod = templates(stack_objects(full(PROFILES[profile]), Files()))[part]["spec"]
    return [moved(one, words) for one in pod["containers"][0]["args"]]


def started_prometheus(directory: Path, secret: Path, stack: ExitStack, **targets: int) -> Program:
    """The hub's, which looks at parts by their own jobs at other addresses: job -> port."""
    port = free_port()
    place, rules = directory / "etc", directory / "rules"
    place.mkdir(parents=True)
    words = {
        "/etc/prometheus-rules": str(rules), "/etc/prometheus": str(place), TLS: str(secret),
        "=/prometheus": f"={directory}/tsdb", "--log.level=warn": f"--web.listen-address=127.0.0.1:{port}",
        "alertmanager.observability:9093": f"127.0.0.1:{targets.get('alertmanager', 1)}",
    }  # fmt: skip
    config = yaml.safe_load(moved(rendered(HUB)["prometheus/prometheus.yml"], words))
    jobs = [one for one in config["scrape_configs"] if one["job_name"] in ("prometheus", *targets)]
    for job in jobs:
        del job["kubernetes_sd_configs"], job["relabel_configs"]
        job["static_configs"] = [{"targets": [f"127.0.0.1:{targets.get(job['job_name'], port)}"]}]
    config["global"] = {"scrape_interval": "500ms", "evaluation_interval": "500ms"}
    (place / "prometheus.yml").write_text(yaml.safe_dump({**config, "scrape_configs": jobs}))
    (place / "web.yml").write_text(moved(rendered(HUB)["prometheus/web.yml"], words))
    command = (program("prometheus"), *arguments(HUB, "prometheus", words))
    return stack.enter_context(running(directory, port, *command, scheme="https"))


def series(url: str, query: str, context: ssl.SSLContext) -> list[dict[str, str]]:
    found = json.loads(get(f"{url}/api/v1/query?{urlencode({'query': query})}", context))
    return [one["metric"] for one in found["data"]["result"]]


def started_vmagent(directory: Path, secret: Path, hub: int, stack: ExitStack) -> Program:
    """A robot's, which looks at itself."""
    own = free_port()
    directory.mkdir()
    words = {
        "/etc/prometheus/prometheus.yml": f"{directory}/scrape.yml", "=/vmagent": f"={directory}/queue",
        f"=:{PORTS['vmagent']}": f"=127.0.0.1:{own}", ":30090": f":{hub}", TLS: str(secret),
    }  # fmt: skip
    job = {"job_name": directory.name, "static_configs": [{"targets": [f"127.0.0.1:{own}"]}]}
    (directory / "scrape.yml").write_text(
        yaml.safe_dump({"global": {"scrape_interval": "500ms"}, "scrape_configs": [job]})
    )
    return stack.enter_context(
        running(directory, own, program("vmagent-prod"), *arguments(ROBOT, "vmagent", words))
    ).ready("/health")


def test_prometheus_takes_samples_of_those_with_a_certificate_alone(
    tmp_path: Path, stack: ExitStack, ours: Authority, theirs: Authority
) -> None:
    secret = ours.secret("hub", tmp_path / "hub")
    mine = ours.caller("robot2")
    url = started_prometheus(tmp_path / "prometheus", secret, stack).ready("/-/ready", mine).url
    assert_closed(f"{url}/api/v1/query?query=1", ours, theirs)
    assert_closed(f"{url}/api/v1/write", ours, theirs)
    port = int(url.rpartition(":")[2])
    # what it knows of itself comes by its own certificate and under its own name
    eventually("its own look at itself", lambda: series(url, 'up{job="prometheus"}==1', mine))

    stranger = started_vmagent(tmp_path / "stranger", ours.secret("robot2", tmp_path / "c", theirs), port, stack)
    started_vmagent(tmp_path / "robot", ours.secret("robot2", tmp_path / "b"), port, stack)
    eventually("the robot's samples", lambda: series(url, 'up{job="robot"}==1', mine))
    eventually("the stranger's complaint", lambda: re.search("remote error: tls: ", stranger.tail))
    assert series(url, 'up{job="stranger"}', mine) == []

    # another authority takes over: no restart, and who was let in before is not any more
    theirs.secret("hub", secret)
    eventually("the new certificate", lambda: get(f"{url}/-/ready", theirs.caller("robot2")))
    assert_closed(f"{url}/api/v1/query?query=1", theirs, ours)


def test_alerts_go_by_certificates(tmp_path: Path, stack: ExitStack, ours: Authority, theirs: Authority) -> None:
    """From Prometheus to Alertmanager."""
    port = free_port()
    # It reads templates beside it, as Debian has it: only in its image's files is it whole.
    root = image_files(program("alertmanager"), "/bin/alertmanager", tmp_path / "image")
    (root / "etc" / "alertmanager").mkdir(parents=True)
    ours.secret("hub", root / TLS[1:])
    [secret] = stack_secrets(full(PROFILES[HUB]), {"password": ""})
    for name, text in secret["data"].items():
        (root / "etc" / "alertmanager" / name).write_bytes(base64.b64decode(text))
    words = {"--log.level=warn": f"--web.listen-address=127.0.0.1:{port}"}
    command = ("chroot", str(root), "/bin/alertmanager", *arguments(HUB, "alertmanager", words))
    mine = ours.caller("hub")
    alertmanager = stack.enter_context(running(tmp_path / "alertmanager", port, *command, scheme="https"))
    url = alertmanager.ready("/-/ready", mine).url
    assert_closed(f"{url}/api/v2/alerts", ours, theirs)
    rule = {"alert": "Always", "expr": 'up{job="alertmanager"} == 1'}
    rules = tmp_path / "prometheus" / "rules"
    rules.mkdir(parents=True)
    (rules / "rules.yml").write_text(json.dumps({"groups": [{"name": "test", "rules": [rule]}]}))
    started_prometheus(tmp_path / "prometheus", ours.secret("hub", tmp_path / "hub"), stack, alertmanager=port)
    found = eventually("the alert in Alertmanager", lambda: json.loads(get(f"{url}/api/v2/alerts", mine)))
    assert [one["labels"]["alertname"] for one in found] == ["Always"]


def test_loki_takes_lines_of_those_with_a_certificate_alone(
    tmp_path: Path, stack: ExitStack, ours: Authority, theirs: Authority, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NODE_NAME", "robot2")
    secret = ours.secret("hub", tmp_path / "hub")
    mine = ours.caller("robot2")
    url = started_loki(HUB, tmp_path / "server", stack, {TLS: str(secret)}).ready("/ready", mine).url
    assert_closed(f"{url}/loki/api/v1/labels", ours, theirs)
    assert_closed(f"{url}/otlp/v1/logs", ours, theirs)
    port = int(url.rpartition(":")[2])

    def lines() -> list[str]:
        query = urlencode({"query": '{robot="robot1"}', "start": f"{time.time() - 600:.0f}"})
        found = json.loads(get(f"{url}/loki/api/v1/query_range?{query}", mine))["data"]["result"]
        return [line for stream in found for _when, line in stream["values"]]

    def shipper(name: str, secret: Path) -> Program:
        words = {TLS: str(secret), ":30100": f":{port}"}
        return started_shipper(ROBOT, tmp_path / name, stack, [f"of {name}"] * 2, words)

    stranger = shipper("stranger", ours.secret("robot2", tmp_path / "c", theirs))
    shipper("robot", ours.secret("robot2", tmp_path / "b"))
    eventually("the robot's lines", lines)
    eventually("the stranger's complaint", lambda: re.search("remote error: tls: ", stranger.tail))
    assert set(lines()) == {"of robot"}

    # who asks by an address is served by the certificate of its start, and who is believed is of its start, too
    theirs.secret("hub", secret)
    assert get(f"{url}/ready", mine)
    assert_closed(f"{url}/loki/api/v1/labels", ours, theirs)
