# SPDX-License-Identifier: GPL-3.0-or-later
"""Debian trees by mmdebstrap, layers of packages on top of one, and the trees' way into podman's storage."""

from __future__ import annotations

import os
import shlex
import tempfile
from collections.abc import Sequence
from pathlib import Path

from .artifacts import Cache, Recipe
from .errors import LabError
from .oci import write_difference
from .paths import IMAGES, pins
from .podman import PODMAN, podman, podman_try
from .run import Job, build, run

# The machine's own ways to reach its Debian mirror; a tree is built with an apt configuration of its own.
_INHERITED = ("Acquire::http", "Acquire::https", "Acquire::Check-Valid-Until", "Acquire::Check-Date")
_NO_DOCUMENTATION = ("/usr/share/man/*", "/usr/share/doc/*", "/usr/share/locale/*", "/usr/share/info/*")
# What mmdebstrap makes anew in every tree, and what a container gets from its runtime.
_NOT_IN_A_LAYER = ("dev", "etc/machine-id", "proc", "run", "sys", "tmp")
REPOSITORY = "localhost/rosops-lab"


def tree_recipe(kind: str, title: str, packages: Sequence[str]) -> Recipe:
    return Recipe(
        kind=kind,
        title=title,
        values={"options": _options(packages), "suite": pins()["debian"]["suite"]},
        files=(IMAGES / kind,),
    )


def grown_recipe(kind: str, title: str, packages: Sequence[str], below: Recipe, *files: Path) -> Recipe:
    """Packages on top of the tree of another recipe; `files` are what is done with them."""
    return Recipe(
        kind=kind,
        title=title,
        values={
            "options": _options(packages, "custom"),  # nothing but what is asked for
            "suite": pins()["debian"]["suite"],
            "below": below.key(),
        },
        files=files,
    )


def _options(packages: Sequence[str], variant: str = "minbase") -> list[str]:
    """What decides what is in the tree; the rest of the command line is about this machine."""
    return [
        *(f"--variant={variant}", "--aptopt=Apt::Install-Recommends false"),
        *(f"--dpkgopt=path-exclude={path}" for path in _NO_DOCUMENTATION),
        f"--include={','.join(sorted(packages))}",
    ]


def make_tree(recipe: Recipe, directory: Path, log: Path) -> None:
    """`rootfs.tar` in the artifact's directory."""
    customize = shlex.quote(str(IMAGES / recipe.kind / "customize.sh"))
    _mmdebstrap(recipe, directory / "rootfs.tar", log, f'--customize-hook=sh {customize} "$1"')


def make_layer(recipe: Recipe, below: Path, directory: Path, log: Path) -> None:
    """`layer.tar` in the artifact's directory: what installing the recipe's packages changes in the tree below."""
    grown = directory / "grown.tar"
    _mmdebstrap(recipe, grown, log, *_on_top_of(below))
    write_difference(directory / "layer.tar", below / "rootfs.tar", grown, leave_out=_NOT_IN_A_LAYER)
    grown.unlink()


def grow_tree(recipe: Recipe, below: Path, directory: Path, log: Path) -> None:
    """`rootfs.tar` in the artifact's directory: the tree below with the recipe's packages on top."""
    _mmdebstrap(recipe, directory / "rootfs.tar", log, *_on_top_of(below))


def extract_packages(title: str, packages: Sequence[str], target: Path, log: Path) -> None:
    """`target`: a tar of what is in the packages and in those that they need. They are unpacked, not set up."""
    values = {"options": _options(packages, "extract"), "suite": pins()["debian"]["suite"]}
    _mmdebstrap(Recipe("extract", title, values), target, log)


def _on_top_of(below: Path) -> tuple[str, ...]:
    unpack = f'tar --extract --preserve-permissions --directory "$1" --file {shlex.quote(str(below / "rootfs.tar"))}'
    # unsafe: a build that the machine's crash interrupts is thrown away, so nothing has to be on the disk in between
    return "--skip=check/empty", "--dpkgopt=force-unsafe-io", f"--setup-hook={unpack}"


def _mmdebstrap(recipe: Recipe, target: Path, log: Path, *options: str) -> None:
    if os.geteuid() != 0:
        raise LabError("the lab needs root: it builds Debian trees and runs privileged containers", todo="run as root")
    command = [
        # A mount and a process namespace of its own: an interrupted build leaves no mount and no process behind.
        *("unshare", "--mount", "--pid", "--fork", "--kill-child", "--mount-proc"),
        *("mmdebstrap", "--mode=root", *recipe.values["options"]),
        *(f"--aptopt={line}" for line in _apt_settings()),
        *options,
        recipe.values["suite"],
        str(target),
    ]
    if mirror := os.environ.get("ROSOPS_LAB_MIRROR"):
        command.append(mirror)
    with tempfile.TemporaryDirectory(prefix="scratch-", dir=target.parent) as scratch:
        build(Job(command, recipe.title, log, env={"TMPDIR": scratch}))


def _apt_settings() -> list[str]:
    lines = run(["apt-config", "dump"]).stdout.splitlines()
    return [line.rstrip(";") for line in lines if line.startswith(_INHERITED) and not line.endswith('"";')]


def ensure_imported(cache: Cache, recipe: Recipe, tree: Path) -> str:
    """The tree as a podman image; imported again where podman's storage has lost it. Old ones are removed."""
    image = f"{REPOSITORY}/{recipe.kind}:{recipe.key()}"
    if podman_try("image", "exists", image).returncode != 0:
        with cache.lock(f"import-{recipe.kind}", f"another import of {recipe.title}"):
            if podman_try("image", "exists", image).returncode != 0:
                log = cache.logs / f"{tree.name}.log"
                command = [*PODMAN, "import", str(tree / "rootfs.tar"), image]
                build(Job(command, f"{recipe.title} into podman", log))
                _prune(cache, recipe.kind)
    return image


def _prune(cache: Cache, kind: str) -> None:
    """An image without its artifact is of no use; one that a host still runs from stays until the next time."""
    for line in podman("images", "--format", "{{.Repository}}:{{.Tag}}", f"{REPOSITORY}/{kind}").splitlines():
        if not (cache.artifacts / f"{kind}-{line.rpartition(':')[2]}").is_dir():
            podman_try("rmi", line)
