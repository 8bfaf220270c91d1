# SPDX-License-Identifier: GPL-3.0-or-later
"""Binaries and archives of the releases, and of a directory with its manifest; which tokens a host keeps."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s.wanted import Artifacts, source, tokens_to_keep

SUM = "b" * 64
MANIFEST = f"""{SUM}  k3s
{SUM} *k3s-arm64

{"c" * 64}  k3s-airgap-images-amd64.tar
{"d" * 64}  k3s-airgap-images-amd64.tar.zst
"""


def airgap(directory: Path, manifest: str = MANIFEST) -> dict[str, Any]:
    """The variables for a directory with what the manifest names."""
    (directory / "SHA256SUMS").write_text(manifest)
    for name in ("k3s", "k3s-arm64", "k3s-airgap-images-amd64.tar.zst"):
        (directory / name).write_text("abc")
    return {"k3s_install_source": "airgap", "k3s_airgap_dir": str(directory)}


def test_what_a_directory_has_for_a_machine(tmp_path: Path) -> None:
    found, path = source(airgap(tmp_path), "x86_64"), str(tmp_path / "k3s-airgap-images-amd64.tar.zst")
    on_the_host = f"k3s-airgap-images-amd64-{'d' * 12}.tar.zst"  # with its digest; of several packings the smallest
    assert found == Artifacts(SUM, str(tmp_path / "k3s"), "", "", on_the_host, path, "d" * 64, 3)
    assert source(airgap(tmp_path), "aarch64") == Artifacts(SUM, str(tmp_path / "k3s-arm64"))


@pytest.mark.parametrize(
    ("manifest", "gone", "message"),
    [
        ("<html>404</html>\n", "", "line 1, is no line of sha256sum"),
        ("", "", "no line for k3s, which hosts of x86_64 need"),
        (MANIFEST, "SHA256SUMS", "SHA256SUMS cannot be read: No such file"),
        (MANIFEST, "k3s", "k3s cannot be read: No such file"),
        (MANIFEST, "k3s-airgap-images-amd64.tar.zst", "amd64.tar.zst cannot be read: No such file"),
    ],
)
def test_a_directory_that_will_not_do(tmp_path: Path, manifest: str, gone: str, message: str) -> None:
    variables = airgap(tmp_path, manifest)
    (tmp_path / (gone or "k3s")).unlink()
    with pytest.raises(SpecError, match=message):
        source(variables, "x86_64")


RELEASE: dict[str, Any] = {
    "k3s_install_source": "release", "k3s_release_url": "https://mirror/k3s", "k3s_version": "v1.34.2+k3s1",
    "k3s_release_checksums": {"aarch64": SUM, "x86_64": None},
}  # fmt: skip


def test_a_release_has_its_version_in_its_path() -> None:
    found = source(RELEASE, "x86_64")
    assert found == Artifacts(
        url="https://mirror/k3s/v1.34.2%2Bk3s1/k3s", sums="https://mirror/k3s/v1.34.2%2Bk3s1/sha256sum-amd64.txt"
    )
    assert (source(RELEASE, "aarch64").url[-10:], source(RELEASE, "aarch64").sha256) == ("/k3s-arm64", SUM)


# --- tokens -----------------------------------------------------------------------------------------------------------

FULL = f"K10{'a' * 64}::node:s3cret"
AWAY = {"unreachable": True, "item": ["edge1", "agent-token"]}
GIVEN = {
    "source": "/var/lib/rancher/k3s/server/agent-token",
    "content": base64.b64encode(f"{FULL}\n".encode()).decode(),
}
READ = [AWAY, GIVEN]


def variables(token: str = "", agent: str = "") -> dict[str, Any]:
    return {"k3s_cluster": "edge", "k3s_token": token, "k3s_agent_token": agent}


@pytest.mark.parametrize("given", ["", "s3cret", FULL])
def test_a_member_keeps_the_clusters_full_token(given: str) -> None:
    assert tokens_to_keep(["agent-token"], READ, variables("unread", given)) == {"agent-token": FULL}


def test_one_that_is_not_the_clusters_is_refused_and_not_shown() -> None:
    with pytest.raises(SpecError, match=r"^k3s_agent_token is not the one that the cluster edge runs with") as caught:
        tokens_to_keep(["agent-token"], READ, variables("", "0ther"))
    assert "0ther" not in str(caught.value)


def test_a_new_cluster_takes_the_inventorys_or_makes_its_own() -> None:
    names = ["token", "agent-token"]
    first, second = (tokens_to_keep(names, [], variables("", "given")) for _run in range(2))
    assert first["agent-token"] == "given"
    assert len(first["token"]) == 48
    assert first["token"].isalnum()
    assert first["token"] != second["token"]
