# SPDX-License-Identifier: GPL-3.0-or-later
"""The hosts' and the ROS image, and commands that run in the latter while something is built."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from .artifacts import Cache, Recipe
from .debian import ensure_imported, make_tree, tree_recipe
from .oci import Image, Layer
from .paths import IMAGES, pins
from .podman import PODMAN, limits
from .run import Job, build

ROS_ENVIRONMENT = [
    "PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin",
    "LANG=C.UTF-8",
    "LC_ALL=C.UTF-8",
    "ROS_DISTRO=noetic",
]


def host_image(cache: Cache) -> str:
    """The podman image that lab hosts run, built or imported where it is missing."""
    recipe = tree_recipe("host", "the hosts' Debian system", pins()["host"]["packages"])
    tree = cache.ensure(recipe, lambda directory, log: make_tree(recipe, directory, log))
    return ensure_imported(cache, recipe, tree)


def ros_recipe() -> Recipe:
    return tree_recipe("ros", "the ROS image", pins()["ros"]["packages"])


def ros_tree(cache: Cache) -> Path:
    recipe = ros_recipe()
    return cache.ensure(recipe, lambda directory, log: make_tree(recipe, directory, log))


def ros_image(tree: Path) -> Image:
    """What robots get: the tree, and the environment of the official image. What ROS needs besides comes with the entry
    point."""
    config = {"Env": ROS_ENVIRONMENT, "Entrypoint": ["/ros_entrypoint.sh"], "Cmd": ["bash"]}
    return Image(pins()["ros"]["tag"], [Layer.of(tree / "rootfs.tar")], config)


def runnable_ros(cache: Cache, tree: Path, log: Path) -> str:
    """The podman image of the same tree. It is of use only if a master starts in it and answers."""
    image = ensure_imported(cache, ros_recipe(), tree)
    script = (IMAGES / "ros" / "check_roscore.sh").read_text()
    build(Job(inside(image, script, {}), "the ROS image (roscore starts in it)", log))
    return image


def inside(image: str, script: str, environment: Mapping[str, str]) -> list[str]:
    """A command in the ROS image without network; sources come by its standard input, so that no path is mounted."""
    given = [*ROS_ENVIRONMENT, *(f"{name}={value}" for name, value in environment.items())]
    variables = [f"--env={line}" for line in given]
    flags = ["--rm", "--interactive", "--network=none", "--pids-limit=-1", *limits(), *variables]
    return [*PODMAN, "run", *flags, image, "/ros_entrypoint.sh", "bash", "-euc", script]
