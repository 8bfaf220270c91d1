# SPDX-License-Identifier: GPL-3.0-or-later
"""Bring images to one node: look, plan, copy, import, pull, verify. A node that has everything costs one command.

The host is handed in, so this knows neither SSH nor Ansible.
"""

from __future__ import annotations

import base64
import re
import tempfile
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

from ...module_utils._common.documents import Arguments, Result, Variables
from ...module_utils._common.errors import FleetError, SpecError
from ...module_utils._host.k3s import BINARY
from .._model.machines import architecture_of
from .archive import Image, archive_images, local_path, normal_ref, thin_archive
from .look import LABEL, LOOK, Present, pins, present

# On the disk that holds the images anyway.
DIRECTORY = "/var/lib/rancher/rosops-fleet-images"
NOT_FOUND = 127  # the shell's exit status for a command that is not there
HUB = ("docker.io", "index.docker.io", "registry-1.docker.io")  # its names
# crictl takes them from its environment, too
PULL_AS = 'IFS= read -r CRICTL_AUTH && export CRICTL_AUTH && exec "$0" crictl pull "$1"'


class ImagesError(FleetError):
    """A step of bringing images to a node failed."""


class NodeHost(Protocol):
    """Where the node is. Both calls return what Ansible's modules do: `failed`, `msg`, `rc`, `stdout`, ..."""

    def module(self, name: str, args: Arguments, secret: bool = False) -> Result:
        """Run a module on the host, whatever the check mode; nobody logs the arguments of a `secret` one."""

    def copy(self, src: str, dest: str, rate_limit: str) -> Result:
        """Copy a file from the control node; `rate_limit` is rsync's --bwlimit, empty for none."""


@dataclass(frozen=True)
class Brought:
    """Archives imported and names pulled (in check mode: that would be), and what is wrong all the same.

    `before` and `after` are the names that were asked for with their IDs, as far as they are there; what check mode
    would pull has an empty ID in `after`. `present` are all that the node has now, `pins` those whose pin is
    another one now (`look.pins`).
    """

    imported: tuple[str, ...] = ()
    pulled: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()
    before: Mapping[str, str] = field(default_factory=dict)
    after: Mapping[str, str] = field(default_factory=dict)
    present: Mapping[str, str] = field(default_factory=dict)
    pins: Mapping[str, str] = field(default_factory=dict)

    @property
    def changed(self) -> bool:
        return bool(self.imported or self.pulled or self.pins)


@dataclass(frozen=True)
class NodeImages:
    """The images of one node. `say` is told what takes long; `logins` are `{registry, username, password}`."""

    host: NodeHost
    rate_limit: str = ""
    say: Callable[[str], None] = lambda _text: None
    logins: Sequence[Variables] = ()

    def present(self, without_k3s: bool = False) -> Present:
        """What the node has; with `without_k3s`, a host on which k3s is not installed yet has no images."""
        result = self._command("/bin/sh", "-c", LOOK)
        if result.get("failed") and not (without_k3s and result.get("rc") == NOT_FOUND):
            raise ImagesError(f"the node's images cannot be listed: {_reason(result)}")
        return present(str(result.get("stdout", "")))

    def bring(
        self, archives: Iterable[Arguments], names: Iterable[str], check: bool = False, keep: Iterable[str] = ()
    ) -> Brought:
        """Import the archives (`{path, images}`) and pull the names that the node lacks; `check` only looks. What of
        `keep` an earlier run pinned stays pinned.

        SpecError for an archive that cannot be used, ImagesError for a step that fails on the node. What an interrupted
        transfer left stays there, for the next one to resume.
        """
        archives, names = [*archives], [*names]
        if not archives and not names:
            return Brought()
        there = self.present(without_k3s=check)
        archives = [{**one, "path": local_path(one["path"])} for one in archives]
        wanted, lacking, pull = images_plan(archives, names, there)
        after = there
        if check:
            known = {ref: digest or there.images.get(ref, "") for ref, digest in wanted.items()}
            after = replace(there, images={**there.images, **known})
        elif lacking or pull:
            try:
                after = self._change(wanted, lacking, pull, there)
            except ImagesError as error:  # whoever goes on without it has to know what there is
                error.details["present"] = dict(self.present().images)
                raise
        changes = pins(wanted, after, map(normal_ref, keep))
        if changes and not check:
            pairs = [word for ref, why in changes.items() for word in (why, ref)]
            _require(self._command("/bin/sh", "-c", LABEL, BINARY, *pairs), f"images not pinned: {' '.join(pairs)}")
        before, now = ({ref: one.images[ref] for ref in wanted if ref in one.images} for one in (there, after))
        problems = tuple(images_problems(wanted, after.images))
        return Brought(tuple(lacking), tuple(pull), problems, before, now, after.images, changes)

    def _change(
        self, wanted: Mapping[str, str], lacking: Mapping[str, Sequence[Image]], pull: Iterable[str], there: Present
    ) -> Present:
        """What the node has afterwards. Layers that it had may have gone meanwhile: then all of the archive travels."""
        needed = {path: self._import(path, images, there) for path, images in lacking.items()}
        archived = ", ".join(sorted(ref for ref, digest in wanted.items() if digest))
        for name in pull:
            more = f"; no archive in images_archives has it, only {archived}" if archived else ""
            _require(self._pull(name), f"{BINARY} crictl pull {name}", more)
        after = self.present()
        again = [path for path, digests in needed.items() if not digests <= after.blobs]
        for path in again:
            self.say(f"the node has not kept all that it had of {path}")
            self._whole(path)
        return self.present() if again else after

    def _import(self, path: str, images: Sequence[Image], there: Present) -> frozenset[str]:
        """What of the archive the node has to have afterwards, where only a part of it travelled."""
        with tempfile.TemporaryDirectory() as directory:
            file, needed = Path(directory, "thin.tar"), None
            try:
                needed = thin_archive(path, images, there.blobs, file)
            except (OSError, SpecError) as error:  # no room for it here, or not as it was a moment ago
                self.say(f"no part of {path} is left out: {error}")
            if needed is not None and not self._load(path, file).get("failed"):
                return needed
        self._whole(path)
        return frozenset()

    def _whole(self, path: str) -> None:
        _require(self._load(path, Path(path)), f"{path} could not be imported")

    def _load(self, path: str, file: Path) -> Result:
        """Copy and import a file. Never more than one lies on the node beside the images that come out of it."""
        place, sizes = self._place(path), [f"{one.stat().st_size / 1e6:.1f} MB" for one in (file, Path(path))]
        self._file(DIRECTORY, state="directory", mode="0700")
        self.say(f"copying {' of '.join(dict.fromkeys(sizes))}: {path}")
        _require(self.host.copy(str(file), place, self.rate_limit), f"{path} could not be copied")
        self.say(f"importing {path}")
        try:
            return self._command(BINARY, "ctr", "--namespace", "k8s.io", "images", "import", place)
        finally:  # whole, and of no more use: what cannot be imported now is copied anew by the next run
            self._file(place, state="absent")

    def _pull(self, name: str) -> Result:
        """With each of the credentials, until one will do. They go by standard input: command lines are seen by all."""
        self.say(f"pulling {name}")
        result: Result = {}
        for auth in auths(name, self.logins) or [""]:
            how = ("/bin/sh", "-c", PULL_AS, BINARY, name) if auth else (BINARY, "crictl", "pull", name)
            result = self._command(*how, stdin=auth)
            if not result.get("failed"):
                break
        return result

    def _place(self, path: str) -> str:
        """The same for every run, so that a transfer is resumed; archives of one name lie side by side."""
        return f"{DIRECTORY}/{zlib.crc32(path.encode()):08x}-{Path(path).name}"

    def _file(self, path: str, **wanted: str) -> None:
        _require(self.host.module("ansible.builtin.file", {"path": path, **wanted}), path)

    def _command(self, *argv: str, stdin: str = "") -> Result:
        """Run it; what it gets on its standard input is a secret."""
        given = {"argv": [*argv], **({"stdin": stdin} if stdin else {})}
        return self.host.module("ansible.builtin.command", given, secret=bool(stdin))


