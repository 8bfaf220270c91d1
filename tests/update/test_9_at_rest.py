# SPDX-License-Identifier: GPL-3.0-or-later
"""What lies on a server's disk: Secrets are encrypted there. The lab's cluster is one that is new."""

from __future__ import annotations

import base64
import secrets
from collections.abc import Iterator

import pytest
from fleet import Fleet
from kubernetes import client

EDGE, NAMESPACE, NAME = "edge1", "default", "at-rest"
SERVER = "/var/lib/rancher/k3s/server"


@pytest.fixture
def kept() -> Iterator[tuple[str, str]]:
    """The values of a Secret and of a ConfigMap."""
    core, hidden, open_text = client.CoreV1Api(), secrets.token_hex(16), secrets.token_hex(16)
    core.create_namespaced_secret(NAMESPACE, {"metadata": {"name": NAME}, "stringData": {"key": hidden}})
    core.create_namespaced_config_map(NAMESPACE, {"metadata": {"name": NAME}, "data": {"key": open_text}})
    yield hidden, open_text
    core.delete_namespaced_secret(NAME, NAMESPACE)
    core.delete_namespaced_config_map(NAME, NAMESPACE)


def files_with(fleet: Fleet, text: str) -> list[str]:
    """Those of the datastore in which it is written as it is."""
    return fleet.hosts.ssh(EDGE, f"grep -rlaF {text} {SERVER}/db || true").split()


@pytest.mark.promise("a Secret is not in the datastore's files as it is")
def test_a_secret_is_not_in_the_datastore_as_it_is(fleet: Fleet, kept: tuple[str, str]) -> None:
    hidden, open_text = kept
    assert files_with(fleet, open_text)  # what is not encrypted is found there
    assert not files_with(fleet, hidden)
    assert not files_with(fleet, base64.b64encode(hidden.encode()).decode())
    read = client.CoreV1Api().read_namespaced_secret(NAME, NAMESPACE).data["key"]
    assert base64.b64decode(read).decode() == hidden
    key = fleet.hosts.ssh(EDGE, f"stat -c %a {SERVER}/cred/encryption-config.json").strip()
    assert key == "600"
