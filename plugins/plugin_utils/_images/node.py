# SPDX-License-Identifier: GPL-3.0-or-later
"""The images of one node. A node that has everything costs one command.

Brought is what it lacks: look, plan, copy, import, pull, verify. The host is handed in, so this knows neither SSH nor
Ansible.

Kept is what the kubelet may not delete when the disk fills. It deletes what no container uses, the longest unused
first: what was brought for the next step, and what that step would go back to. So what is wanted is pinned, and of each
repository what was wanted or ran before it. What is older is let go, once no container uses it.
"""

from __future__ import annotations

import base64
import re
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

from ...module_utils._common.documents import Arguments, Result, Variables, json_of
from ...module_utils._common.errors import FleetError, SpecError
from ...module_utils._host.k3s import BINARY
from .._model.machines import architecture_of
from .archive import Image, archive_images, local_path, normal_ref, thin_archive

# What is just brought, on the disk that holds the images anyway: one archive at a time, which the next run resumes.
PLACE = "/var/lib/rancher/rosops-fleet-images.tar"
NOT_FOUND = 127  # the shell's exit status for a command that is not there
HUB = ("docker.io", "index.docker.io", "registry-1.docker.io")  # its names
# crictl takes them from its environment, too
PULL_AS = 'IFS= read -r CRICTL_AUTH && export CRICTL_AUTH && exec "$0" crictl pull "$1"'

PIN = "rosops.fleet/pinned"  # whose value says why this collection keeps an image; k3s has a label of its own, too
WANTED, BEFORE, LET_GO = "wanted", "before", ""
CTR = f"{BINARY} ctr --namespace k8s.io"
_LOOKS = ("uname -m", f"{BINARY} crictl images -o json", f"{CTR} images ls", f"{CTR} content ls -q",
          f"{BINARY} crictl ps -a -o json")  # fmt: skip
_BREAK = "--- rosops.fleet ---"
LOOK = f" && echo '{_BREAK}' && ".join(_LOOKS)
# The second label is the one that containerd's CRI tells the kubelet of. An empty value takes a label away.
LABEL = (
    'while [ $# -gt 0 ]; do "$0" ctr --namespace k8s.io images label "$2" "io.cri-containerd.pinned=${1:+pinned}" '
    f'"{PIN}=$1" >/dev/null || exit; shift 2; done'
)


class ImagesError(FleetError):
    """A step of bringing images to a node failed."""


class NodeHost(Protocol):
    """Where the node is. Both calls return what Ansible's modules do: `failed`, `msg`, `rc`, `stdout`, ..."""

    def module(self, name: str, args: Arguments, secret: bool = False) -> Result:
        """Run a module on the host, whatever the check mode; nobody logs the arguments of a `secret` one."""

    def copy(self, src: str, dest: str, rate_limit: str) -> Result:
        """Copy a file from the control node, mode 0600; `rate_limit` is rsync's --bwlimit, empty for none."""


@dataclass(frozen=True)
class Present:
    """A node's machine (as `uname -m` says it), and its images: full name to ID, names by digest included.

    `pins` are names with the reason for which they are kept, `blobs` the digests of all content, `used` the IDs of the
    images of containers that are there, ended ones too.
    """

    machine: str
    images: Mapping[str, str]
    pins: Mapping[str, str] = field(default_factory=dict)
    blobs: frozenset[str] = frozenset()
    used: frozenset[str] = frozenset()


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
    ) -> Result:
        """Import the archives (`{path, images}`) and pull the names that the node lacks; `check` only looks. What of
        `keep` an earlier run pinned stays pinned. Returned is a task's result, with all that the node has in `present`.

        SpecError for an archive that cannot be used, ImagesError for a step that fails on the node. What an interrupted
        transfer left stays there, for the next one to resume.
        """
        archives, names = [*archives], [*names]
        if not archives and not names:
            return {"changed": False, "present": {}}
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
        problems = [
            f"{ref} has the ID {after.images[ref]}, not {digest}" if ref in after.images else f"{ref} is not there"
            for ref, digest in sorted(wanted.items())
            if ref not in after.images or (digest and after.images[ref] != digest)
        ]
        return {
            "changed": bool(lacking or pull or changes),
            "present": dict(after.images),
            "diff": {"before": _lines(wanted, there), "after": _lines(wanted, after)},
            **({"failed": True, "msg": "; ".join(problems)} if problems else {}),
        }

    def _change(
        self, wanted: Mapping[str, str], lacking: Mapping[str, Sequence[Image]], pull: Iterable[str], there: Present
    ) -> Present:
        """What the node has afterwards."""
        for path, images in lacking.items():
            self._import(path, images, there)
        archived = ", ".join(sorted(ref for ref, digest in wanted.items() if digest))
        for name in pull:
            more = f"; no archive in images_archives has it, only {archived}" if archived else ""
            _require(self._pull(name), f"{BINARY} crictl pull {name}", more)
        return self.present()

    def _import(self, path: str, images: Sequence[Image], there: Present) -> None:
        """The part that the node lacks. Layers that it had may have gone meanwhile: then all of the archive travels."""
        with tempfile.TemporaryDirectory() as directory:
            file, needed = Path(directory, "thin.tar"), None
            try:
                needed = thin_archive(path, images, there.blobs, file)
            except (OSError, SpecError) as error:  # no room for it here, or not as it was a moment ago
                self.say(f"no part of {path} is left out: {error}")
            if needed is not None and not self._load(path, file).get("failed"):
                if needed <= self.present().blobs:
                    return
                self.say(f"the node has not kept all that it had of {path}")
        _require(self._load(path, Path(path)), f"{path} could not be imported")

    def _load(self, path: str, file: Path) -> Result:
        """Copy and import a file. Never more than one lies on the node beside the images that come out of it."""
        sizes = [f"{one.stat().st_size / 1e6:.1f} MB" for one in (file, Path(path))]
        self.say(f"copying {' of '.join(dict.fromkeys(sizes))}: {path}")
        _require(self.host.copy(str(file), PLACE, self.rate_limit), f"{path} could not be copied")
        self.say(f"importing {path}")
        try:
            return self._command(BINARY, "ctr", "--namespace", "k8s.io", "images", "import", PLACE)
        finally:  # whole, and of no more use: what cannot be imported now is copied anew by the next run
            _require(self.host.module("ansible.builtin.file", {"path": PLACE, "state": "absent"}), PLACE)

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

    def _command(self, *argv: str, stdin: str = "") -> Result:
        """Run it; what it gets on its standard input is a secret."""
        given = {"argv": [*argv], **({"stdin": stdin} if stdin else {})}
        return self.host.module("ansible.builtin.command", given, secret=bool(stdin))


