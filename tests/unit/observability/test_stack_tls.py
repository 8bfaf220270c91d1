# SPDX-License-Identifier: GPL-3.0-or-later
"""The stack with certificates: who serves by which, who shows which, and that no key leaves its Secret."""

from __future__ import annotations

import base64
import json
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import stack
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.files import Files
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.spec import Spec
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Object
from ansible_collections.rosops.fleet.tests.unit.api_schema import fits_the_api
from ansible_collections.rosops.fleet.tests.unit.observability.specs import full, templates
from doc_blocks import CHECKOUT, blocks_of

NAME = "telemetry-tls"
ALERTS = {"route": {"receiver": "nobody"}, "receivers": [{"name": "nobody"}]}
HUB: dict[str, Any] = {
    "profile": "hub", "allowed_networks": ["192.0.2.0/24"], "alertmanager_config": ALERTS, "tls_secret_name": NAME,
}  # fmt: skip
ROBOT: dict[str, Any] = {
    "profile": "robot", "robot": "robot2", "hub_url": "https://192.0.2.10", "tls_secret_name": NAME,
}  # fmt: skip
ASKS = {
    "cert_file": "/etc/tls/tls.crt", "key_file": "/etc/tls/tls.key", "client_ca_file": "/etc/tls/ca.crt",
    "client_auth_type": "RequireAndVerifyClientCert",
}  # fmt: skip
SHOWS = {"ca_file": "/etc/tls/ca.crt", "cert_file": "/etc/tls/tls.crt", "key_file": "/etc/tls/tls.key"}


def built(spec: Spec) -> list[Object]:
    return [*stack.stack_objects(spec, Files()), *stack.stack_secrets(spec, {"password": "p", "version": "1"})]


def pods(spec: Spec) -> dict[str, Any]:
    """Part -> its pod."""
    return {name: one["spec"] for name, one in templates(stack.stack_objects(spec, Files())).items()}


def file(spec: Spec, name: str, file_name: str) -> Any:
    """A configuration file, of a ConfigMap or a Secret."""
    [data] = [
        one["data"]
        for one in built(spec)
        if (one["kind"] in ("ConfigMap", "Secret") and one["metadata"]["name"] == name)
    ]
    text = data[file_name]
    return yaml.safe_load(text if "\n" in text else base64.b64decode(text))


def secrets_of(spec: Spec) -> dict[str, str]:
    """Part -> the Secret whose files it has."""
    found = {}
    for part, pod in pods(spec).items():
        for volume in pod["volumes"]:
            if volume["name"] == "tls":
                [container] = pod["containers"]
                assert {"name": "tls", "mountPath": "/etc/tls", "readOnly": True} in container["volumeMounts"]
                assert volume["secret"]["defaultMode"] == 0o440  # the pod's own group, and no others
                found[part] = volume["secret"]["secretName"]
    return found


@pytest.mark.parametrize("settings", [HUB, ROBOT], ids=["hub", "robot"])
def test_the_api_takes_it(settings: dict[str, Any]) -> None:
    for one in built(full(settings)):
        fits_the_api(one)


def test_no_host_of_a_robot_has_the_servers_key() -> None:
    """The log shipper is on all of them, so it has a Secret of its own."""
    servers = dict.fromkeys(("prometheus", "loki", "alertmanager", "grafana"), NAME)
    assert secrets_of(full(HUB)) == {**servers, "log-shipper": f"{NAME}-shipper"}
    assert secrets_of(full({**HUB, "profile": "standalone", "log_shipper": "none"})) == servers
    assert secrets_of(full(ROBOT)) == {"vmagent": NAME, "log-shipper": NAME}
    assert secrets_of(full({**HUB, "tls_secret_name": ""})) == {}


