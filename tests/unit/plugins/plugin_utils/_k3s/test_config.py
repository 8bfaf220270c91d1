# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Airgap manifests, tokens, and the kubeconfig for use elsewhere."""

from __future__ import annotations

import base64
from pathlib import Path

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s import config as _k3s_config

SUM = "b" * 64
MANIFEST = f"""{SUM}  k3s
{SUM} *k3s-arm64

{"c" * 64}  k3s-airgap-images-amd64.tar
{"d" * 64}  k3s-airgap-images-amd64.tar.zst
"""


@pytest.mark.parametrize(
    ("machine", "binary", "images"),
    [("x86_64", "k3s", "k3s-airgap-images-amd64.tar.zst"), ("aarch64", "k3s-arm64", "")],
)
def test_artifacts_of_a_machine(machine: str, binary: str, images: str) -> None:
    found = _k3s_config.airgap_artifacts(MANIFEST, machine)
    assert (found["binary"]["name"], found["binary"]["sha256"], found["images"]["name"]) == (binary, SUM, images)


@pytest.mark.parametrize(
    ("manifest", "machine", "message"),
    [
        (MANIFEST, "armv7l", "no line for k3s-armhf"),
        (MANIFEST, "riscv64", "no k3s for the architecture riscv64"),
        ("<html>404</html>\n", "x86_64", "line 1, is no line of sha256sum"),
        ("", "x86_64", "no line for k3s,"),
    ],
)
def test_bad_manifests(manifest: str, machine: str, message: str) -> None:
    with pytest.raises(SpecError, match=message):
        _k3s_config.airgap_artifacts(manifest, machine)


def test_a_directory_without_what_its_manifest_names(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="SHA256SUMS cannot be read"):
        _k3s_config.airgap(str(tmp_path), "x86_64")
    (tmp_path / "SHA256SUMS").write_text(f"{SUM}  k3s\n")
    with pytest.raises(SpecError, match="k3s cannot be read: No such file"):
        _k3s_config.airgap(str(tmp_path), "x86_64")
    (tmp_path / "k3s").write_text("abc")
    assert _k3s_config.airgap(str(tmp_path), "x86_64")["binary"]["size"] == 3


@pytest.mark.parametrize(
    ("given", "wrong"),
    [("", []), ("s3cret", []), (f"K10{'a' * 64}::node:s3cret", []), ("other", ["k3s_agent_token"])],
)
def test_wrong_tokens_are_named_by_their_variable(given: str, wrong: list[str]) -> None:
    read = [{"item": "agent-token", "content": base64.b64encode(f"K10{'a' * 64}::node:s3cret\n".encode()).decode()}]
    assert _k3s_config.wrong_tokens(read, {"token": "ignored", "agent-token": given}) == wrong


ADMIN = """apiVersion: v1
kind: Config
clusters:
- cluster: {certificate-authority-data: Q0E=, server: "https://127.0.0.1:6443"}
  name: default
contexts:
- context: {cluster: default, user: default}
  name: default
current-context: default
users:
- name: default
  user: {client-certificate-data: Q0VSVA==, client-key-data: S0VZ}
"""


def test_the_kubeconfig_names_the_cluster_and_says_what_it_was_made_from() -> None:
    text = _k3s_config.local_kubeconfig(ADMIN, "https://10.0.0.1:6443", "edge", SUM)
    assert text.splitlines()[0] == f"# rosops.fleet: edge at https://10.0.0.1:6443, from k3s.yaml sha256:{SUM}"
    config = yaml.safe_load(text)
    assert config["current-context"] == "edge"
    assert config["contexts"] == [{"name": "edge", "context": {"cluster": "edge", "user": "edge"}}]
    assert config["clusters"][0]["cluster"] == {"certificate-authority-data": "Q0E=", "server": "https://10.0.0.1:6443"}
    assert config["users"][0]["user"]["client-key-data"] == "S0VZ"


@pytest.mark.parametrize("text", ["", "[]", "clusters: []\nusers: []\n"])
def test_what_is_no_kubeconfig(text: str) -> None:
    with pytest.raises(SpecError, match="no kubeconfig"):
        _k3s_config.local_kubeconfig(text, "https://x:6443", "edge", SUM)
