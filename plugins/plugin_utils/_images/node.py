# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Bring images to one node: look, copy, import, pull, verify. A node that has everything costs one command.

The host is handed in, so this knows neither SSH nor Ansible.
"""

from __future__ import annotations

import tempfile
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

from ...module_utils._common.documents import Arguments, Result, Variables
from ...module_utils._common.errors import FleetError, SpecError
from ...module_utils._host.k3s import BINARY
from .archive import Image, normal_ref
from .logins import auths
from .look import LOOK, Present, present
from .pins import LABEL, pins
from .plan import ImagePlan, images_plan, images_problems
from .thin import thin_archive

# On the disk that holds the images anyway.
DIRECTORY = "/var/lib/rancher/rosops-fleet-images"
NOT_FOUND = 127  # the shell's exit status for a command that is not there

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
    another one now (`pins.pins`).
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


class NodeImages:
    """The images of one node; `say` is told what takes long."""

    def __init__(
        self,
        host: NodeHost,
        rate_limit: str = "",
        say: Callable[[str], None] = lambda _text: None,
        logins: Sequence[Variables] = (),
    ) -> None:
        """`logins` are credentials for registries, `{registry, username, password}`."""
        self.host = host
        self.logins = logins
        self.rate_limit = rate_limit
        self.say = say

    def present(self, without_k3s: bool = False) -> Present:
        """What the node has; with `without_k3s`, a host on which k3s is not installed yet has no images."""
        result = self.host.module("ansible.builtin.command", {"argv": ["/bin/sh", "-c", LOOK]})
        if result.get("failed") and not (without_k3s and result.get("rc") == NOT_FOUND):
            raise ImagesError(f"the node's images cannot be listed: {_reason(result)}")
        return present(str(result.get("stdout", "")))

    def bring(
        self,
        archives: Iterable[Arguments],
        names: Iterable[str],
        check: bool = False,
        keep: Iterable[str] = (),
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
        plan = images_plan([{**one, "path": local_path(one["path"])} for one in archives], names, there)
        after = there
        if check:
            known = {ref: digest or there.images.get(ref, "") for ref, digest in plan.wanted.items()}
            after = replace(there, images={**there.images, **known})
        elif plan.bring or plan.pull:
            try:
                after = self._change(plan, there)
            except ImagesError as error:  # whoever goes on without it has to know what there is
                error.details["present"] = dict(self.present().images)
                raise
        changes = pins(plan.wanted, after, map(normal_ref, keep))
        if changes and not check:
            pairs = [word for ref, why in changes.items() for word in (why, ref)]
            self._run("ansible.builtin.command", {"argv": ["/bin/sh", "-c", LABEL, BINARY, *pairs]})
        before, now = ({ref: one.images[ref] for ref in plan.wanted if ref in one.images} for one in (there, after))
        problems = tuple(images_problems(plan.wanted, after.images))
        return Brought(plan.bring, plan.pull, problems, before, now, after.images, changes)

    def _change(self, plan: ImagePlan, there: Present) -> Present:
        """What the node has afterwards. Layers that it had may have gone meanwhile: then all of the archive travels."""
        needed = {path: self._import(path, plan.lacks[path], there) for path in plan.bring}
        self._pull(plan)
        after = self.present()
        again = [path for path, digests in needed.items() if not digests <= after.blobs]
        for path in again:
            self.say(f"the node has not kept all that it had of {path}")
            _require(self._load(path, Path(path)), f"{path} could not be imported")
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
        _require(self._load(path, Path(path)), f"{path} could not be imported")
        return frozenset()

    def _load(self, path: str, file: Path) -> Result:
        """Copy and import a file. Never more than one lies on the node beside the images that come out of it."""
        place, sizes = self._place(path), [f"{one.stat().st_size / 1e6:.1f} MB" for one in (file, Path(path))]
        self._run("ansible.builtin.file", {"path": DIRECTORY, "state": "directory", "mode": "0700"})
        self.say(f"copying {' of '.join(dict.fromkeys(sizes))}: {path}")
        _require(self.host.copy(str(file), place, self.rate_limit), f"{path} could not be copied")
        self.say(f"importing {path}")
        argv = [BINARY, "ctr", "--namespace", "k8s.io", "images", "import", place]
        try:
            return self.host.module("ansible.builtin.command", {"argv": argv})
        finally:  # whole, and of no more use: what cannot be imported now is copied anew by the next run
            self._run("ansible.builtin.file", {"path": place, "state": "absent"})

    def _pull(self, plan: ImagePlan) -> None:
        for name in plan.pull:
            self.say(f"pulling {name}")
            if found := auths(name, self.logins):
                result = self._pull_as(name, found)
            else:
                result = self.host.module("ansible.builtin.command", {"argv": [BINARY, "crictl", "pull", name]})
            held = ", ".join(plan.archived)
            more = f"; no archive in images_archives has it, only {held}" if held else ""
            _require(result, f"{BINARY} crictl pull {name}", more)

    def _pull_as(self, name: str, found: Sequence[str]) -> Result:
        """With each of the credentials, until one will do. They go by standard input: command lines are seen by all."""
        result: Result = {}
        for auth in found:
            args = {"argv": ["/bin/sh", "-c", PULL_AS, BINARY, name], "stdin": auth}
            result = self.host.module("ansible.builtin.command", args, secret=True)
            if not result.get("failed"):
                break
        return result

    def _place(self, path: str) -> str:
        """The same for every run, so that a transfer is resumed; archives of one name lie side by side."""
        return f"{DIRECTORY}/{zlib.crc32(path.encode()):08x}-{Path(path).name}"

    def _run(self, name: str, args: Arguments) -> None:
        what = " ".join(args["argv"]) if "argv" in args else str(args["path"])
        _require(self.host.module(name, args), what)


def local_path(path: Any) -> str:
    """A path on the control node, absolute."""
    return str(Path(str(path)).expanduser().absolute())


def _require(result: Result, what: str, more: str = "") -> None:
    if result.get("failed"):
        raise ImagesError(f"{what}: {_reason(result)}{more}")


def _reason(result: Result) -> str:
    return str(result.get("stderr") or result.get("msg") or "no reason given").strip()
