# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of a cluster's first server, its other servers and its agents; binaries, archives and tokens."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s.wanted import (
    PLAIN,
    Artifacts,
    Datastore,
    Wanted,
    join_url,
    source,
    tokens_to_keep,
    wanted,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.role_specs import role_options

HOSTVARS: dict[str, dict[str, str]] = {"edge1": {"ansible_host": "10.0.0.1"}, "edge2": {}, "robot1": {}}


def variables(host: str, **given: Any) -> dict[str, Any]:
    defaults = {name: option.get("default") for name, option in role_options("k3s").items()}
    role = "agent" if host == "robot1" else "server"
    fleet = {"k3s_role": role, "k3s_cluster": "edge", "k3s_server_hosts": ["edge1", "edge2"], "k3s_node_name": host}
    return {**defaults, **fleet, "k3s_kubeconfig_path": "/kube/edge.yaml", **given}


def part(host: str, joins: str = "", datastore: Datastore = PLAIN, **given: Any) -> Wanted:
    return wanted(variables(host, **given), host, HOSTVARS, joins, datastore)


def config(host: str, **given: Any) -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load(part(host, **given).files[0].content)
    return found


SERVER = {
    "write-kubeconfig-mode": "0600", "disable": ["traefik", "servicelb"], "token-file": "/etc/rancher/k3s/token",
    "agent-token-file": "/etc/rancher/k3s/agent-token",
}  # fmt: skip


def test_the_configuration_of_each_part() -> None:
    assert config("edge1") == {**SERVER, "node-name": "edge1", "tls-san": ["10.0.0.1", "edge1"], "cluster-init": True}
    join = {"server": "https://10.0.0.1:6443"}
    assert config("edge2") == {**SERVER, "node-name": "edge2", "tls-san": ["edge2"], **join}
    assert config("robot1") == {"node-name": "robot1", "token-file": "/etc/rancher/k3s/agent-token", **join}


@pytest.mark.parametrize(
    ("servers", "etcd", "given", "init"),
    [
        (["edge1"], False, {}, False),  # SQLite, which a robot of its own and an edge of one have for ever
        (["edge1"], True, {}, True),  # it had etcd, and there is no way back
        (["edge1", "edge2", "edge3"], False, {}, True),  # two more come: k3s takes SQLite's rows over
        (["edge1"], True, {"cluster-init": None}, False),
    ],
)
def test_etcd_is_for_several_servers_and_stays_where_it_is(
    servers: list[str], etcd: bool, given: dict[str, Any], init: bool
) -> None:
    found = config("edge1", datastore=Datastore(etcd), k3s_server_hosts=servers, k3s_config=given)
    assert found.get("cluster-init", False) is init
    assert "server" not in found


@pytest.mark.parametrize(
    ("host", "encrypts", "given", "said"),
    [
        ("edge1", True, {}, True),
        ("edge2", True, {}, True),  # k3s takes in no server that has another one
        ("edge1", False, {}, None),  # a cluster of before: its configuration is the same text as ever
        ("edge1", True, {"secrets-encryption": False}, False),
    ],
)
def test_secrets_are_encrypted_where_the_datastore_is_so(
    host: str, encrypts: bool, given: dict[str, Any], said: bool | None
) -> None:
    file = part(host, datastore=Datastore(encrypts=encrypts), k3s_config=given).files[0]
    assert yaml.safe_load(file.content).get("secrets-encryption") is said
    assert not file.secret  # whether they are is none


HARDENED_API = [
    "audit-log-path=/var/lib/rancher/k3s/server/logs/audit.log",
    "audit-policy-file=/etc/rancher/k3s/rosops-fleet-audit.yaml",
    "audit-log-maxage=30",
    "audit-log-maxbackup=10",
    "audit-log-maxsize=100",
    "service-account-extend-token-expiration=false",
]
CIPHERS = (
    "tls-cipher-suites=TLS_ECDHE_ECDSA_WITH_AES_256_GCM_SHA384,TLS_ECDHE_RSA_WITH_AES_256_GCM_SHA384,"
    "TLS_ECDHE_ECDSA_WITH_AES_128_GCM_SHA256,TLS_ECDHE_RSA_WITH_AES_128_GCM_SHA256,"
    "TLS_ECDHE_ECDSA_WITH_CHACHA20_POLY1305,TLS_ECDHE_RSA_WITH_CHACHA20_POLY1305"
)
KUBELET = ["streaming-connection-idle-timeout=5m", CIPHERS]
SYSCTLS, AUDIT_POLICY = "/etc/sysctl.d/90-rosops-fleet.conf", "/etc/rancher/k3s/rosops-fleet-audit.yaml"


