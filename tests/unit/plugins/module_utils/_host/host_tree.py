# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A host out of files."""

from __future__ import annotations

from pathlib import Path

from ansible_collections.rosops.fleet.plugins.module_utils._host.files import Host


def tree(tmp_path: Path, files: dict[str, str]) -> Host:
    """The host whose root is `tmp_path`; `files` come to those that are there."""
    for name, content in files.items():
        file = tmp_path / name.lstrip("/")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(content)
    return Host(str(tmp_path))
