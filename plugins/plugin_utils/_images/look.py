# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a node has: images and their labels, the content that they are made of, and what containers run. One command."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from ...module_utils._common.documents import Result
from ...module_utils._common.errors import SpecError
from ...module_utils._host.k3s import BINARY
from .archive import normal_ref

PIN = "rosops.fleet/pinned"  # whose value says why this collection keeps an image; k3s has a label of its own, too
CTR = f"{BINARY} ctr --namespace k8s.io"
_LOOKS = ("uname -m", f"{BINARY} crictl images -o json", f"{CTR} images ls", f"{CTR} content ls -q",
          f"{BINARY} crictl ps -a -o json")  # fmt: skip
_BREAK = "--- rosops.fleet ---"
LOOK = f" && echo '{_BREAK}' && ".join(_LOOKS)


@dataclass(frozen=True)
class Present:
    """A node's machine (as `uname -m` says it), and its images: full name to ID, names by digest included.

    `pins` are names with the reason for which they are kept, `blobs` the digests of all content, `used` the IDs of the
    images of containers that are there, ended ones too.
    """

    machine: str
    images: Mapping[str, str]
    pins: Mapping[str, str] = field(default_factory=dict)
    blobs: frozenset[str] = frozenset()
    used: frozenset[str] = frozenset()


def present(printed: str) -> Present:
    """Out of what LOOK printed. A host without k3s has got no further than its machine."""
    machine, images, labels, blobs, containers, *_none = [*f"{printed}\n".split(f"{_BREAK}\n"), "", "", "", ""]
    listed = _json(containers).get("containers") or []
    return Present(
        machine.strip(),
        node_images(images),
        _pins(labels),
        frozenset(blobs.split()),
        frozenset(_digest(str(one.get("imageRef") or "")) for one in listed),
    )


def node_images(listing: str) -> dict[str, str]:
    """Name to ID of a node's images, out of what `crictl images -o json` prints. Names by digest are in it, too."""
    return {
        normal_ref(ref): _digest(image["id"])
        for image in _json(listing).get("images") or []
        for ref in [*(image.get("repoTags") or []), *(image.get("repoDigests") or [])]
    }


def _json(printed: str) -> Result:
    try:
        return dict(json.loads(printed.strip() or "{}"))
    except ValueError as error:
        raise SpecError(f"crictl's list is no JSON: {error}") from error


def _digest(image: str) -> str:
    return image if re.match(r"^\w+:", image) else f"sha256:{image}"


def _pins(table: str) -> dict[str, str]:
    """Of `ctr images ls`: the name is the first column, and labels are the last one, without a blank."""
    rows = [line.split() for line in table.splitlines()[1:]]
    labels = {row[0]: dict(item.partition("=")[::2] for item in row[-1].split(",")) for row in rows if row}
    return {normal_ref(ref): own[PIN] for ref, own in labels.items() if own.get(PIN)}
