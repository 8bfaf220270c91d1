# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where k3s's binary and archive of images come from: the project's releases, or a directory of the control node."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.machines import MACHINES

SUM_LINE = re.compile(r"^([0-9a-f]{64}) [ *](\S+)$")
ARCHIVE_ENDINGS = (".tar.zst", ".tar.gz", ".tar")


@dataclass(frozen=True)
class Source:
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


def source(variables: Mapping[str, Any], machine: str) -> Source:
    """The source that the role's variables choose; SpecError if the airgap directory lacks something."""
    if variables["k3s_install_source"] == "airgap":
        return _airgap(variables["k3s_airgap_dir"], machine)
    known = MACHINES[machine]
    release = f"{variables['k3s_release_url']}/{quote(variables['k3s_version'])}"
    return Source(
        sha256=variables["k3s_release_checksums"].get(machine) or "",
        url=f"{release}/k3s{known.suffix}",
        sums=f"{release}/sha256sum-{known.architecture}.txt",
    )


def _airgap(directory: str, machine: str) -> Source:
    found = airgap(directory, machine)
    binary, images = found["binary"], found["images"]
    if not images["name"]:
        return Source(sha256=binary["sha256"], path=binary["path"])
    return Source(
        sha256=binary["sha256"],
        path=binary["path"],
        archive_name=images["name"].replace(".tar", f"-{images['sha256'][:12]}.tar"),
        archive_path=images["path"],
        archive_sha256=images["sha256"],
        archive_size=images["size"],
    )


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