def test_who_listens_asks_for_a_certificate() -> None:
    hub = full(HUB)
    for name, option in (
        ("prometheus", "--web.config.file=/etc/prometheus/web.yml"),
        ("alertmanager", "--web.config.file=/etc/alertmanager/web.yml"),
    ):
        assert file(hub, name, "web.yml") == {"tls_server_config": ASKS}
        assert option in pods(hub)[name]["containers"][0]["args"]
    assert file(hub, "loki", "loki.yml")["server"]["http_tls_config"] == ASKS


def test_grafana_serves_by_tls_and_asks_for_a_password_alone() -> None:
    [container] = pods(full(HUB))["grafana"]["containers"]
    said = {one["name"]: one["value"] for one in container["env"] if one["name"].startswith("GF_SERVER")}
    assert said == {
        "GF_SERVER_PROTOCOL": "https", "GF_SERVER_CERT_FILE": "/etc/tls/tls.crt",
        "GF_SERVER_CERT_KEY": "/etc/tls/tls.key", "GF_SERVER_CERTS_WATCH_INTERVAL": "1m",
    }  # fmt: skip
    assert {"name": "GF_SECURITY_COOKIE_SECURE", "value": "true"} in container["env"]
    assert container["readinessProbe"]["httpGet"] == {"port": 3000, "path": "/api/health", "scheme": "HTTPS"}


def test_a_kubelet_that_has_no_certificate_only_looks_whether_the_port_is_open() -> None:
    for part, port in {"prometheus": 9090, "loki": 3100, "alertmanager": 9093}.items():
        [container] = pods(full(HUB))[part]["containers"]
        assert container["startupProbe"]["tcpSocket"] == {"port": port}
        assert "readinessProbe" not in container
        [plain] = pods(full({**HUB, "tls_secret_name": ""}))[part]["containers"]
        assert "startupProbe" not in plain
        assert plain["readinessProbe"]["httpGet"]["port"] == port


def test_who_asks_shows_one() -> None:
    hub = full(HUB)
    scrape = file(hub, "prometheus", "prometheus.yml")
    for name in ("prometheus", "loki", "alertmanager", "grafana"):
        [job] = [one for one in scrape["scrape_configs"] if one["job_name"] == name]
        # a target is an address, and a certificate has names
        assert (job["scheme"], job["tls_config"]) == ("https", {**SHOWS, "server_name": f"{name}.observability"})
    plain = {one["job_name"] for one in scrape["scrape_configs"] if one.get("scheme") != "https"}
    assert {"node-exporter", "log-shipper", "ros-exporter", "apps"} == plain
    [alerts] = scrape["alerting"]["alertmanagers"]
    assert alerts["static_configs"] == [{"targets": ["alertmanager.observability:9093"]}]
    assert (alerts["scheme"], alerts["tls_config"]["key_file"]) == ("https", "/etc/tls/tls.key")
    assert file(hub, "loki", "loki.yml")["ruler"]["alertmanager_client"] == {
        "tls_ca_path": "/etc/tls/ca.crt", "tls_cert_path": "/etc/tls/tls.crt", "tls_key_path": "/etc/tls/tls.key",
    }  # fmt: skip
    exporter = file(hub, "log-shipper", "otelcol.yml")["exporters"]["otlphttp"]
    assert exporter["logs_endpoint"] == "https://loki.observability:3100/otlp/v1/logs"
    assert exporter["tls"] == {**SHOWS, "reload_interval": "10m"}
    for source in file(hub, "grafana", "datasources.yml")["datasources"]:
        assert source["url"].startswith("https://")
        assert source["jsonData"]["tlsAuth"] is source["jsonData"]["tlsAuthWithCACert"] is True
        assert source["secureJsonData"] == {
            "tlsCACert": "$__file{/etc/tls/ca.crt}", "tlsClientCert": "$__file{/etc/tls/tls.crt}",
            "tlsClientKey": "$__file{/etc/tls/tls.key}",
        }  # fmt: skip


