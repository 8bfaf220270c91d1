# SPDX-License-Identifier: GPL-3.0-or-later
"""An API server with TLS, and the account that a pod has with it."""

from __future__ import annotations

import datetime
import ipaddress
import ssl
from pathlib import Path

from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID


def certificate() -> tuple[bytes, bytes]:
    """A server's certificate that is its own authority, and its key."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "api")])
    now, day = datetime.datetime.now(datetime.UTC), datetime.timedelta(days=1)
    address = x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address("127.0.0.1"))])
    made = (
        x509.CertificateBuilder(name, name, key.public_key(), x509.random_serial_number(), now - day, now + day)
        .add_extension(address, critical=False)
        .add_extension(x509.BasicConstraints(ca=True, path_length=None), critical=True)
        .sign(key, hashes.SHA256())
    )
    plain = serialization.NoEncryption()
    private = key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, plain)
    return made.public_bytes(serialization.Encoding.PEM), private


def start_server(directory: Path, namespace: str) -> Server:
    """An API server on loopback; `directory` becomes the account, as it is mounted in a pod of that namespace."""
    if not (directory / "ca.crt").exists():
        public, private = certificate()
        (directory / "ca.crt").write_bytes(public)
        (directory / "server.pem").write_bytes(public + private)
        (directory / "token").write_text("first\n")
        (directory / "namespace").write_text(namespace)
    made = Server()
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(directory / "server.pem")
    made.socket = context.wrap_socket(made.socket, server_side=True)
    made.put(f"/api/v1/namespaces/{namespace}", {"metadata": {}})
    return made


def environment(server: Server) -> dict[str, str]:
    """What Kubernetes tells every pod."""
    return {"KUBERNETES_SERVICE_HOST": "127.0.0.1", "KUBERNETES_SERVICE_PORT": str(server.server_address[1])}
