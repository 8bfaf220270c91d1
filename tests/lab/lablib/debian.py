# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Debian trees by mmdebstrap, and their way into podman's storage."""

from __future__ import annotations

import os
import shlex
from collections.abc import Sequence
from pathlib import Path

from .artifacts import Cache, Recipe
from .errors import LabError
from .paths import IMAGES, pins
from .podman import PODMAN, podman, podman_try
from .run import Job, build, run

# The machine's own ways to reach its Debian mirror; a tree is built with an apt configuration of its own.
_INHERITED = ("Acquire::http", "Acquire::https", "Acquire::Check-Valid-Until", "Acquire::Check-Date")
_NO_DOCUMENTATION = ("/usr/share/man/*", "/usr/share/doc/*", "/usr/share/locale/*", "/usr/share/info/*")
REPOSITORY = "localhost/rosops-lab"


def tree_recipe(kind: str, title: str, packages: Sequence[str]) -> Recipe:
    return Recipe(
        kind=kind,
        title=title,
        values={"options": _options(packages), "suite": pins()["debian"]["suite"]},
        files=(IMAGES / kind,),
    )


def _options(packages: Sequence[str]) -> list[str]:
    """What decides what is in the tree; the rest of the command line is about this machine."""
    return [
        *("--variant=minbase", "--aptopt=Apt::Install-Recommends false"),
        *(f"--dpkgopt=path-exclude={path}" for path in _NO_DOCUMENTATION),
        f"--include={','.join(sorted(packages))}",
    ]


def make_tree(recipe: Recipe, directory: Path, log: Path) -> None:
    """`rootfs.tar` in the artifact's directory."""
    if os.geteuid() != 0:
        raise LabError("the lab needs root: it builds Debian trees and runs privileged containers", todo="run as root")
    customize = IMAGES / recipe.kind / "customize.sh"
    scratch = directory / "scratch"
    scratch.mkdir()
    command = [
        # A mount and a process namespace of its own: an interrupted build leaves no mount and no process behind.
        *("unshare", "--mount", "--pid", "--fork", "--kill-child", "--mount-proc"),
        *("mmdebstrap", "--mode=root", *recipe.values["options"]),
        *(f"--aptopt={line}" for line in _apt_settings()),
        f'--customize-hook=sh {shlex.quote(str(customize))} "$1"',
        recipe.values["suite"],
        str(directory / "rootfs.tar"),
    ]
    if mirror := os.environ.get("ROSOPS_LAB_MIRROR"):
        command.append(mirror)
    build(Job(command, recipe.title, log, env={"TMPDIR": str(scratch)}))
    scratch.rmdir()


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
