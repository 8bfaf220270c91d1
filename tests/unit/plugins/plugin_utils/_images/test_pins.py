# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which images are kept from the kubelet, and the shell that says so to containerd."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.look import Present
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.pins import LABEL, pins

V1, V2, V3, ROS = (f"docker.io/lab/{name}" for name in ("apps:1", "apps:2", "apps:3", "ros:noetic"))
IDS = {V1: "sha256:1", V2: "sha256:2", V3: "sha256:3", ROS: "sha256:0"}


def node(*there: str, used: tuple[str, ...] = (), **now: str) -> Present:
    """`now` are pins, by a version's name."""
    known = {"v1": V1, "v2": V2, "v3": V3, "ros": ROS}
    own = {known[name]: why for name, why in now.items()}
    return Present("x86_64", {ref: IDS[ref] for ref in there}, own, frozenset(), frozenset(IDS[ref] for ref in used))


@pytest.mark.parametrize(
    ("wanted", "there", "changes"),
    [
        ([V1, ROS], node(V1, ROS), {V1: "wanted", ROS: "wanted"}),
        ([V1, V3], node(V1), {V1: "wanted"}),  # one that is not there has nothing to label
        ([V1], node(V1, v1="wanted"), {}),
        # the next version: what was wanted until now is what its step would go back to
        ([V2], node(V1, V2, v1="wanted"), {V1: "before", V2: "wanted"}),
        ([V2], node(V1, V2, v1="before", v2="wanted"), {}),
        ([V3], node(V1, V2, V3, v1="before", v2="wanted"), {V1: "", V2: "before", V3: "wanted"}),
        # version 2 did not get through: 1 runs on, and is what the step to 3 goes back to
        ([V3], node(V1, V2, V3, used=(V1,), v1="before", v2="wanted"), {V2: "before", V3: "wanted"}),
        # nobody had pinned what runs: the node had pulled it by itself
        ([V2], node(V1, V2, used=(V1,)), {V1: "before", V2: "wanted"}),
        ([V2], node(V2, ROS, used=(V2, ROS)), {V2: "wanted"}),  # of another repository: not ours
        ([V1], node(V1, V2, v1="before", v2="wanted"), {V1: "wanted", V2: "before"}),  # back again
        ([], node(V1, v1="wanted"), {V1: "before"}),
        ([V1], node(v1="wanted"), {}),  # somebody has removed it
    ],
)
def test_what_is_wanted_and_what_was_before_it(wanted: list[str], there: Present, changes: dict[str, str]) -> None:
    assert pins(wanted, there) == changes
    left = {ref: why for ref, why in {**there.pins, **changes}.items() if why}
    assert pins(wanted, replace(there, pins=left)) == {}  # a second run changes nothing


@pytest.mark.parametrize("broken", [False, True])
def test_the_shell_labels_all_of_them_and_says_when_one_cannot_be(tmp_path: Path, broken: bool) -> None:
    k3s = tmp_path / "k3s"
    ends = 'case "$6" in */apps:1) exit 3; esac\n' if broken else ""
    k3s.write_text(f'#!/bin/sh\necho "$@" >> {tmp_path}/seen\n{ends}')
    k3s.chmod(0o700)
    found = subprocess.run(  # noqa: S603
        ["/bin/sh", "-c", LABEL, str(k3s), "wanted", V2, "", V1, "before", V3], capture_output=True, check=False
    )  # fmt: skip
    said = (tmp_path / "seen").read_text().splitlines()
    label = "ctr --namespace k8s.io images label"
    assert said[:2] == [
        f"{label} {V2} io.cri-containerd.pinned=pinned rosops.fleet/pinned=wanted",
        f"{label} {V1} io.cri-containerd.pinned= rosops.fleet/pinned=",
    ]
    assert (found.returncode, len(said)) == ((3, 2) if broken else (0, 3))


def test_what_a_step_has_brought_stays_pinned_where_nobody_asks_for_it() -> None:
    """The next run brings the archives alone. What the node has pulled by itself is none of its business."""
    there = node(V1, V2, ROS, v2="wanted")
    assert pins([ROS], there, [V1, V2]) == {ROS: "wanted"}
    assert pins([ROS], there) == {ROS: "wanted", V2: "before"}