def _lines(wanted: Iterable[str], there: Present) -> str:
    found = sorted((ref, there.images[ref]) for ref in wanted if ref in there.images)
    return "".join(f"{ref} {digest or 'as the registry has it'}\n" for ref, digest in found)


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

    An archive is `{path, images}`, where `images` names those that count; none means all. Of a name that several hold
    the last one counts, and comes again where one before it, with another image of that name, has to be brought.
    """
    wanted: dict[str, str] = {}
    bring: dict[str, Sequence[Image]] = {}
    chosen = [(str(one["path"]), _chosen(one, archive_images(str(one["path"]), present.machine))) for one in archives]
    for path, images in chosen:
        wrong = sorted({image.architecture for image in images} - {architecture_of(present.machine), ""})
        if wrong:
            raise SpecError(f"{path} holds images for {', '.join(wrong)}, but the host is {present.machine}")
        wanted.update({image.ref: image.id for image in images})
    replaced = set[str]()
    for path, images in chosen:
        own = [image for image in images if image.id == wanted[image.ref]]
        if missing := [one for one in own if one.ref in replaced or present.images.get(one.ref) != one.id]:
            bring[path] = [*bring.get(path, ()), *missing]
            replaced |= {image.ref for image in images} - {image.ref for image in own}
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


# --- what is there ----------------------------------------------------------------------------------------------------


def present(printed: str) -> Present:
    """Out of what LOOK printed. A host without k3s has got no further than its machine."""
    machine, images, labels, blobs, containers, *_none = [*f"{printed}\n".split(f"{_BREAK}\n"), "", "", "", ""]
    used = frozenset(_digest(str(one.get("imageRef") or "")) for one in _listed(containers, "containers"))
    return Present(machine.strip(), node_images(images), _pins(labels), frozenset(blobs.split()), used)


def node_images(listing: str) -> dict[str, str]:
    """Name to ID of a node's images, out of what `crictl images -o json` prints. Names by digest are in it, too."""
    try:
        return {
            normal_ref(ref): _digest(image["id"])
            for image in _listed(listing, "images")
            for ref in [*(image.get("repoTags") or []), *(image.get("repoDigests") or [])]
        }
    except (AttributeError, LookupError, TypeError) as error:
        raise SpecError(f"crictl's list is of another shape: {type(error).__name__}: {error}") from error


def _listed(printed: str, key: str) -> list[Result]:
    """The objects of a list that crictl printed."""
    try:
        return [dict(one) for one in json_of(printed.strip() or "{}").get(key) or []]
    except (AttributeError, TypeError, ValueError) as error:
        raise SpecError(f"crictl's list is no JSON: {error}") from error


def _digest(image: str) -> str:
    return image if re.match(r"^\w+:", image) else f"sha256:{image}"


def _pins(table: str) -> dict[str, str]:
    """Of `ctr images ls`: the name is the first column, and labels are the last one, without a blank."""
    rows = [line.split() for line in table.splitlines()[1:]]
    labels = {row[0]: dict(item.partition("=")[::2] for item in row[-1].split(",")) for row in rows if row}
    return {normal_ref(ref): own[PIN] for ref, own in labels.items() if own.get(PIN)}


# --- what is kept -----------------------------------------------------------------------------------------------------


def pins(wanted: Iterable[str], there: Present, keep: Iterable[str] = ()) -> dict[str, str]:
    """Names whose pin has to change, and to what. One of `keep` stays pinned, where it is."""
    names = [*wanted, *(ref for ref in keep if ref in there.pins)]
    now = {ref: WANTED for ref in names if ref in there.images}
    ours = {_repository(ref) for ref in now}
    runs = {ref for ref, image in there.images.items() if image in there.used and "@" not in ref}
    left = [ref for ref in there.pins if ref in there.images and ref not in now]
    moved = {_repository(ref) for ref in left if there.pins[ref] == WANTED}
    for ref in left:
        older = there.pins[ref] == BEFORE and _repository(ref) in moved
        now[ref] = LET_GO if older and ref not in runs else BEFORE
    now.update({ref: BEFORE for ref in runs - now.keys() if _repository(ref) in ours})
    return {ref: why for ref, why in sorted(now.items()) if there.pins.get(ref, LET_GO) != why}


def _repository(ref: str) -> str:
    """A name without tag and digest."""
    return re.sub(r"(:[^/:@]*)?(@.*)?$", "", ref, count=1)
