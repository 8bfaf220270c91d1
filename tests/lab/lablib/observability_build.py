# SPDX-License-Identifier: GPL-3.0-or-later
"""How a part of the observability stack is made: its programs, by Go or from Debian, are tried out, then packed."""

from __future__ import annotations

import os
import posixpath
import shutil
import tarfile
from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path

from .artifacts import Cache
from .debian import extract_packages
from .errors import LabError
from .go import complete, go_command, go_environment
from .observability import Part, recipe
from .oci import Image, Layer, write_archive
from .run import Job, build, run

PATH = "PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
ACCOUNTS = "root:x:0:0:root:/:/sbin/nologin\nnobody:x:65534:65534:nobody:/:/sbin/nologin\n"
GROUPS = "root:x:0:\nnobody:x:65534:\n"
_LINKS = 8


def ensure(cache: Cache, part: Part) -> Path:
    """The part's artifact: the archive, `root/` (the image's files) and `tools/`."""
    return cache.ensure(recipe(part), lambda directory, log: _make(part, directory, log))


def _make(part: Part, directory: Path, log: Path) -> None:
    root = directory / "root"
    if part.module:
        targets = {root / place.lstrip("/"): package for place, package in part.programs.items()}
        targets |= {directory / "tools" / name: package for name, package in part.tools.items()}
        modules = directory / "modules"
        options = ["-tags", ",".join(part.tags)]
        complete(part.module_directory, [*options, *sorted(targets.values())], part.sums, modules, log)
        for target, package in targets.items():
            _compile(part, package, target, [f"-modfile={modules / 'go.mod'}", *options], log)
        shutil.rmtree(modules)
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


def _compile(part: Part, package: str, target: Path, options: list[str], log: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    linked = ["-s", "-w", *(["-X", f"{part.version_variable}={part.version}"] if part.version_variable else [])]
    command = [go_command(), "build", *options, "-ldflags", " ".join(linked), "-o", str(target), package]
    what = f"{target.name} {part.version} (Go; the first time takes minutes)"
    build(Job(command, what, log, go_environment(), part.module_directory))


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


def base_files(root: Path, directories: Iterable[str], user: int) -> None:
    """What a program expects of every system: accounts, a place for temporary files; and the directories of its own."""
    for name, content in (("etc/passwd", ACCOUNTS), ("etc/group", GROUPS)):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(content)
    (root / "tmp").mkdir()
    (root / "tmp").chmod(0o1777)
    for name in directories:
        own = root / name.lstrip("/")
        own.mkdir(parents=True, exist_ok=True)
        os.chown(own, user, user)


def write_tree(target: Path, root: Path) -> Layer:
    """A layer of all files under a directory, byte for byte the same for the same files: without times and names."""
    with tarfile.open(target, "w", format=tarfile.USTAR_FORMAT) as tar:
        for path in sorted(root.rglob("*")):
            entry = tar.gettarinfo(path, arcname=str(path.relative_to(root)))
            entry.mtime, entry.uname, entry.gname = 0, "", ""
            if entry.isreg():
                with path.open("rb") as handle:
                    tar.addfile(entry, handle)
            else:
                tar.addfile(entry)
    return Layer.of(target)


def pick(tree: Path, root: Path, programs: Mapping[str, str], files: Sequence[str]) -> None:
    """Out of a tar: each program (place = path in the tar), and the files, by pattern, to their own places."""
    with tarfile.open(tree) as tar:
        entries = {posixpath.normpath(entry.name): entry for entry in tar}
        wanted = dict(programs)
        for pattern in files:
            found = [name for name, entry in entries.items() if fnmatchcase(name, pattern) and not entry.isdir()]
            if not found:
                raise LabError(f"no file {pattern} in the packages", where=str(tree), todo="see what has it now")
            wanted.update({f"/{name}": name for name in found})
        for place, source in wanted.items():
            target = root / place.lstrip("/")
            target.parent.mkdir(parents=True, exist_ok=True)
            content = tar.extractfile(_file(entries, source, tree))
            assert content is not None
            with target.open("wb") as sink:
                shutil.copyfileobj(content, sink)
            target.chmod(0o755)


def _file(entries: Mapping[str, tarfile.TarInfo], name: str, tree: Path) -> tarfile.TarInfo:
    """The file that a name leads to, by way of links."""
    for _link in range(_LINKS):
        entry = entries.get(name)
        if entry is None:
            raise LabError(f"no file {name} in the packages", where=str(tree), todo="see where it is now")
        if entry.isreg():
            return entry
        name = posixpath.normpath(posixpath.join("/", posixpath.dirname(name), entry.linkname)).lstrip("/")
    raise LabError(f"{name} leads to no file", where=str(tree))
