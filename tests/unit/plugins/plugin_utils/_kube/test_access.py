# SPDX-License-Identifier: GPL-3.0-or-later
"""Credentials: options, the environment's variables, kubeconfigs; and whose cluster it is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.access import (
    Identity,
    NoClusterError,
    WrongClusterError,
    access_from,
    identity_in,
    to_be_adopted,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.client import Kube
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server

HOST = {"host": "https://a", "api_key": "t"}

GIVEN: list[tuple[dict[str, Any], dict[str, str], dict[str, Any]]] = [
    ({**HOST, "context": None}, {"K8S_AUTH_HOST": "https://b"}, {"host": "https://a"}),
    ({"host": "", "api_key": ""}, {"K8S_AUTH_HOST": "https://b", "K8S_AUTH_API_KEY": "t"}, {"host": "https://b"}),
    (HOST, {"K8S_AUTH_VERIFY_SSL": "False"}, {"verify_ssl": False}),
    ({**HOST, "validate_certs": False}, {"K8S_AUTH_VERIFY_SSL": "true"}, {"verify_ssl": False}),
]


@pytest.mark.parametrize(("params", "environ", "expected"), GIVEN)
def test_options_come_before_the_environment(
    monkeypatch: pytest.MonkeyPatch, params: dict[str, Any], environ: dict[str, str], expected: dict[str, Any]
) -> None:
    for name, value in environ.items():
        monkeypatch.setenv(name, value)
    configuration = access_from(params).configuration
    assert {key: getattr(configuration, key) for key in expected} == expected


def test_an_environment_that_does_not_count_adds_nothing(
    server: Server, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for name, value in {
        "HOST": "https://b", "API_KEY": "b", "CONTEXT": "away", "VERIFY_SSL": "False", "IMPERSONATE_GROUPS": "a",
    }.items():  # fmt: skip
        monkeypatch.setenv(f"K8S_AUTH_{name}", value)
    path = tmp_path / "config"
    path.write_text(yaml.safe_dump(kubeconfig(server.url)))
    access = access_from({"kubeconfig": str(path)}, environment=False)
    assert (access.configuration.host, access.configuration.verify_ssl, access.headers) == (server.url, True, ())
    with Kube(access) as kube:
        kube.objects("Node")
    assert server.seen()[2]["authorization"] == "Bearer from-file"
    assert access_from({}).configuration.host == "https://b"  # it is there again


def test_who_to_act_as_comes_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("K8S_AUTH_IMPERSONATE_GROUPS", "a,b")
    monkeypatch.setenv("K8S_AUTH_IMPERSONATE_USER", "u")
    headers = access_from(HOST).headers
    assert headers == (("Impersonate-User", "u"), ("Impersonate-Group", "a"), ("Impersonate-Group", "b"))


def test_a_second_cluster_inherits_nothing_from_the_first() -> None:
    given = kubeconfig("https://first")
    given["clusters"][0]["cluster"]["insecure-skip-tls-verify"] = True
    assert access_from({"kubeconfig": given}).configuration.verify_ssl is False
    assert access_from(HOST).configuration.verify_ssl is True


def kubeconfig(url: str) -> dict[str, Any]:
    servers = {"lab": url, "away": "http://[::1]:1"}
    return {
        "apiVersion": "v1",
        "kind": "Config",
        "current-context": "lab",
        "clusters": [{"name": name, "cluster": {"server": server}} for name, server in servers.items()],
        "users": [{"name": "admin", "user": {"token": "from-file"}}],
        "contexts": [{"name": name, "context": {"cluster": name, "user": "admin"}} for name in servers],
    }


@pytest.mark.parametrize("content", [None, "", "{", "kind: Config"])
def test_an_unusable_kubeconfig_says_what_to_do(tmp_path: Path, content: str | None) -> None:
    path, words = tmp_path / "config", r"No usable Kubernetes credentials in .*config.*Set kubeconfig"
    if content is not None:
        path.write_text(content)
    with pytest.raises(KubeError, match=words if path.exists() else r"no kubeconfig .*config.*a run fetches") as error:
        Kube({"kubeconfig": str(path)})
    assert isinstance(error.value, NoClusterError) != path.exists()


# --- whose it is ------------------------------------------------------------------------------------------------------

EDGE = Identity("production", "edge")
WHERE = "https://10.0.0.1:6443 (from K8S_AUTH_HOST of the environment)"


@pytest.mark.parametrize(
    ("found", "own", "adopted"),
    [
        (EDGE, False, False),
        (EDGE, True, False),
        (None, True, True),
        (Identity("fleet", "edge"), True, True),  # made before the fleet had a name
        (Identity("staging", "edge"), False, None),
        (Identity("staging", "edge"), True, None),
        (Identity("production", "robot2"), False, None),
        (Identity("fleet", "robot2"), True, None),
        (Identity("fleet", "edge"), False, None),
        (None, False, None),
    ],
)
def test_another_one_is_refused_with_both_names(found: Identity | None, own: bool, adopted: bool | None) -> None:
    if adopted is not None:
        assert to_be_adopted(found, EDGE, own, WHERE) is adopted
        return
    said = found or "a cluster that carries no fleet's identity"
    with pytest.raises(WrongClusterError) as error:
        to_be_adopted(found, EDGE, own, WHERE)
    assert str(error.value).startswith(f"{WHERE} leads to {said}; the inventory's is {EDGE}. Nothing was read or chang")


def test_what_is_written_is_what_is_read_where_there_is_one() -> None:
    assert identity_in(EDGE.as_object()) == EDGE
    nothing: list[Any] = [None, {}, {"data": None}, {"data": {"fleet": "a"}}]
    assert [identity_in(found) for found in nothing] == [None] * 4
