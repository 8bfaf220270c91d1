# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Read the rules and dashboards that come with the role observability."""

from __future__ import annotations

from pathlib import Path

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import stack as _observability

# By the place of the code and not of the play: the role's tasks run inside other roles', too.
FILES = Path(_observability.__file__).resolve().parents[2] / "roles" / "observability" / "files"


def own_files(root: Path = FILES) -> dict[str, dict[str, str]]:
    """`{rules: {name: text}, loki_rules: {..}, dashboards: {..}}`; a folder that is missing or empty gives nothing."""
    return {
        "rules": folder(root / "rules", ".yml"),
        "loki_rules": folder(root / "loki-rules", ".yml"),
        "dashboards": folder(root / "dashboards", ".json"),
    }


def folder(path: Path, suffix: str) -> dict[str, str]:
    """The files of one kind in a folder."""
    try:
        found = sorted(path.glob(f"*{suffix}"))
        return {file.name: file.read_text("utf-8") for file in found}
    except (OSError, UnicodeDecodeError) as error:
        raise SpecError(f"{path} cannot be read: {error}") from error
