# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Bring images to one node: look, copy, import, pull, verify. A node that has everything costs one command.

The host is handed in, so this knows neither SSH nor Ansible.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.module_utils._host.k3s import BINARY
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.logins import auths
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.plan import (
    Plan,
    Present,
    images_plan,
    images_problems,
    node_images,
)

# On the disk that holds the images anyway.
DIRECTORY = "/var/lib/rancher/rosops-fleet-images"
NOT_FOUND = 127  # the shell's exit status for a command that is not there

# crictl takes them from its environment, too
PULL_AS = 'IFS= read -r CRICTL_AUTH && export CRICTL_AUTH && exec "$0" crictl pull "$1"'

Result = Mapping[str, Any]


class ImagesError(FleetError):
    """A step of bringing images to a node failed."""


class Host(Protocol):
    """Where the node is. Both calls return what Ansible's modules do: `failed`, `msg`, `rc`, `stdout`, ..."""

    def module(self, name: str, args: Mapping[str, Any], secret: bool = False) -> Result:
        """Run a module on the host, whatever the check mode; nobody logs the arguments of a `secret` one."""

    def copy(self, src: str, dest: str, rate_limit: str) -> Result:
        """Copy a file from the control node; `rate_limit` is rsync's --bwlimit, empty for none."""


@dataclass(frozen=True)
class Brought:
    """Archives imported and names pulled (in check mode: that would be), and what is wrong all the same.

    `before` and `after` are the names that were asked for with their IDs, as far as they are there; what check mode
    would pull has an empty ID in `after`. `present` are all names that the node has now.
    """

    imported: tuple[str, ...] = ()
    pulled: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()
    before: Mapping[str, str] = field(default_factory=dict)
    after: Mapping[str, str] = field(default_factory=dict)
    present: tuple[str, ...] = ()

    @property
    def changed(self) -> bool:
        return bool(self.imported or self.pulled)


class NodeImages:
    """The images of one node; `say` is told what takes long."""

    def __init__(
        self,
        host: Host,
        directory: str = DIRECTORY,
        rate_limit: str = "",
        say: Callable[[str], None] = lambda _text: None,
        logins: Sequence[Mapping[str, Any]] = (),
    ) -> None:
        """`logins` are credentials for registries, `{registry, username, password}`."""
        self.host = host
        self.logins = logins
        self.directory = directory
        self.rate_limit = rate_limit
        self.say = say

    def present(self, without_k3s: bool = False) -> Present:
        """What the node has; with `without_k3s`, a host on which k3s is not installed yet has no images."""
        look = f"uname -m && {BINARY} crictl images -o json"
        result = self.host.module("ansible.builtin.command", {"argv": ["/bin/sh", "-c", look]})
        if result.get("failed") and not (without_k3s and result.get("rc") == NOT_FOUND):
            raise ImagesError(f"the node's images cannot be listed: {_reason(result)}")
        machine, _newline, listing = str(result.get("stdout", "")).partition("\n")
        return Present(machine.strip(), {} if result.get("failed") else node_images(listing))

    def bring(self, archives: Iterable[Mapping[str, Any]], names: Iterable[str], check: bool = False) -> Brought:
        """Import the archives (`{path, images}`) and pull the names that the node lacks; `check` only looks.

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
            after = Present(there.machine, {**there.images, **known})
        elif plan.bring or plan.pull:
            try:
                self._import(plan.bring)
                self._pull(plan)
            except ImagesError as error:  # whoever goes on without it has to know what there is
                error.details["present"] = sorted(self.present().images)
                raise
            after = self.present()
        return _brought(plan, there, after)

    def _import(self, paths: Sequence[str]) -> None:
        """One after the other: never more than one archive lies on the node beside the images that come out of it."""
        for path in paths:
            place = self._place(path)
            self._run("ansible.builtin.file", {"path": self.directory, "state": "directory", "mode": "0700"})
            self.say(f"copying {path}")
            _require(self.host.copy(path, place, self.rate_limit), f"{path} could not be copied")
            self.say(f"importing {path}")
            try:
                self._command("ctr", "--namespace", "k8s.io", "images", "import", place)
            finally:  # whole, and of no more use: what cannot be imported now is copied anew by the next run
                self._run("ansible.builtin.file", {"path": place, "state": "absent"})

    def _pull(self, plan: Plan) -> None:
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
        return f"{self.directory}/{zlib.crc32(path.encode()):08x}-{Path(path).name}"

    def _command(self, *arguments: str) -> None:
        self._run("ansible.builtin.command", {"argv": [BINARY, *arguments]})

    def _run(self, name: str, args: Mapping[str, Any]) -> None:
        what = " ".join(args["argv"]) if "argv" in args else str(args["path"])
        _require(self.host.module(name, args), what)


def local_path(path: Any) -> str:
    """A path on the control node, absolute."""
    return str(Path(str(path)).expanduser().absolute())


def _brought(plan: Plan, before: Present, after: Present) -> Brought:
    return Brought(
        plan.bring,
        plan.pull,
        tuple(images_problems(plan.wanted, after.images)),
        {ref: before.images[ref] for ref in plan.wanted if ref in before.images},
        {ref: after.images[ref] for ref in plan.wanted if ref in after.images},
        tuple(sorted(after.images)),
    )


def _require(result: Result, what: str, more: str = "") -> None:
    if result.get("failed"):
        raise ImagesError(f"{what}: {_reason(result)}{more}")


def _reason(result: Result) -> str:
    return str(result.get("stderr") or result.get("msg") or "no reason given").strip()