def _require(result: Result, what: str, more: str = "") -> None:
    if result.get("failed"):
        raise ImagesError(f"{what}: {_reason(result)}{more}")


def _reason(result: Result) -> str:
    return str(result.get("stderr") or result.get("msg") or "no reason given").strip()


# --- what is to be done -----------------------------------------------------------------------------------------------


def images_plan(
    archives: Iterable[Arguments], names: Iterable[str], present: Present
) -> tuple[dict[str, str], dict[str, Sequence[Image]], list[str]]:
    """What must be there in the end, name to ID; the archives to bring, each with those of its images that the node
    lacks; and the names to pull, which no archive holds. A pulled image's ID is not known beforehand and is empty.

    An archive is `{path, images}`, where `images` names those that count; none means all.
    """
    wanted: dict[str, str] = {}
    bring: dict[str, Sequence[Image]] = {}
    for archive in archives:
        path = str(archive["path"])
        images = _chosen(archive, archive_images(path, present.machine))
        wrong = sorted({image.architecture for image in images} - {architecture_of(present.machine), ""})
        if wrong:
            raise SpecError(f"{path} holds images for {', '.join(wrong)}, but the host is {present.machine}")
        wanted.update({image.ref: image.id for image in images})
        if missing := [image for image in images if present.images.get(image.ref) != image.id]:
            bring[path] = missing
    refs = list(dict.fromkeys(normal_ref(name) for name in names))
    pull = [ref for ref in refs if ref not in present.images and ref not in wanted]
    return {**dict.fromkeys(refs, ""), **wanted}, bring, pull


def _chosen(archive: Arguments, images: list[Image]) -> list[Image]:
    """All of the archive's images, or those that are named."""
    names = [normal_ref(ref) for ref in archive.get("images") or []]
    missing = sorted(set(names) - {image.ref for image in images})
    if missing:
        held = ", ".join(image.ref for image in images)
        raise SpecError(f"{archive['path']} does not hold {', '.join(missing)}, only {held}")
    return [image for image in images if image.ref in names] if names else images


def images_problems(wanted: Mapping[str, str], present: Mapping[str, str]) -> list[str]:
    """What is still wrong on the node once all was brought, a line each; both are name to ID."""
    return [
        f"{ref} is not there" if ref not in present else f"{ref} has the ID {present[ref]}, not {digest}"
        for ref, digest in sorted(wanted.items())
        if ref not in present or (digest and present[ref] != digest)
    ]


def auths(image: str, logins: Iterable[Variables]) -> list[str]:
    """`user:password` in base64, for each of the logins (`{registry, username, password}`) to the image's registry.

    As the kubelet takes them from pull secrets. Items without `registry` name Secrets that somebody else keeps: only
    the cluster knows what is in them.
    """
    place = _place(normal_ref(image))
    found = [
        base64.b64encode(f"{login['username']}:{login['password']}".encode()).decode()
        for login in logins
        if login.get("registry") and f"{place}/".startswith(f"{_place(str(login['registry']))}/")
    ]
    return list(dict.fromkeys(found))


def _place(address: str) -> str:
    """Host and path, without scheme and API version; the Hub has several names."""
    host, slash, path = re.sub(r"^https?://", "", address).rstrip("/").partition("/")
    path = re.sub(r"^v[12]$", "", path)
    return f"{HUB[0] if host in HUB else host}{slash if path else ''}{path}"
