# SPDX-License-Identifier: GPL-3.0-or-later
"""The kubeconfig of a cluster on the control node, made from one of its servers'."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable
from pathlib import Path
from urllib.parse import urlsplit

import yaml

from ...module_utils._common.errors import SpecError
from ...module_utils._step.objects import Object

HEAD = "# rosops.fleet: "
AUTHORITY = "certificate-authority-data"
LONGEST = 1 << 20  # characters of the file of a host
CERTIFICATE, TOKEN = ("client-certificate-data", "client-key-data"), ("token",)


def local_kubeconfig(text: str, server: str, cluster: str, source: str = "") -> str:
    """k3s's kubeconfig for use elsewhere: the server's real address, everything named after the cluster.

    Whoever is root on the server writes that file, and a client obeys all of a kubeconfig: it runs commands, reads
    files, leaves certificates unchecked. So the authority and the credentials are taken, as plain text, and nothing
    else. The first line says what it was made from, so that a look at it tells whether it must be made again.
    """
    said_cluster, said_user = _parts(text)
    inner, user = _texts(said_cluster, (AUTHORITY,)), _texts(said_user, (*CERTIFICATE, *TOKEN))
    if not any(user.keys() >= set(kind) for kind in (CERTIFICATE, TOKEN)):
        raise SpecError(
            f"the server's k3s.yaml has neither {' with '.join(CERTIFICATE)} nor a token, and nothing else of it is "
            "taken. k3s writes it anew when its service restarts"
        )
    config = {
        "apiVersion": "v1",
        "kind": "Config",
        "clusters": [{"name": cluster, "cluster": {**inner, "server": server}}],
        "users": [{"name": cluster, "user": user}],
        "contexts": [{"name": cluster, "context": {"cluster": cluster, "user": cluster}}],
        "current-context": cluster,
    }
    return f"{kubeconfig_head(source, server, cluster)}\n{yaml.safe_dump(config, sort_keys=True)}"


def url_at(text: str, host: str) -> str:
    """The URL of a server at `host`: its kubeconfig, which has the loopback's there, says scheme and port alone."""
    try:
        url = urlsplit(str(_parts(text)[0].get("server")))
        port = url.port or 443
    except ValueError as error:
        raise SpecError("the server's k3s.yaml names no port of its API") from error
    if url.scheme not in ("https", "http"):
        raise SpecError("the server's k3s.yaml names no http or https URL of its API")
    return f"{url.scheme}://{host}:{port}"


def _parts(text: str) -> tuple[Object, Object]:
    """The first cluster and the first user."""
    try:
        if len(text) > LONGEST:
            raise ValueError("it is too long")
        # Texts, lists and mappings alone. The safe loader merges mappings, and a few lines of merges fill the memory.
        document = yaml.load(text, Loader=yaml.BaseLoader)  # noqa: S506 - it makes no objects either
        return dict(document["clusters"][0]["cluster"]), dict(document["users"][0]["user"])
    except (yaml.YAMLError, TypeError, KeyError, IndexError, ValueError, RecursionError) as error:
        raise SpecError("the server's k3s.yaml is no kubeconfig") from error


def _texts(said: Object, names: Iterable[str]) -> dict[str, str]:
    return {name: said[name] for name in names if isinstance(said.get(name), str) and said[name]}


def kubeconfig_head(source: str, server: str, cluster: str) -> str:
    """The first line; `source` is the SHA-256 of the server's k3s.yaml; without it the line begins so."""
    return f"{HEAD}{cluster} at {server}, from k3s.yaml sha256:{source}"


def is_foreign(path: str) -> bool:
    """Whether the file is there and somebody else's: it is used, and not written over."""
    return not (_begin(path) or HEAD).startswith(HEAD)


def first_line(path: str) -> str:
    """Empty where there is no such file."""
    return _begin(path).rstrip("\n")


def _begin(path: str) -> str:
    """Its first line with the end of that: one of somebody's may be empty."""
    try:
        with Path(path).open(encoding="utf-8", errors="replace") as file:
            return file.readline()
    except OSError:
        return ""


def keep(path: str, text: str, check: bool = False) -> bool:
    """Write the file for its owner only, all at once, in a directory that is made likewise; whether that changes it."""
    place = Path(path)
    try:
        if place.is_file() and place.read_bytes() == text.encode() and place.stat().st_mode & 0o777 == 0o600:
            return False
        if not check:
            place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            handle, temporary = tempfile.mkstemp(dir=place.parent, prefix=f".{place.name}.")  # mode 0600
            try:
                with os.fdopen(handle, "w", encoding="utf-8") as file:
                    file.write(text)
                Path(temporary).replace(place)
            finally:  # a full disk, say: nobody would look for it there
                Path(temporary).unlink(missing_ok=True)
    except OSError as error:
        raise SpecError(f"the kubeconfig {path} cannot be written on the control node: {error.strerror}") from error
    return True
