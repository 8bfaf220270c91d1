# SPDX-License-Identifier: GPL-3.0-or-later
"""Where k3s's binary and archive of images come from: the project's releases, or a directory of the control node.

And its tokens: a server of the cluster, or the inventory.
"""

from __future__ import annotations

import base64
import secrets
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from urllib.parse import quote

from ...module_utils._common.documents import Result, Variables
from ...module_utils._common.errors import SpecError
from ...module_utils._host.download import SUM_LINE
from ...module_utils._host.k3s import token_verdict
from .._model.machines import MACHINES

ARCHIVE_ENDINGS = (".tar.zst", ".tar.gz", ".tar")
VARIABLES = {"token": "k3s_token", "agent-token": "k3s_agent_token"}


@dataclass(frozen=True)
class Artifacts:
    """Binary and archive for one machine. What does not apply is empty.

    `sha256` is the binary's, empty where only the release's own list of sums (`sums`, a URL) has it. `archive_name` is
    the archive's name on the host: it holds the digest, so neither end needs to read hundreds of MB to compare.
    """

    sha256: str = ""
    path: str = ""  # of the binary on the control node
    url: str = ""  # of the binary in the releases
    sums: str = ""
    archive_name: str = ""
    archive_path: str = ""
    archive_sha256: str = ""
    archive_size: int = 0


def source(variables: Variables, machine: str) -> Artifacts:
    """The source that the role's variables choose; SpecError if the airgap directory lacks something."""
    if variables["k3s_install_source"] == "airgap":
        return _airgap(variables["k3s_airgap_dir"], machine)
    known = MACHINES[machine]
    release = f"{variables['k3s_release_url']}/{quote(variables['k3s_version'])}"
    return Artifacts(
        sha256=variables["k3s_release_checksums"].get(machine) or "",
        url=f"{release}/k3s{known.suffix}",
        sums=f"{release}/sha256sum-{known.architecture}.txt",
    )


def _airgap(directory: str, machine: str) -> Artifacts:
    """What the directory has for a machine by its SHA256SUMS; of several packings of the images the smallest."""
    base, known = Path(directory).expanduser(), MACHINES[machine]
    binary = f"k3s{known.suffix}"
    archives = [f"k3s-airgap-images-{known.architecture}{ending}" for ending in ARCHIVE_ENDINGS]
    try:
        sums = _sums((base / "SHA256SUMS").read_text(encoding="utf-8"))
        if binary not in sums:
            raise SpecError(f"SHA256SUMS has no line for {binary}, which hosts of {machine} need")
        (base / binary).stat()
        images = next((name for name in archives if name in sums), "")
        size = (base / images).stat().st_size if images else 0
    except OSError as error:
        raise SpecError(f"k3s_airgap_dir {base}: {error.filename} cannot be read: {error.strerror}") from error
    found = Artifacts(sha256=sums[binary], path=str(base / binary))
    if not images:
        return found
    name, path, digest = images.replace(".tar", f"-{sums[images][:12]}.tar"), str(base / images), sums[images]
    return replace(found, archive_name=name, archive_path=path, archive_sha256=digest, archive_size=size)


def _sums(manifest: str) -> dict[str, str]:
    """File to SHA-256, out of what sha256sum wrote."""
    sums: dict[str, str] = {}
    for number, line in enumerate(manifest.splitlines(), start=1):
        if found := SUM_LINE.match(line.strip()):
            sums[found.group(2)] = found.group(1)
        elif line.strip():
            raise SpecError(f"SHA256SUMS, line {number}, is no line of sha256sum: {line.strip()[:80]!r}")
    return sums


def tokens_to_keep(names: Iterable[str], read: Sequence[Result], variables: Variables) -> dict[str, str]:
    """Name of a token's file to its text: what the first server hands out, else the inventory's, else a new one.

    `read` is what slurp returned for each file of the servers that could be asked, in their order; empty on the first
    server itself. The full form of a token (K10...) lets a member check that it talks to the right cluster before it
    says a word. SpecError where the inventory's is not the cluster's.
    """
    joined = {
        PurePosixPath(file["source"]).name: base64.b64decode(file["content"]).decode().strip()
        for file in reversed(read)
        if "content" in file
    }
    wrong = [
        VARIABLES[name]
        for name, text in joined.items()
        if variables[VARIABLES[name]] and token_verdict(variables[VARIABLES[name]], text, "") != "same"
    ]
    if wrong:
        cluster = variables["k3s_cluster"]
        raise SpecError(f"{', '.join(wrong)} is not the one that the cluster {cluster} runs with; nothing was changed.")
    return {name: joined.get(name) or variables[VARIABLES[name]] or secrets.token_hex(24) for name in names}
