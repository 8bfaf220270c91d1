# SPDX-License-Identifier: GPL-3.0-or-later
"""What a node prints of itself, as crictl and ctr of containerd 1.6 and 2.1 do, and which images it is to keep."""

from __future__ import annotations

import json
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.node import (
    LABEL,
    LOOK,
    Present,
    node_images,
    pins,
    present,
)

IMAGES = {
    "images": [
        {"id": "sha256:f707", "repoTags": ["docker.io/lab/ros:noetic"], "repoDigests": [], "pinned": False},
        {"id": "a47b", "repoTags": ["docker.io/lab/apps:1.1"], "repoDigests": ["docker.io/lab/apps@sha256:5d08"]},
    ]
}
LABELS = """\
REF                      TYPE                     DIGEST      SIZE      PLATFORMS   LABELS
docker.io/lab/apps:1.1   application/vnd.oci.image sha256:5d08 249.6 MiB linux/amd64 \
io.cri-containerd.image=managed,io.cri-containerd.pinned=pinned,rosops.fleet/pinned=wanted
docker.io/lab/ros:noetic application/vnd.docker   sha256:1f34 248.9 MiB linux/amd64 io.cri-containerd.image=managed
docker.io/lab/old:1      application/vnd.docker   sha256:1f35 248.9 MiB linux/amd64 -
docker.io/mine:1         application/vnd.docker   sha256:1f36 248.9 MiB linux/amd64 io.cri-containerd.pinned=pinned
"""
CONTAINERS = {"containers": [{"imageRef": "sha256:f707", "image": {"image": "sha256:f707"}}, {"imageRef": "a47b"}]}


def printed(*parts: str) -> str:
    return "--- rosops.fleet ---\n".join(f"{part}\n" for part in parts).strip()


def test_all_of_it_is_one_command() -> None:
    assert LOOK.count("echo '--- rosops.fleet ---'") == 4
    parts = json.dumps(IMAGES, indent=2), LABELS, "sha256:a\nsha256:b", json.dumps(CONTAINERS)
    found = present(printed("x86_64", *parts))
    assert found == Present(
        "x86_64",
        {
            "docker.io/lab/ros:noetic": "sha256:f707",
            "docker.io/lab/apps:1.1": "sha256:a47b",
            "docker.io/lab/apps@sha256:5d08": "sha256:a47b",
        },
        {"docker.io/lab/apps:1.1": "wanted"},  # what somebody else pinned is not ours to let go
        frozenset({"sha256:a", "sha256:b"}),
        frozenset({"sha256:f707", "sha256:a47b"}),
    )


def test_a_host_without_k3s_has_a_machine_alone() -> None:
    """Its output ends before the first command that is not there; Ansible strips the last newline."""
    for said in ("aarch64", "aarch64\n--- rosops.fleet ---"):
        assert present(said) == Present("aarch64", {}, {}, frozenset(), frozenset())


def test_a_listing_that_is_no_json() -> None:
    with pytest.raises(SpecError, match="no JSON"):
        node_images("FATA[0000] connect: no such file")


# --- pins -------------------------------------------------------------------------------------------------------------

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
