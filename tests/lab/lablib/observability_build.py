# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""How a part of the observability stack is made: its programs, by Go or from Debian, are tried out, then packed."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from .artifacts import Cache
from .debian import extract_packages
from .errors import LabError
from .go import go_command, go_environment
from .observability import Part, recipe
from .observability_packages import pick
from .observability_tree import base_files, write_tree
from .oci import Image, write_archive
from .run import Job, build, run

PATH = "PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"


def ensure(cache: Cache, part: Part) -> Path:
    """The part's artifact: the archive, `root/` (the image's files) and `tools/`."""
    return cache.ensure(recipe(part), lambda directory, log: _make(part, directory, log))


def ensure_all(cache: Cache, wanted: Iterable[Part]) -> None:
    """One after the other: each build uses every core by itself."""
    for part in wanted:
        ensure(cache, part)


def _make(part: Part, directory: Path, log: Path) -> None:
    root = directory / "root"
    if part.module:
        for place, package in part.programs.items():
            _compile(part, package, root / place.lstrip("/"), log)
        for name, package in part.tools.items():
            _compile(part, package, directory / "tools" / name, log)
    else:
        tree = directory / "packages.tar"
        extract_packages(part.image, part.packages, tree, log)
        pick(tree, root, part.programs, part.files)
        tree.unlink()
    base_files(root, part.directories, int(part.user))
    for place in part.programs:
        _try_out(part, root, place)
    layer = write_tree(directory / "layer.tar", root)
    write_archive(directory / part.archive, [Image(part.image, [layer], _configuration(part))])
    layer.tar.unlink()


def _compile(part: Part, package: str, target: Path, log: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    linked = ["-s", "-w", *(["-X", f"{part.version_variable}={part.version}"] if part.version_variable else [])]
    options = ["-tags", ",".join(part.tags), "-ldflags", " ".join(linked), "-o", str(target)]
    what = f"{target.name} {part.version} (Go; the first time takes minutes)"
    build(Job([go_command(), "build", *options, package], what, log, cwd=part.module_directory, env=go_environment()))


def _try_out(part: Part, root: Path, place: str) -> None:
    """Each program starts with only the image's files around it, and is the version that the image is named by."""
    done = run(["chroot", str(root), place, "--version"], check=False, timeout=60)
    said = (done.stdout + done.stderr).strip()
    if done.returncode != 0 or part.version not in said:
        raise LabError(
            f"{place} of {part.image} is not the {part.version or 'program'} that it should be",
            where=said[-500:] or f"exit status {done.returncode}",
            todo="see whether tests/lab/pins.toml and what it is made of agree",
        )


def _configuration(part: Part) -> dict[str, object]:
    # The user by number: where a pod has to run as somebody else than root, the kubelet cannot tell that of a name.
    main = next(iter(part.programs))
    return {
        "Env": [PATH],
        "Entrypoint": [main],
        "Cmd": list(part.command),
        "User": part.user,
        "WorkingDir": part.directories[0] if part.directories else "/",
    }
