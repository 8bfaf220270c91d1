# SPDX-License-Identifier: GPL-3.0-or-later
"""Which files each stage of `make test` depends on, and which stages have passed with the same ones.

The table may name too much and never too little. A name with a slash at its end is a directory; a stage without a row
depends on all files. Beside its files a stage depends on the machine: its Python, its packages, and what the caller's
environment says to tests and lab.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

# How every stage is run, and with what.
RUNNING = (
    "Makefile", "ansible.cfg", "constraints.txt", "pyproject.toml", "requirements.txt", "meta/", "tests/environments/",
    "tests/run_stages.py", "tests/tools/", "tests/lab/find_python", "tests/lab/lab", "tests/lab/lablib/",
    "tests/lab/pins.toml",
)  # fmt: skip
PLAYBOOKS = ("guarded.yml", "rollback.yml", "site.yml", "status.yml", "update.yml", "validate.yml")
COLLECTION = ("galaxy.yml", "plugins/", "roles/", "playbooks/", "inventories/", *PLAYBOOKS)
PAGES = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "docs/", "tests/apps/README.md", "tests/lab/README.md")
LABS = ("molecule/", "tests/lab/", "tests/apps/")
PACKAGE = (*COLLECTION, *PAGES, "LICENSE", "awx/", "changelogs/", "tests/sanity/")
STAGES = {
    "docs": (*PACKAGE, "tools/docs/"),
    "test-playbooks": (*COLLECTION, "awx/", "tests/unit/"),
    "sanity": (*PACKAGE, "tests/ansible_test.sh"),
    "sanity-all": (*PACKAGE, "tests/ansible_test.sh"),
    "dist": (*PACKAGE, "tests/dist/"),
    "test-bad-input": (*COLLECTION, "tests/bad_input/", "tests/unit/"),
    "test-go": ("tests/lab/labk3s/",),
    "test-browser": ("plugins/", "tests/browser/", "tests/unit/", "docs/screens/"),
    "test-ros": ("plugins/", "playbooks/files/", "tests/ros/", "tests/unit/"),
    "molecule-default": (*COLLECTION, *LABS),
    "molecule-update": (*COLLECTION, *LABS, "tests/update/"),
}
ENVIRONMENT = ("ROSOPS_", "LAB_", "CORE")
PACKAGES = Path("/var/lib/dpkg/status")  # a test that was skipped for want of one is not skipped any more


def depends(stage: str, name: str) -> bool:
    """Whether a stage depends on a file of the checkout."""
    if stage not in STAGES:
        return True
    return any(name == one or (one[-1] == "/" and name.startswith(one)) for one in (*RUNNING, *STAGES[stage]))


def digest(stage: str, files: Mapping[str, str], machine: Iterable[str]) -> str:
    """Of all that a stage depends on; `files` is name -> digest of what is in it."""
    lines = [*machine, *(f"{name} {files[name]}" for name in sorted(files) if depends(stage, name))]
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def contents(checkout: Path) -> dict[str, str]:
    """The files that git knows or would take, with a digest of each one's content and kind; none without git."""
    git = ["git", "-c", f"safe.directory={checkout}"]
    command = [*git, "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=checkout, capture_output=True, check=False).stdout  # noqa: S603 - fixed words
    found = {}
    for name in filter(None, os.fsdecode(listed).split("\0")):
        with contextlib.suppress(FileNotFoundError, IsADirectoryError):  # removed meanwhile; a repository of its own
            found[name] = file_digest(checkout / name)
    return found


def file_digest(path: Path) -> str:
    data = os.fsencode(path.readlink()) if path.is_symlink() else path.read_bytes()
    return f"{path.lstat().st_mode:o} {hashlib.sha256(data).hexdigest()}"


def machine() -> list[str]:
    """What a stage depends on beside the checkout."""
    said = [f"{name}={value}" for name, value in sorted(os.environ.items()) if name.startswith(ENVIRONMENT)]
    packages = hashlib.sha256(PACKAGES.read_bytes()).hexdigest() if PACKAGES.exists() else ""
    return [sys.version, packages, *said]


class Passed:
    """The stages that passed, and with which digest: a file for each one below `place`."""

    def __init__(self, place: Path, read: Callable[[], Mapping[str, str]], fresh: bool = False) -> None:
        self._place, self._read, self._fresh = place, read, fresh

    def digest(self, stage: str) -> str:
        """As the files are now; nothing where they cannot be told."""
        files = self._read()
        return digest(stage, files, machine()) if files else ""

    def before(self, stage: str, now: str) -> bool:
        """Whether it passed with this digest; never where everything is to be run."""
        path = self._place / stage
        return bool(now) and not self._fresh and path.exists() and path.read_text("utf-8") == now

    def keep(self, stage: str, begun: str) -> None:
        """It passed, and what was changed while it ran is not what it ran with."""
        if begun and begun == self.digest(stage):
            self._place.mkdir(parents=True, exist_ok=True)
            (self._place / stage).write_text(begun, "utf-8")