def test_what_hardening_adds_to_the_configuration() -> None:
    """As the guide has it; an agent has no API server."""
    agent = {"protect-kernel-defaults": True, "kubelet-arg": KUBELET}
    server = {"kube-apiserver-arg": HARDENED_API, "kube-controller-manager-arg": ["terminated-pod-gc-threshold=100"]}
    assert config("edge1", k3s_hardening=True) == {**config("edge1"), **agent, **server}
    assert config("edge2", k3s_hardening=True) == {**config("edge2"), **agent, **server}
    assert config("robot1", k3s_hardening=True) == {**config("robot1"), **agent}


def test_what_the_operator_says_of_the_same_counts() -> None:
    own: dict[str, Any] = {
        "kubelet-arg": ["streaming-connection-idle-timeout=1h"],
        "kube-apiserver-arg": "audit-log-maxage=7",
        "kube-controller-manager-arg": None,
        "protect-kernel-defaults": False,
    }
    found = config("edge1", k3s_hardening=True, k3s_config=own)
    assert found["kubelet-arg"] == [*KUBELET, *own["kubelet-arg"]]  # of two the kubelet takes the last
    assert found["kube-apiserver-arg"] == [*HARDENED_API, "audit-log-maxage=7"]
    assert "kube-controller-manager-arg" not in found
    assert found["protect-kernel-defaults"] is False
    assert config("edge1", k3s_config=own)["kubelet-arg"] == own["kubelet-arg"]


@pytest.mark.parametrize(("host", "audits"), [("edge1", True), ("robot1", False)])
def test_the_files_of_hardening(host: str, audits: bool) -> None:
    found = part(host, k3s_hardening=True)
    kernel, audit = found.files[4:]
    settings = [line for line in kernel.content.splitlines() if not line.startswith("#")]
    assert settings == ["vm.panic_on_oom=0", "vm.overcommit_memory=1", "kernel.panic=10", "kernel.panic_on_oops=1"]
    assert (kernel.path, kernel.mode, audit.path, audit.mode) == (SYSCTLS, "0644", AUDIT_POLICY, "0600")
    assert bool(audit.content) is audits
    if audits:  # all requests but the nodes' heartbeats, and of none what is in it
        policy = yaml.safe_load(audit.content)
        assert (policy["apiVersion"], policy["kind"]) == ("audit.k8s.io/v1", "Policy")
        assert policy["rules"] == [{"level": "None", "namespaces": ["kube-node-lease"]}, {"level": "Metadata"}]
    # k3s starts again for another one, and sets the kernel before the kubelet looks at it
    assert (SYSCTLS in found.started_with, AUDIT_POLICY in found.started_with) == (True, audits)
    assert f"ExecStartPre=-/sbin/sysctl -p {SYSCTLS}" in found.files[1].content.splitlines()


def test_the_operators_own_configuration_comes_last_and_null_takes_a_key_out() -> None:
    found = config("robot1", k3s_config={"server": None, "node-ip": "10.0.0.9"}, k3s_node_ip="10.0.0.8")
    assert found == {"node-name": "robot1", "token-file": "/etc/rancher/k3s/agent-token", "node-ip": "10.0.0.9"}


def test_an_endpoint_in_front_of_the_servers_is_joined_and_in_the_certificate() -> None:
    found = part("edge2", k3s_api_endpoint="api.lan", k3s_tls_sans=["more", "edge2"], k3s_node_ip="10.0.0.2,fd00::2")
    assert found.url == "https://api.lan:6443"
    assert yaml.safe_load(found.files[0].content)["tls-san"] == ["10.0.0.2", "edge2", "api.lan", "more"]


@pytest.mark.parametrize(("key", "value", "secret"), [
    ("etcd-s3-secret-key", "x", True), ("etcd-s3-access-key", "x", True), ("etcd-s3-proxy", "x", True),
    ("datastore-endpoint", "x", True), ("agent-token", "x", True), ("vpn-auth", "name=tailscale,joinKey=x", True),
    ("vpn-auth", "x", True), ("kube-apiserver-arg", ["oidc-client-secret=x"], True),
    ("kube-controller-manager-arg", ["cloud=https://me:x@example.org"], True),
    ("kubelet-arg", ["max-pods=20"], False), ("vpn-auth-file", "/etc/vpn", False), ("token-file", "x", False),
])  # fmt: skip
def test_a_configuration_with_a_secret_is_not_shown(key: str, value: Any, secret: bool) -> None:
    assert part("robot1", k3s_config={key: value}).files[0].secret is secret


