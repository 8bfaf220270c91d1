# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which images the kubelet may not delete when the disk fills. Pure.

It deletes what no container uses, the longest unused first: what was brought for the next step, and what that step
would go back to. So what is wanted is pinned, and of each repository what was wanted or ran before it. What is older is
let go, once no container uses it.
"""

from __future__ import annotations

from collections.abc import Iterable

from .look import PIN, Present

WANTED, BEFORE, LET_GO = "wanted", "before", ""
# The second label is the one that containerd's CRI tells the kubelet of. An empty value takes a label away.
LABEL = (
    'while [ $# -gt 0 ]; do "$0" ctr --namespace k8s.io images label "$2" "io.cri-containerd.pinned=${1:+pinned}" '
    f'"{PIN}=$1" >/dev/null || exit; shift 2; done'
)


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
