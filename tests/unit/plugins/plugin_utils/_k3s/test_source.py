# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Binaries and archives of the releases, and of a directory with its manifest."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s.source import Artifacts, airgap_files, source

SUM = "b" * 64
MANIFEST = f"""{SUM}  k3s
{SUM} *k3s-arm64

{"c" * 64}  k3s-airgap-images-amd64.tar
{"d" * 64}  k3s-airgap-images-amd64.tar.zst
"""


@pytest.mark.parametrize(
    ("machine", "binary", "images"),
    [("x86_64", "k3s", "k3s-airgap-images-amd64.tar.zst"), ("aarch64", "k3s-arm64", None)],
)
def test_artifacts_of_a_machine(machine: str, binary: str, images: str | None) -> None:
    found = airgap_files(MANIFEST, machine)
    assert (found[0], found[1] and found[1].name) == ((binary, SUM), images)


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
        airgap_files(manifest, machine)


def test_a_directory_without_what_its_manifest_names(tmp_path: Path) -> None:
    variables = {"k3s_install_source": "airgap", "k3s_airgap_dir": str(tmp_path)}
    with pytest.raises(SpecError, match="SHA256SUMS cannot be read"):
        source(variables, "x86_64")
    (tmp_path / "SHA256SUMS").write_text(f"{SUM}  k3s\n")
    with pytest.raises(SpecError, match="k3s cannot be read: No such file"):
        source(variables, "x86_64")


RELEASE: dict[str, Any] = {
    "k3s_install_source": "release",
    "k3s_release_url": "https://mirror/k3s",
    "k3s_version": "v1.34.2+k3s1",
    "k3s_release_checksums": {"aarch64": SUM, "x86_64": None},
}


def test_a_release_has_its_version_in_its_path() -> None:
    found = source(RELEASE, "x86_64")
    assert found == Artifacts(
        url="https://mirror/k3s/v1.34.2%2Bk3s1/k3s", sums="https://mirror/k3s/v1.34.2%2Bk3s1/sha256sum-amd64.txt"
    )
    assert (source(RELEASE, "aarch64").url[-10:], source(RELEASE, "aarch64").sha256) == ("/k3s-arm64", SUM)


def test_an_archive_has_its_digest_in_its_name_on_the_host(tmp_path: Path) -> None:
    (tmp_path / "SHA256SUMS").write_text(MANIFEST)
    for name in ("k3s", "k3s-arm64", "k3s-airgap-images-amd64.tar.zst"):
        (tmp_path / name).write_text("abc")
    variables = {"k3s_install_source": "airgap", "k3s_airgap_dir": str(tmp_path)}
    found = source(variables, "x86_64")
    assert (found.path, found.sha256, found.url) == (str(tmp_path / "k3s"), SUM, "")
    assert (found.archive_name, found.archive_size) == (f"k3s-airgap-images-amd64-{'d' * 12}.tar.zst", 3)
    assert source(variables, "aarch64").archive_name == ""