def test_a_host_forgets_pods_that_have_ended_whatever_k3s_is_on_it() -> None:
    """And k3s does not start again for that."""
    for host in HOSTVARS:
        found = part(host)
        (file,) = found.beside
        assert (file.path, file.mode) == ("/etc/sysctl.d/90-rosops-fleet-cni0.conf", "0644")
        assert "net.ipv4.neigh.cni0.base_reachable_time_ms=2000\n" in file.content
        assert file.path not in found.started_with
        assert file not in found.files


def test_an_ipv6_address_is_one_in_the_certificate() -> None:
    found = wanted(variables("edge1"), "edge1", {**HOSTVARS, "edge1": {"ansible_host": "2001:db8::1"}})
    assert yaml.safe_load(found.files[0].content)["tls-san"] == ["2001:db8::1", "edge1"]
    assert found.url == "https://[2001:db8::1]:6443"


def test_what_is_not_asked_for_is_not_to_be_there_and_no_k3s_is_started_anew_for_it() -> None:
    for found in map(part, HOSTVARS):
        empty = [file.path for file in found.files if not file.content]
        assert empty == ["/etc/rancher/k3s/registries.yaml", "/etc/rancher/k3s/environment", SYSCTLS, AUDIT_POLICY]
        assert "sysctl" not in found.files[1].content
        assert not {SYSCTLS, AUDIT_POLICY} & set(found.started_with)
    assert [part(host).kubeconfig for host in HOSTVARS] == ["/kube/edge.yaml", "", ""]
    assert part("edge1", k3s_kubeconfig_path="").kubeconfig == ""


@pytest.mark.parametrize(
    ("host", "given", "limits"),
    [
        # beside the pods, or not at all; an agent has a small one by itself
        ("edge1", {"k3s_cpu_weight": "30"}, ["Slice=-.slice", "CPUWeight=30", "LimitNOFILE=1048576"]),
        ("robot1", {}, ["Slice=-.slice", "CPUWeight=10", "LimitNOFILE=1048576"]),
        ("robot1", {"k3s_cpu_weight": ""}, ["LimitNOFILE=1048576", "LimitNPROC=infinity", "LimitCORE=infinity"]),
        ("edge1", {}, ["LimitNOFILE=1048576", "LimitNPROC=infinity", "LimitCORE=infinity"]),
    ],
)
def test_the_weight_of_k3s(host: str, given: dict[str, str], limits: list[str]) -> None:
    lines = part(host, **given).files[1].content.splitlines()
    assert lines[lines.index("Delegate=yes") + 1 :][:3] == limits


def test_the_environment_is_sorted_and_quoted_and_secret() -> None:
    file = part("robot1", k3s_environment={"b": 'é"\\n', "A": 1, "C": True, "HTTP_PROXY": None}).files[3]
    assert file.content.splitlines()[1:] == ['A="1"', 'b="é\\"\\\\n"', 'C="True"']
    assert file.secret


def test_the_unit_records_what_it_starts_with() -> None:
    agent = part("robot1", k3s_cpu_weight="")
    unit = agent.files[1]
    assert (unit.path, unit.mode) == ("/etc/systemd/system/k3s-agent.service", "0644")
    record = (
        'ExecStartPre=-/bin/sh -c \'stat -c "%%n %%i %%s %%Y" /etc/rancher/k3s/config.yaml '
        "/etc/systemd/system/k3s-agent.service /etc/rancher/k3s/registries.yaml /etc/rancher/k3s/environment "
        "/etc/rancher/k3s/agent-token /usr/local/bin/k3s >/run/rosops-fleet-k3s-agent.started 2>/dev/null'"
    )
    assert record in unit.content.splitlines()


NEW = {"data": False, "server_url": "", "answering": []}


