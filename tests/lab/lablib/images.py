# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The images of the lab: the hosts' system, ROS, the apps."""

from __future__ import annotations

import io
import tarfile
from pathlib import Path

from .artifacts import Cache, Recipe
from .debian import ensure_imported, make_tree, tree_recipe
from .errors import LabError
from .oci import Image, Layer, write_archive, write_update
from .paths import APPS, IMAGES, pins
from .podman import PODMAN, limits
from .run import Job, build

ROS_ENVIRONMENT = [
    "PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin",
    "LANG=C.UTF-8",
    "ROS_DISTRO=noetic",
    "ROS_ETC_DIR=/etc/ros",
    "ROS_PACKAGE_PATH=/usr/share",
    "ROS_PYTHON_VERSION=3",
    "ROS_MASTER_URI=http://localhost:11311",
]


def host_image(cache: Cache) -> str:
    """The podman image that lab hosts run, built or imported where it is missing."""
    recipe = tree_recipe("host", "the hosts' Debian system", pins()["host"]["packages"])
    tree = cache.ensure(recipe, lambda directory, log: make_tree(recipe, directory, log))
    return ensure_imported(cache, recipe, tree)


def ros_recipe() -> Recipe:
    return tree_recipe("ros", "the ROS image", pins()["ros"]["packages"])


def _ros_tree(cache: Cache) -> Path:
    recipe = ros_recipe()
    return cache.ensure(recipe, lambda directory, log: make_tree(recipe, directory, log))


def app_archives(cache: Cache) -> dict[str, Path]:
    """Archive of each apps version. The first holds the ROS image, too; the later ones are updates of it, without the
    layers that a node has from the first."""
    versions: list[str] = pins()["apps"]["versions"]
    recipe = Recipe(
        kind="apps",
        title="the apps' images",
        values={"ros": ros_recipe().key(), "pins": pins()["apps"], "tag": pins()["ros"]["tag"]},
        files=(APPS, IMAGES / "ros", Path(__file__), Path(__file__).with_name("oci.py")),
    )
    directory = cache.ensure(recipe, lambda directory, log: _make_apps(cache, directory, log))
    return {version: directory / f"apps-{version}.tar" for version in versions}


def _make_apps(cache: Cache, directory: Path, log: Path) -> None:
    tree = _ros_tree(cache)
    runnable = ensure_imported(cache, ros_recipe(), tree)
    _check_roscore(runnable, log)
    base = Layer.of(tree / "rootfs.tar")
    config = {"Env": ROS_ENVIRONMENT, "Entrypoint": ["/ros_entrypoint.sh"], "Cmd": ["bash"]}
    ros = Image(pins()["ros"]["tag"], [base], config)
    sources = directory / "sources.tar"
    sources.write_bytes(_pack(APPS))
    for number, version in enumerate(pins()["apps"]["versions"]):
        layer_tar = directory / f"layer-{version}.tar"
        _run_app_build(runnable, version, sources, layer_tar, log)
        apps = Image(
            f"{pins()['apps']['repository']}:{version}",
            [base, Layer.of(layer_tar)],
            {
                **config,
                "Env": [*ROS_ENVIRONMENT, f"ROSOPS_APPS_VERSION={version}"],
                "Labels": {"org.opencontainers.image.version": version},
            },
        )
        archive = directory / f"apps-{version}.tar"
        if number == 0:
            write_archive(archive, [ros, apps])
        else:
            write_update(archive, apps, present=[base])
        layer_tar.unlink()
    sources.unlink()


def _inside(image: str, script: str, environment: dict[str, str]) -> list[str]:
    """A command in the ROS image without network; sources come by its standard input, so that no path is mounted."""
    variables = [f"--env={name}={value}" for name, value in environment.items()]
    flags = ["--rm", "--interactive", "--network=none", "--pids-limit=-1", *limits(), *variables]
    return [*PODMAN, "run", *flags, image, "/ros_entrypoint.sh", "bash", "-euc", script]


def _check_roscore(image: str, log: Path) -> None:
    """The image is of use only if a master starts in it and answers."""
    script = (Path(IMAGES) / "ros" / "check_roscore.sh").read_text()
    build(Job(_inside(image, script, {}), "the ROS image (roscore starts in it)", log))


def _run_app_build(image: str, version: str, sources: Path, layer: Path, log: Path) -> None:
    """tests/apps/build.sh inside the ROS image: it generates the messages with Debian's genpy."""
    if not (APPS / "build.sh").is_file():
        raise LabError("the apps have no build.sh", where=str(APPS), todo="restore tests/apps from git")
    script = (
        "mkdir /src && tar -x -C /src && /src/build.sh /opt/rosops-apps >&2 && "
        "tar -c -C / --sort=name --mtime=@0 --owner=0 --group=0 --numeric-owner opt/rosops-apps"
    )
    command = _inside(image, script, {"ROSOPS_APPS_VERSION": version})
    build(Job(command, f"the apps {version}", log, stdin=sources, stdout=layer))


def _pack(root: Path) -> bytes:
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w") as tar:
        tar.add(root, arcname=".", filter=lambda entry: None if "__pycache__" in entry.name else entry)
    return buffer.getvalue()
