# SPDX-License-Identifier: GPL-3.0-or-later
"""What a node has: images and their labels, the content that they are made of, and what containers run. One command.

And which of the images the kubelet may not delete when the disk fills. It deletes what no container uses, the longest
unused first: what was brought for the next step, and what that step would go back to. So what is wanted is pinned, and
of each repository what was wanted or ran before it. What is older is let go, once no container uses it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from ...module_utils._common.documents import Result
from ...module_utils._common.errors import SpecError
from ...module_utils._host.k3s import BINARY
from .archive import normal_ref

PIN = "rosops.fleet/pinned"  # whose value says why this collection keeps an image; k3s has a label of its own, too
WANTED, BEFORE, LET_GO = "wanted", "before", ""
CTR = f"{BINARY} ctr --namespace k8s.io"
_LOOKS = ("uname -m", f"{BINARY} crictl images -o json", f"{CTR} images ls", f"{CTR} content ls -q",
          f"{BINARY} crictl ps -a -o json")  # fmt: skip
_BREAK = "--- rosops.fleet ---"
LOOK = f" && echo '{_BREAK}' && ".join(_LOOKS)
# The second label is the one that containerd's CRI tells the kubelet of. An empty value takes a label away.
LABEL = (
    'while [ $# -gt 0 ]; do "$0" ctr --namespace k8s.io images label "$2" "io.cri-containerd.pinned=${1:+pinned}" '
    f'"{PIN}=$1" >/dev/null || exit; shift 2; done'
)


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
    used = frozenset(_digest(str(one.get("imageRef") or "")) for one in listed)
    return Present(machine.strip(), node_images(images), _pins(labels), frozenset(blobs.split()), used)


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


def pins(wanted: Iterable[str], there: Present, keep: Iterable[str] = ()) -> dict[str, str]:
    """Names whose pin has to change, and to what. One of `keep` stays pinned, where it is."""
    names = [*wanted, *(ref for ref in keep if ref in there.pins)]
    now = {ref: WANTED for ref in names if ref in there.images}
    ours = {_repository(ref) for ref in now}
    runs = {ref for ref, image in there.images.items() if image in there.used and "@" not in ref}
    left = [ref for ref in there.pins if ref in there.images and ref not in now]
    moved = {_repository(ref) for ref in left if there.pins[ref] == WANTED}
    for ref in left:
        older = there.pins[ref] == BEFORE and _repository(ref) in moved
        now[ref] = LET_GO if older and ref not in runs else BEFORE
    now.update({ref: BEFORE for ref in runs - now.keys() if _repository(ref) in ours})
    return {ref: why for ref, why in sorted(now.items()) if there.pins.get(ref, LET_GO) != why}


def _repository(ref: str) -> str:
    name = ref.partition("@")[0]
    place, slash, last = name.rpartition("/")
    return f"{place}{slash}{last.partition(':')[0]}"
