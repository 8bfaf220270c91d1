# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The kubeconfig for use elsewhere."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.kubeconfig import (
    is_foreign,
    is_made_from,
    keep,
    local_kubeconfig,
    url_at,
)

SUM = "b" * 64
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
    text = local_kubeconfig(ADMIN, "https://10.0.0.1:6443", "edge", SUM)
    assert text.splitlines()[0] == f"# rosops.fleet: edge at https://10.0.0.1:6443, from k3s.yaml sha256:{SUM}"
    config = yaml.safe_load(text)
    assert config["current-context"] == "edge"
    assert config["contexts"] == [{"name": "edge", "context": {"cluster": "edge", "user": "edge"}}]
    assert config["clusters"][0]["cluster"] == {"certificate-authority-data": "Q0E=", "server": "https://10.0.0.1:6443"}
    assert config["users"][0]["user"]["client-key-data"] == "S0VZ"


def test_one_that_the_role_wrote_is_not_somebody_elses(tmp_path: Path) -> None:
    path = tmp_path / "edge.yaml"
    path.write_text(local_kubeconfig(ADMIN, "https://10.0.0.1:6443", "edge", SUM))
    assert not is_foreign(str(path))
    assert not is_foreign(str(tmp_path / "none"))


def test_the_port_is_the_servers_own() -> None:
    assert url_at(ADMIN, "[2001:db8::1]") == "https://[2001:db8::1]:6443"
    assert url_at(ADMIN.replace(":6443", ""), "edge1") == "https://edge1:443"


@pytest.mark.parametrize("text", ["", "[]", "clusters: []\nusers: []\n"])
def test_what_is_no_kubeconfig(text: str) -> None:
    with pytest.raises(SpecError, match="no kubeconfig"):
        local_kubeconfig(text, "https://x:6443", "edge", SUM)


def test_it_is_kept_for_its_owner_only_and_written_once(tmp_path: Path) -> None:
    path = tmp_path / "new" / "edge.yaml"
    assert keep(str(path), "# head\na: 1\n", check=True)
    assert not path.parent.exists()
    assert [keep(str(path), "# head\na: 1\n") for _run in range(2)] == [True, False]
    assert [place.stat().st_mode & 0o777 for place in (path.parent, path)] == [0o700, 0o600]
    assert [entry.name for entry in path.parent.iterdir()] == ["edge.yaml"]
    assert is_made_from(str(path), "# head")
    assert not is_made_from(str(path), "# hea")
    assert not is_made_from(str(tmp_path / "none"), "# head")
    assert is_foreign(str(path))
    path.chmod(0o644)
    assert keep(str(path), "# head\na: 1\n")


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(SpecError, match=r"file/edge.yaml cannot be written on the control node: "):
        keep(str(tmp_path / "file" / "edge.yaml"), "a: 1\n")
