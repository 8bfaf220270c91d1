# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a node lacks, and what is wrong on it once all was brought."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.look import Present, node_images
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.plan import images_plan, images_problems
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._images.archives import ID, docker

APPS, REDIS = "docker.io/lab/apps:1.0", "docker.io/library/redis:7"


def listing(*images: tuple[str, list[str]]) -> str:
    return json.dumps({"images": [{"id": digest, "repoTags": tags} for digest, tags in images]})


@pytest.mark.parametrize(
    ("text", "brings", "pulls"),
    [
        ("", True, True),
        (listing(), True, True),
        (listing(("1", ["docker.io/lab/other:1.0"])), True, True),
        (listing((ID, [APPS])), False, True),
        (listing((ID.partition(":")[2], [APPS])), False, True),
        (listing(("sha256:old", [APPS, REDIS])), True, False),
    ],
)
def test_what_is_there_by_id_does_not_travel(tmp_path: Path, text: str, brings: bool, pulls: bool) -> None:
    path = docker(tmp_path / "a.tar", ["lab/apps:1.0"])
    names = ["redis:7", "docker.io/redis:7", "lab/apps:1.0"]  # what an archive holds is not pulled
    plan = images_plan([{"path": path}], names, Present("x86_64", node_images(text)))
    assert plan.bring == ((path,) if brings else ())
    assert plan.pull == ((REDIS,) if pulls else ())
    assert plan.wanted == {APPS: ID, REDIS: ""}


def test_only_the_named_images_count(tmp_path: Path) -> None:
    path = docker(tmp_path / "a.tar", ["lab/apps:1.0", "lab/ros:noetic"])
    present = Present("x86_64", {APPS: ID})
    assert images_plan([{"path": path}], [], present).bring == (path,)
    assert images_plan([{"path": path, "images": ["lab/apps:1.0"]}], [], present).bring == ()
    with pytest.raises(SpecError, match=r"does not hold docker.io/lab/apps:2.0, only docker.io/lab/apps:1.0"):
        images_plan([{"path": path, "images": ["lab/apps:2.0"]}], [], present)


def test_an_archive_for_another_machine_is_refused(tmp_path: Path) -> None:
    path = docker(tmp_path / "d.tar", ["a:1"])
    with pytest.raises(SpecError, match="holds images for amd64, but the host is aarch64"):
        images_plan([{"path": path}], [], Present("aarch64", {}))


def test_problems_after_the_import() -> None:
    wanted = {APPS: ID, REDIS: "", "docker.io/lab/ros:1": ID}
    present = node_images(listing(("sha256:other", ["docker.io/lab/ros:1", REDIS])))
    assert images_problems(wanted, present) == [
        f"{APPS} is not there",
        f"docker.io/lab/ros:1 has the ID sha256:other, not {ID}",
    ]