@pytest.mark.parametrize(
    ("now", "url"),
    [
        (NEW, "https://10.0.0.1:6443"),
        ({**NEW, "answering": ["edge2:6443"]}, "https://edge2:6443"),
        ({**NEW, "answering": ["10.0.0.1:6443", "edge2:6443"]}, "https://10.0.0.1:6443"),
        # cut off before it had joined
        ({**NEW, "server_url": "https://10.0.0.1:6443", "answering": ["edge2:6443"]}, "https://edge2:6443"),
        # the first server is away, or no longer the first
        ({"data": True, "server_url": "https://edge2:6443", "answering": []}, "https://edge2:6443"),
        # its server is none any more
        ({"data": True, "server_url": "https://edge9:6443", "answering": []}, "https://10.0.0.1:6443"),
    ],
)
def test_a_member_joins_a_server_that_lives_and_stays_with_it(now: dict[str, Any], url: str) -> None:
    known = variables("robot1")
    assert join_url(known, HOSTVARS, now) == url
    assert join_url({**known, "k3s_api_endpoint": "api.lan"}, HOSTVARS, now) == "https://api.lan:6443"
    assert join_url({**known, "k3s_api_endpoint": "fd00::5"}, HOSTVARS, now) == "https://[fd00::5]:6443"
    assert config("robot1", joins=url)["server"] == url


# --- where it comes from ----------------------------------------------------------------------------------------------

SUM = "b" * 64
MANIFEST = f"""{SUM}  k3s
{SUM} *k3s-arm64

{"c" * 64}  k3s-airgap-images-amd64.tar
{"d" * 64}  k3s-airgap-images-amd64.tar.zst
"""


def airgap(directory: Path, manifest: str = MANIFEST) -> dict[str, Any]:
    """The variables for a directory with what the manifest names."""
    (directory / "SHA256SUMS").write_bytes(manifest.encode("utf-8", "surrogateescape"))
    for name in ("k3s", "k3s-arm64", "k3s-airgap-images-amd64.tar.zst"):
        (directory / name).write_text("abc")
    return {"k3s_install_source": "airgap", "k3s_airgap_dir": str(directory)}


def test_what_a_directory_has_for_a_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found, path = source(airgap(tmp_path), "x86_64"), str(tmp_path / "k3s-airgap-images-amd64.tar.zst")
    on_the_host = f"k3s-airgap-images-amd64-{'d' * 12}.tar.zst"  # with its digest; of several packings the smallest
    assert found == Artifacts(SUM, str(tmp_path / "k3s"), "", "", on_the_host, path, "d" * 64, 3)
    monkeypatch.chdir(tmp_path.parent)
    relative = {**airgap(tmp_path), "k3s_airgap_dir": tmp_path.name}
    assert source(relative, "aarch64") == Artifacts(SUM, str(tmp_path / "k3s-arm64"))


@pytest.mark.parametrize(
    ("manifest", "gone", "message"),
    [
        ("<html>404</html>\n", "", "line 1, is no line of sha256sum"),
        ("\udcff\udcfe3\0", "", "line 1, is no line of sha256sum"),  # as PowerShell writes it
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


# --- tokens ----------------------------------------------------------------------------------------------------------

FULL = f"K10{'a' * 64}::node:s3cret"
AWAY = {"unreachable": True, "item": ["edge1", "agent-token"]}
GIVEN = {
    "source": "/var/lib/rancher/k3s/server/agent-token",
    "content": base64.b64encode(f"{FULL}\n".encode()).decode(),
}
READ = [AWAY, GIVEN]


def tokens(token: str = "", agent: str = "") -> dict[str, Any]:
    return {"k3s_cluster": "edge", "k3s_token": token, "k3s_agent_token": agent}


@pytest.mark.parametrize("given", ["", "s3cret", FULL])
def test_a_member_keeps_the_clusters_full_token(given: str) -> None:
    assert tokens_to_keep(["agent-token"], READ, tokens("unread", given)) == {"agent-token": FULL}


def test_one_that_is_not_the_clusters_is_refused_and_not_shown() -> None:
    with pytest.raises(SpecError, match=r"^k3s_agent_token is not the one that the cluster edge runs with") as caught:
        tokens_to_keep(["agent-token"], READ, tokens("", "0ther"))
    assert "0ther" not in str(caught.value)


def test_a_new_cluster_takes_the_inventorys_or_makes_its_own() -> None:
    names = ["token", "agent-token"]
    first, second = (tokens_to_keep(names, [], tokens("", "given")) for _run in range(2))
    assert first["agent-token"] == "given"
    assert len(first["token"]) == 48
    assert first["token"].isalnum()
    assert first["token"] != second["token"]
