# SPDX-License-Identifier: GPL-3.0-or-later
"""The kubeconfig for use elsewhere."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.access import access_from
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.client import Kube
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.kubeconfig import (
    first_line,
    is_foreign,
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


def test_the_kubeconfig_names_the_cluster_and_says_what_it_was_made_from(tmp_path: Path) -> None:
    text = local_kubeconfig(ADMIN, "https://10.0.0.1:6443", "edge", SUM)
    assert text.splitlines()[0] == f"# rosops.fleet: edge at https://10.0.0.1:6443, from k3s.yaml sha256:{SUM}"
    (tmp_path / "edge.yaml").write_text(text)
    assert not is_foreign(str(tmp_path / "edge.yaml"))
    config = yaml.safe_load(text)
    assert config["current-context"] == "edge"
    assert config["contexts"] == [{"name": "edge", "context": {"cluster": "edge", "user": "edge"}}]
    assert config["clusters"][0]["cluster"] == {"certificate-authority-data": "Q0E=", "server": "https://10.0.0.1:6443"}
    assert config["users"][0]["user"]["client-key-data"] == "S0VZ"


def hostile(proof: Path, user: str = "client-certificate-data: Q0VSVA==, client-key-data: S0VZ") -> str:
    """What somebody with root on a server would write there."""
    return f"""clusters:
- name: default
  cluster:
    server: "https://evil.example.org:6444"
    insecure-skip-tls-verify: true
    tls-server-name: evil.example.org
    proxy-url: http://evil.example.org:3128
    certificate-authority: /root/.ssh/id_ed25519
    certificate-authority-data: Q0E=
users:
- name: default
  user:
    {{{user},
     exec: {{apiVersion: client.authentication.k8s.io/v1, command: sh, args: [-c, "id > {proof}"]}},
     auth-provider: {{name: gcp, config: {{cmd-path: sh, cmd-args: "-c id", expiry: ""}}}},
     client-certificate: /root/.ssh/id_ed25519, client-key: /root/.ssh/id_ed25519, tokenFile: /etc/shadow,
     as: somebody, username: admin, password: admin}}
"""


def test_of_a_hostile_one_nothing_but_authority_and_credentials_is_taken(tmp_path: Path) -> None:
    """A client runs the command of such a file, and leaves the certificate of its server unchecked."""
    text = hostile(tmp_path / "proof")
    config = yaml.safe_load(local_kubeconfig(text, url_at(text, "10.0.0.1"), "robot1"))
    assert config["clusters"][0]["cluster"] == {"certificate-authority-data": "Q0E=", "server": "https://10.0.0.1:6444"}
    assert config["users"][0]["user"] == {"client-certificate-data": "Q0VSVA==", "client-key-data": "S0VZ"}
    keep(str(tmp_path / "robot1.yaml"), local_kubeconfig(text, url_at(text, "10.0.0.1"), "robot1"))
    access = access_from({"kubeconfig": str(tmp_path / "robot1.yaml")}, environment=False)
    assert not (tmp_path / "proof").exists()
    configuration = access.configuration
    assert (configuration.host, configuration.verify_ssl) == ("https://10.0.0.1:6444", True)
    assert (configuration.proxy, configuration.username, configuration.api_key) == (None, None, {})
    assert Path(configuration.key_file).read_text() == "KEY"
    Kube(access).close()


@pytest.mark.parametrize("user", [
    "username: a", "client-key-data: S0VZ", "client-certificate-data: Q0VSVA==", 'token: ""', "token: [t]",
    "client-certificate-data: {a: b}, client-key-data: S0VZ",
])  # fmt: skip
def test_without_credentials_of_its_own_it_gives_no_access(tmp_path: Path, user: str) -> None:
    text = hostile(tmp_path / "proof", user)
    with pytest.raises(SpecError, match="neither client-certificate-data with client-key-data nor a token"):
        local_kubeconfig(text, "https://10.0.0.1:6443", "robot1")


def test_a_token_stays_what_it_is(tmp_path: Path) -> None:
    config = yaml.safe_load(local_kubeconfig(hostile(tmp_path, "token: 0123"), "https://10.0.0.1:6443", "robot1"))
    assert config["users"][0]["user"] == {"token": "0123"}


@pytest.mark.parametrize("url", ["https://x:six", "https://x:99999999", "file:///etc/shadow", ""])
def test_a_server_that_is_none(url: str) -> None:
    with pytest.raises(SpecError, match=r"k3s.yaml names no (port|http or https URL) of its API"):
        url_at(ADMIN.replace("https://127.0.0.1:6443", url), "10.0.0.1")


def test_a_kubeconfig_that_would_fill_the_memory_is_read_in_no_time() -> None:
    """Each line doubles the one before: a thousand million entries, were they merged."""
    lines = ["m0: &m0 {a: b}", *(f"m{n}: &m{n} {{<<: [*m{n - 1}, *m{n - 1}]}}" for n in range(1, 31))]
    assert url_at("\n".join([*lines, ADMIN]), "10.0.0.1") == "https://10.0.0.1:6443"
    with pytest.raises(SpecError, match="no kubeconfig"):
        url_at("[" * 500, "10.0.0.1")


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
    assert (first_line(str(path)), first_line(str(tmp_path / "none"))) == ("# head", "")
    assert is_foreign(str(path)) and not is_foreign(str(tmp_path / "none"))
    path.chmod(0o644)
    assert keep(str(path), "# head\na: 1\n")
    for theirs in (b"# \xe9\n", b"\napiVersion: v1\n"):  # somebody's, of another encoding, or with an empty line first
        path.write_bytes(theirs)
        assert is_foreign(str(path)) and keep(str(path), "# head\na: 1\n")


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(SpecError, match=r"file/edge.yaml cannot be written on the control node: "):
        keep(str(tmp_path / "file" / "edge.yaml"), "a: 1\n")
    (tmp_path / "edge.yaml").mkdir()
    with pytest.raises(SpecError, match=r"edge.yaml cannot be written"):
        keep(str(tmp_path / "edge.yaml"), "a: 1\n")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["edge.yaml", "file"]
