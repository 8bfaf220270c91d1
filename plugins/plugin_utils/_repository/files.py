# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that shall have a text: what there is, what is to be written, what is somebody else's."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from ...module_utils._common.errors import FleetError


class Change(NamedTuple):
    """A file that does not have the text; `before` is None where there is none."""

    path: str
    before: str | None
    after: str

    @property
    def diff(self) -> dict[str, str]:
        """As `--diff` shows it."""
        headers = {"before_header": self.path, "after_header": self.path}
        return {"before": self.before or "", "after": self.after, **headers}


class Plan(NamedTuple):
    write: list[Change]
    kept: list[str]  # paths of files that differ


def plan(wanted: Mapping[str, str], found: Mapping[str, str], force: bool) -> Plan:
    """What to do about those that differ. Only `force` takes one that is there."""
    changes = [Change(path, found.get(path), text) for path, text in wanted.items() if found.get(path) != text]
    write = [change for change in changes if force or change.before is None]
    return Plan(write, [change.path for change in changes if change not in write])


def read(top: Path, paths: Mapping[str, str]) -> dict[str, str]:
    """Those that are there. A link counts as what it leads to; one that leads nowhere is in the way."""
    found = {}
    for path in paths:
        try:
            found[path] = (top / path).read_bytes().decode("utf-8", "surrogateescape")
        except FileNotFoundError as error:
            if (top / path).is_symlink():
                raise _refused(top / path, error) from error
        except OSError as error:
            raise _refused(top / path, error) from error
    return found


def write(top: Path, changes: list[Change]) -> None:
    """Write them, with the user's own mask for modes."""
    for change in changes:
        target = top / change.path
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(change.after, "utf-8")
        except OSError as error:
            raise _refused(target, error) from error


def _refused(path: Path, error: OSError) -> FleetError:
    return FleetError(f"{path}: {error.strerror}. Move it out of the way, or give another directory with -e dest=...")
