# SPDX-License-Identifier: GPL-3.0-or-later
"""SSH: one key for the lab's user, one host key per host, and known_hosts, all made before the first boot."""

from __future__ import annotations

import io
import tarfile
import threading
from dataclasses import dataclass
from pathlib import Path

from .run import run

# Hosts boot in parallel, and each asks for the user's key.
_MAKING = threading.Lock()


@dataclass(frozen=True)
class Keys:
    """The key files of one lab, under its state directory."""

    directory: Path

    @property
    def private_key(self) -> Path:
        return self.directory / "id_ed25519"

    @property
    def known_hosts(self) -> Path:
        return self.directory / "known_hosts"

    def user_public(self) -> str:
        return _public(self.private_key, "rosops-lab")

    def host_public(self, host: str) -> str:
        return _public(self._host_key(host), host)

    def _host_key(self, host: str) -> Path:
        return self.directory / f"host-{host}"

    def write_known_hosts(self, addresses: dict[str, str]) -> None:
        lines = [f"{address} {' '.join(self.host_public(host).split()[:2])}\n" for host, address in addresses.items()]
        text = "".join(lines)
        if not self.known_hosts.exists() or self.known_hosts.read_text() != text:
            self.known_hosts.write_text(text)

    def host_files(self, host: str) -> bytes:
        """A tar of the files that a host needs before its SSH server starts."""
        self.host_public(host)
        buffer = io.BytesIO()
        with tarfile.open(fileobj=buffer, mode="w") as tar:
            _directory(tar, "root/.ssh", 0o700)
            _file(tar, "root/.ssh/authorized_keys", self.user_public().encode(), 0o600)
            _file(tar, "etc/ssh/ssh_host_ed25519_key", self._host_key(host).read_bytes(), 0o600)
            _file(tar, "etc/ssh/ssh_host_ed25519_key.pub", self.host_public(host).encode(), 0o644)
        return buffer.getvalue()

    def options(self) -> list[str]:
        """What ssh needs besides the user and the address; nothing of the user's own files is read or written."""
        return [
            *("-o", f"UserKnownHostsFile={ssh_quote(self.known_hosts)}"),
            *("-o", "GlobalKnownHostsFile=/dev/null"),
            *("-o", "StrictHostKeyChecking=yes"),
            *("-o", "IdentitiesOnly=yes"),
            *("-o", "ServerAliveInterval=5"),
            *("-o", "ServerAliveCountMax=3"),
        ]


def ssh_quote(path: Path) -> str:
    """A path as ssh's own option parser wants it: quoted against spaces, and no % of its own."""
    return '"' + str(path).replace("%", "%%") + '"'


def _public(key: Path, comment: str) -> str:
    """The public half; both are made where one is missing (an interruption can leave half a pair)."""
    public = key.with_name(f"{key.name}.pub")
    with _MAKING:
        if not (key.exists() and public.exists() and public.read_text().strip()):
            key.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            key.unlink(missing_ok=True)
            public.unlink(missing_ok=True)
            run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", comment, "-f", str(key)])
        return public.read_text()


def _directory(tar: tarfile.TarFile, name: str, mode: int) -> None:
    entry = tarfile.TarInfo(name)
    entry.type = tarfile.DIRTYPE
    entry.mode = mode
    tar.addfile(entry)


def _file(tar: tarfile.TarFile, name: str, content: bytes, mode: int) -> None:
    entry = tarfile.TarInfo(name)
    entry.size = len(content)
    entry.mode = mode
    tar.addfile(entry, io.BytesIO(content))
