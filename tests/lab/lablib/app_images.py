# SPDX-License-Identifier: GPL-3.0-or-later
"""The images of the apps in tests/apps, one for each version that the pins name."""

from __future__ import annotations

import tarfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from .artifacts import Cache, Recipe
from .debian import ensure_imported, grow_tree, grown_recipe, make_layer
from .errors import LabError
from .images import inside, ros_image, ros_recipe, ros_tree, runnable_ros
from .oci import Image, Layer, write_archive, write_removal, write_update
from .paths import APPS, IMAGES, pins
from .run import Job, build

_LAYER_CODE = ("debian.py", "oci.py")
_CODE = ("app_images.py", "images.py", *_LAYER_CODE)
_NOT_SOURCES = {"__pycache__", ".mypy_cache", ".ruff_cache"}
_BUILD = (
    "mkdir /src && tar -x -C /src && /src/build.sh /opt/rosops-apps >&2 && "
    "tar -c -C / --sort=name --mtime=@0 --owner=0 --group=0 --numeric-owner opt/rosops-apps"
)
_COMPILE = (
    "mkdir /src /out && tar -x -C /src && /src/cpp/build.sh /out >&2 && "
    "cd /out && tar -c --mtime=@0 --owner=0 --group=0 --numeric-owner *"
)


@dataclass(frozen=True)
class Version:
    """A version of the apps, as the pins have it. What it does not say is as in the others.

    `packages` of Debian's come with it as a layer of their own; `environment` is that of build.sh. What is under names
    like `without` is taken away, and by itself the image runs `entrypoint`.
    """

    name: str
    packages: tuple[str, ...] = ()
    environment: tuple[tuple[str, str], ...] = ()
    without: str = ""
    entrypoint: tuple[str, ...] = ()

    @classmethod
    def of(cls, name: str, pinned: dict[str, Any]) -> Version:
        known = {"packages", "environment", "without", "entrypoint"}
        if unknown := pinned.keys() - known:
            raise LabError(f"apps version {name}: {', '.join(sorted(unknown))} is none of {', '.join(sorted(known))}")
        return cls(
            name,
            tuple(pinned.get("packages", ())),
            tuple(sorted(pinned.get("environment", {}).items())),
            pinned.get("without", ""),
            tuple(pinned.get("entrypoint", ())),
        )


def versions() -> list[Version]:
    return [Version.of(name, pinned) for name, pinned in pins()["apps"]["versions"].items()]


def app_archives(cache: Cache) -> dict[str, Path]:
    """Archive of each apps version. The first holds the ROS image, too; the later ones are updates of it, without the
    layers that a node has from the first."""
    recipe = Recipe(
        kind="apps",
        title="the apps' images",
        values={"ros": ros_recipe().key(), "pins": pins()["apps"], "tag": pins()["ros"]["tag"]},
        files=(APPS, IMAGES / "ros", *(Path(__file__).with_name(name) for name in _CODE)),
    )
    directory = cache.ensure(recipe, lambda directory, log: _make(cache, directory, log))
    return {version.name: directory / f"apps-{version.name}.tar" for version in versions()}


def _make(cache: Cache, directory: Path, log: Path) -> None:
    if not (APPS / "build.sh").is_file():
        raise LabError("the apps have no build.sh", where=str(APPS), todo="restore tests/apps from git")
    tree = ros_tree(cache)
    ros = ros_image(tree)
    runnable = runnable_ros(cache, tree, log)
    sources = directory / "sources.tar"
    _pack(sources, _compiled(cache, tree))
    for number, version in enumerate(versions()):
        top, bare = (directory / f"{what}-{version.name}.tar" for what in ("layer", "removal"))
        _build(runnable, version, sources, top, log)
        less = [write_removal(bare, tree / "rootfs.tar", version.without)] if version.without else []
        apps = _image(ros, version, [*_added(cache, version, tree), Layer.of(top), *less])
        archive = directory / f"apps-{version.name}.tar"
        if number == 0:
            write_archive(archive, [ros, apps])
        else:
            write_update(archive, apps, present=ros.layers)
        top.unlink()
        bare.unlink(missing_ok=True)
    sources.unlink()


def _image(ros: Image, version: Version, layers: list[Layer]) -> Image:
    return replace(
        ros,
        tag=f"{pins()['apps']['repository']}:{version.name}",
        layers=[*ros.layers, *layers],
        config={
            **ros.config,
            "Env": [*ros.config["Env"], f"ROSOPS_APPS_VERSION={version.name}"],
            "Labels": {"org.opencontainers.image.version": version.name},
            **({"Entrypoint": list(version.entrypoint), "Cmd": None} if version.entrypoint else {}),
        },
    )


def _added(cache: Cache, version: Version, tree: Path) -> list[Layer]:
    """The layer of the version's own packages, if it has any."""
    if not version.packages:
        return []
    title, code = f"the packages of the apps {version.name}", (Path(__file__).with_name(name) for name in _LAYER_CODE)
    recipe = grown_recipe("packages", title, version.packages, ros_recipe(), *code)
    directory = cache.ensure(recipe, lambda directory, log: make_layer(recipe, tree, directory, log))
    return [Layer.of(directory / "layer.tar")]


def _compiled(cache: Cache, tree: Path) -> Path:
    """A tar of the programs in C++. The ROS image has the libraries they run with: rospy's own tools need them, too."""
    compiler = grown_recipe("compiler", "the compiler for the apps in C++", pins()["apps"]["compiler"], ros_recipe())
    recipe = Recipe("cpp", "the apps in C++", {"compiler": compiler.key()}, (APPS / "cpp", APPS / "msgs"))
    return cache.ensure(recipe, lambda directory, log: _compile(cache, compiler, tree, directory, log)) / "programs.tar"


def _compile(cache: Cache, compiler: Recipe, tree: Path, directory: Path, log: Path) -> None:
    grown = cache.ensure(compiler, lambda directory, log: grow_tree(compiler, tree, directory, log))
    image = ensure_imported(cache, compiler, grown)
    sources = directory / "sources.tar"
    _pack(sources)
    build(Job(inside(image, _COMPILE, {}), "the apps in C++", log, stdin=sources, stdout=directory / "programs.tar"))
    sources.unlink()


def _build(image: str, version: Version, sources: Path, layer: Path, log: Path) -> None:
    """tests/apps/build.sh inside the ROS image: it generates the messages with Debian's genpy."""
    environment = {"ROSOPS_APPS_VERSION": version.name, **dict(version.environment)}
    build(Job(inside(image, _BUILD, environment), f"the apps {version.name}", log, stdin=sources, stdout=layer))


def _pack(target: Path, compiled: Path | None = None) -> None:
    """The apps' sources, and what is compiled already in `compiled/`."""

    def source(entry: tarfile.TarInfo) -> tarfile.TarInfo | None:
        return None if _NOT_SOURCES.intersection(Path(entry.name).parts) else entry

    with tarfile.open(target, "w") as tar:
        tar.add(APPS, arcname=".", filter=source)
        if compiled:
            with tarfile.open(compiled) as programs:
                for entry in programs:
                    entry.name = f"compiled/{entry.name}"
                    tar.addfile(entry, programs.extractfile(entry))
