# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a node prints of itself, as crictl and ctr of containerd 1.6 and 2.1 do."""

from __future__ import annotations

import json

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.look import LOOK, Present, node_images, present

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
