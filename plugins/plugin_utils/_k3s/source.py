# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where k3s's binary and archive of images come from: the project's releases, or a directory of the control node."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

from ...module_utils._common.documents import Variables
from ...module_utils._common.errors import SpecError
from .._model.machines import MACHINES

SUM_LINE = re.compile(r"^([0-9a-f]{64}) [ *](\S+)$")
ARCHIVE_ENDINGS = (".tar.zst", ".tar.gz", ".tar")


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
    base = Path(directory).expanduser()
    try:
        binary, images = airgap_files((base / "SHA256SUMS").read_text(encoding="utf-8"), machine)
        (base / binary.name).stat()
        size = (base / images.name).stat().st_size if images else 0
    except OSError as error:
        raise SpecError(f"k3s_airgap_dir {base}: {error.filename} cannot be read: {error.strerror}") from error
    found = Artifacts(sha256=binary.sha256, path=str(base / binary.name))
    if images is None:
        return found
    return replace(
        found,
        archive_name=images.name.replace(".tar", f"-{images.sha256[:12]}.tar"),
        archive_path=str(base / images.name),
        archive_sha256=images.sha256,
        archive_size=size,
    )


class Summed(NamedTuple):
    """A file of SHA256SUMS."""

    name: str
    sha256: str


def airgap_files(manifest: str, machine: str) -> tuple[Summed, Summed | None]:
    """Binary and archive of images for a machine out of the text of SHA256SUMS; of several packings the smallest."""
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
    images = next((Summed(name, sums[name]) for name in archives if name in sums), None)
    return Summed(binary, sums[binary]), images
