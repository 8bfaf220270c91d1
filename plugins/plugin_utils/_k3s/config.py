# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pure functions of the role k3s that are no one-liners in Jinja. Run on the control node."""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.module_utils._host.k3s import token_verdict
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.machines import MACHINES

SUM_LINE = re.compile(r"^([0-9a-f]{64}) [ *](\S+)$")
ARCHIVE_ENDINGS = (".tar.zst", ".tar.gz", ".tar")


def airgap_artifacts(manifest: str, machine: str) -> dict[str, Any]:
    """Binary and image archive for a machine out of the text of SHA256SUMS: `{binary: {name, sha256}, images: ..}`.

    The images are optional; of several packings the smallest is taken.
    """
    sums: dict[str, str] = {}
    for number, line in enumerate(manifest.splitlines(), start=1):
        found = SUM_LINE.match(line.strip())
        if found:
            sums[found.group(2)] = found.group(1)
        elif line.strip():
            raise SpecError(f"SHA256SUMS, line {number}, is no line of sha256sum: {line.strip()[:80]!r}")
    known = MACHINES.get(machine)
    if known is None:
        raise SpecError(f"there is no k3s for the architecture {machine}")
    binary = f"k3s{known.suffix}"
    if binary not in sums:
        raise SpecError(f"SHA256SUMS has no line for {binary}, which hosts of {machine} need")
    archives = [f"k3s-airgap-images-{known.architecture}{ending}" for ending in ARCHIVE_ENDINGS]
    images = next((name for name in archives if name in sums), "")
    return {
        "binary": {"name": binary, "sha256": sums[binary]},
        "images": {"name": images, "sha256": sums.get(images, "")},
    }


def airgap(directory: str, machine: str) -> dict[str, Any]:
    """`airgap_artifacts` of a directory on the control node, each with its path and size."""
    base = Path(directory).expanduser()
    try:
        found = airgap_artifacts((base / "SHA256SUMS").read_text(encoding="utf-8"), machine)
        for artifact in (artifact for artifact in found.values() if artifact["name"]):
            artifact["path"] = str(base / artifact["name"])
            artifact["size"] = (base / artifact["name"]).stat().st_size
    except OSError as error:
        raise SpecError(f"k3s_airgap_dir {base}: {error.filename} cannot be read: {error.strerror}") from error
    return found


def wrong_tokens(read: Sequence[Mapping[str, Any]], given: Mapping[str, str]) -> list[str]:
    """Names of the inventory's variables whose token is not the one read from the cluster; none given is none wrong.

    `read` is what slurp returned for each file name.
    """
    return [
        f"k3s_{file['item'].replace('-', '_')}"
        for file in read
        if given[file["item"]]
        and token_verdict(given[file["item"]], base64.b64decode(file["content"]).decode(), "") != "same"
    ]


def local_kubeconfig(text: str, server: str, cluster: str, source: str) -> str:
    """k3s's kubeconfig for use elsewhere: the server's real address, everything named after the cluster.

    The first line says what it was made from, so that a look at it tells whether it must be made again.
    """
    # Ansible's strings carry tags, which a YAML dumper does not know.
    server, cluster = str(server), str(cluster)
    document = yaml.safe_load(str(text))
    try:
        inner = document["clusters"][0]["cluster"]
        user = document["users"][0]["user"]
    except (TypeError, KeyError, IndexError) as error:
        raise SpecError("the server's k3s.yaml is no kubeconfig") from error
    config = {
        "apiVersion": "v1",
        "kind": "Config",
        "clusters": [{"name": cluster, "cluster": {**inner, "server": server}}],
        "users": [{"name": cluster, "user": user}],
        "contexts": [{"name": cluster, "context": {"cluster": cluster, "user": cluster}}],
        "current-context": cluster,
    }
    return f"{kubeconfig_head(source, server, cluster)}\n{yaml.safe_dump(config, sort_keys=True)}"


def kubeconfig_head(source: str, server: str, cluster: str) -> str:
    return f"# rosops.fleet: {cluster} at {server}, from k3s.yaml sha256:{source}"
