# SPDX-License-Identifier: GPL-3.0-or-later
"""Which files of k3s a rotation takes away, and when a certificate ends."""

from __future__ import annotations

import datetime
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._host.certificates import end_of, renewable
from ansible_collections.rosops.fleet.plugins.module_utils._host.k3s import Host
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec


def certificate(begins: str, ends: str) -> str:
    key, name = ec.generate_private_key(ec.SECP256R1()), x509.Name([])
    made = x509.CertificateBuilder().subject_name(name).issuer_name(name).public_key(key.public_key())
    made = made.serial_number(x509.random_serial_number()).not_valid_before(datetime.datetime.fromisoformat(begins))
    signed = made.not_valid_after(datetime.datetime.fromisoformat(ends)).sign(key, hashes.SHA256())
    return signed.public_bytes(serialization.Encoding.PEM).decode()


@pytest.mark.parametrize("ends", ["2027-11-26T08:09:10", "2049-12-31T23:59:59", "2051-01-01T00:00:00"])
def test_the_end_is_that_of_the_first_in_a_file(ends: str) -> None:
    """After it stands its authority, which ends years later."""
    assert end_of(certificate("2026-11-26T08:09:10", ends)) == ends
    both = certificate("2026-11-26T08:09:10", ends) + certificate("2020-01-01", "2036-01-01")
    assert end_of(both) == ends


@pytest.mark.parametrize("text", ["", "no", "-----BEGIN CERTIFICATE-----\nA\n-----END CERTIFICATE-----\n"])
def test_what_is_none_has_no_end(text: str) -> None:
    assert end_of(text) == ""


def test_the_keys_of_authorities_and_of_accounts_are_none_of_them(tmp_path: Path) -> None:
    data = tmp_path / "var/lib/rancher/k3s"
    there = [
        "agent/client-ca.crt", "agent/client-kubelet.crt", "agent/client-kubelet.key", "agent/kubelet.kubeconfig",
        "server/tls/client-ca.key", "server/tls/client-ca.nochain.crt", "server/tls/client-admin.crt",
        "server/tls/dynamic-cert.json", "server/tls/service.key", "server/tls/etcd/peer-ca.crt",
        "server/tls/etcd/client.crt", "server/tls/temporary-certs/loopback.crt",
    ]  # fmt: skip
    for name in there:
        (data / name).parent.mkdir(parents=True, exist_ok=True)
        (data / name).touch()
    assert [name.removeprefix("/var/lib/rancher/k3s/") for name in renewable(Host(str(tmp_path)))] == [
        "agent/client-kubelet.crt", "agent/client-kubelet.key", "server/tls/client-admin.crt",
        "server/tls/etcd/client.crt",
    ]  # fmt: skip