def test_a_robot_shows_its_own_to_the_hub() -> None:
    robot = full(ROBOT)
    exporter = file(robot, "log-shipper", "otelcol.yml")["exporters"]["otlphttp"]
    assert exporter["logs_endpoint"] == "https://192.0.2.10:30100/otlp/v1/logs"
    assert exporter["tls"] == {**SHOWS, "reload_interval": "10m"}
    arguments = pods(robot)["vmagent"]["containers"][0]["args"]
    assert "-remoteWrite.url=https://192.0.2.10:30090/api/v1/write" in arguments
    assert [one for one in arguments if "tls" in one] == [
        "-remoteWrite.tlsCAFile=/etc/tls/ca.crt",
        "-remoteWrite.tlsCertFile=/etc/tls/tls.crt",
        "-remoteWrite.tlsKeyFile=/etc/tls/tls.key",
    ]


def test_a_hub_s_proxy_with_a_public_certificate_is_reached_as_before() -> None:
    robot = full({**ROBOT, "tls_secret_name": ""})
    assert "tls" not in file(robot, "log-shipper", "otelcol.yml")["exporters"]["otlphttp"]
    assert "tls" not in json.dumps(pods(robot)["vmagent"])


def secret(**other: str) -> dict[str, Any]:
    return {"data": {"tls.crt": "Y2VydA==", "tls.key": "a2V5", "ca.crt": "Y2E=", **other}}


def restarted(change: dict[str, str]) -> set[str]:
    """Whose pods are others once a hub's Secrets say something else."""
    found = []
    for one in (secret(), secret(**change)):
        spec = full(HUB)
        versions = stack.tls_versions(spec, {NAME: one, f"{NAME}-shipper": one})
        made = stack.stack_objects({**spec, "tls_versions": versions}, Files())
        assert "a2V5" not in json.dumps(made)
        found.append(templates(made))
    before, after = found
    return {part for part in before if before[part] != after[part]}


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        ({"tls.crt": "bmV3"}, {"grafana", "loki"}),
        ({"ca.crt": "bmV3"}, {"grafana", "loki", "log-shipper"}),
        ({"tls.key": "bmV3"}, set()),
    ],
)
def test_a_run_restarts_who_does_not_read_it_again(change: dict[str, str], parts: set[str]) -> None:
    assert restarted(change) == parts


@pytest.mark.parametrize(
    ("there", "told"),
    [
        ({NAME: None}, f"the Secret {NAME} in the namespace observability has no tls.crt, tls.key, ca.crt"),
        ({NAME: secret(**{"ca.crt": ""})}, f"the Secret {NAME} in the namespace observability has no ca.crt"),
        (
            {NAME: secret(), f"{NAME}-shipper": {}},
            f"the Secret {NAME}-shipper in the namespace observability has no tls",
        ),
    ],
)
def test_a_secret_that_is_not_whole_is_told(there: dict[str, Any], told: str) -> None:
    with pytest.raises(SpecError, match=told):
        stack.tls_versions(full(HUB), there)


def test_the_page_s_certificates_have_the_names_that_are_asked_for() -> None:
    page = (CHECKOUT / "docs" / "observability.md").read_text("utf-8")
    [block] = [one for one in blocks_of("observability.md", page) if "cert-manager.io/v1" in one.text]
    issuer, *certificates = yaml.safe_load_all(block.text)
    made = {one["spec"]["secretName"]: one["spec"] for one in certificates}
    assert set(secrets_of(full(HUB)).values()) == set(made) - {"robot2-tls"}
    assert {one["issuerRef"]["name"] for one in made.values()} == {issuer["metadata"]["name"]}
    jobs = file(full(HUB), "prometheus", "prometheus.yml")["scrape_configs"]
    asked = {one["tls_config"]["server_name"] for one in jobs if "cert_file" in one.get("tls_config", {})}
    assert set(made[NAME]["dnsNames"]) == asked
    assert made[NAME]["usages"] == ["server auth", "client auth"]
    assert {tuple(spec["usages"]) for name, spec in made.items() if name != NAME} == {("client auth",)}
