# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A Rigelfile in, the inventory of a fleet out, on the control node."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any, ClassVar

from ansible.utils.display import Display
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError, SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.base import FleetAction
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.files import write
from ansible_collections.rosops.fleet.plugins.plugin_utils._repository.files import Change, plan, read
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.application import UNTOLD, label
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.files import files, screen
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.fleet import Imported, imported

display = Display()


class ActionModule(FleetAction):
    _requires_connection = False
    ARGUMENTS: ClassVar = {
        "src": {"type": "path", "required": True},
        "dest": {"type": "path", "required": True},
        "inventory": {"type": "str", "default": "inventory"},
        "fleet_name": {"type": "str", "default": ""},
        "force": {"type": "bool", "default": False},
    }

    def work(self, params: Mapping[str, Any], _known: dict[str, Any]) -> dict[str, Any]:
        source, dest = Path(params["src"]).absolute(), Path(params["dest"]).absolute()
        inventory = _below(params["inventory"])
        fleet_name = params["fleet_name"] or label(dest.name) or "fleet"
        found = imported(_read(source), source.name, os.environ, fleet_name)
        wanted = {**files(found, source.name, inventory), **_dashboards(found, source.parent)}
        planned = plan(wanted, read(dest, wanted), params["force"])
        kept = sorted(planned.kept)
        display.display(f"\n{screen(found, params['dest'], inventory)}\n")
        if kept:
            raise FleetError(
                f"{params['dest']} has {', '.join(kept)} with another text, which an import does not touch; "
                "import into another directory and compare, or overwrite them with force (-e force=yes)",
                kept=kept,
            )
        if not self._task.check_mode:
            _write_all(dest, planned.write, found)
        return {
            "changed": bool(planned.write),
            "files": sorted(change.path for change in planned.write),
            "notes": [note._asdict() for note in found.notes],
            "diff": [change.diff for change in planned.write],
        }


def _below(given: str) -> str:
    path = PurePosixPath(given)
    if path.is_absolute() or ".." in path.parts:
        raise SpecError(f"inventory: is {given!r}; allowed: a directory below dest, or empty for dest itself")
    return "" if str(path) == "." else str(path)


def _read(path: Path) -> str:
    try:
        return path.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise SpecError(f"{path}: cannot be read: {error}; name a file of text, as -e rigelfile=Rigelfile") from error


def _dashboards(found: Imported, directory: Path) -> dict[str, str]:
    """The dashboards that the Rigelfile names, as files of the repository."""
    return {f"dashboards/{PurePosixPath(path).name}": _read(directory / path) for path in found.dashboards}


def _write_all(dest: Path, changes: Sequence[Change], found: Imported) -> None:
    mode = 0o600 if any(UNTOLD in note.told for note in found.notes) else 0o644
    for change in changes:
        target = dest / change.path
        try:
            write(target, change.after, mode)
        except OSError as error:
            raise FleetError(f"{target}: cannot be written: {error}; give a directory that is yours as dest") from error
