# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the repository of one fleet holds, by path: made of the collection's own files, nothing is said twice."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any

import yaml

PLAYBOOKS = ("site.yml", "update.yml", "rollback.yml", "status.yml", "guarded.yml", "validate.yml")
# Hidden files stand under another name, or they would be this checkout's own settings.
HIDDEN = "dot-"
EXAMPLE_NAME = "fleet_name: example"
EXAMPLE_FLEETS = ("talker", "launch")  # the first is inventories/example, another is laid over it
LONGEST = 63
COLLECTIONS = """---
collections: # and what it needs itself
  - name: rosops.fleet
    version: {version}
"""
PACKAGES = """# what the control node needs; an execution environment of AWX has it from the collection
ansible-core{core}
"""


def contents(collection: Path, fleet: str, example: str = EXAMPLE_FLEETS[0]) -> dict[str, str]:
    """Path -> text, of the collection in that directory for a fleet of that name with that example."""
    found = {name: _text(collection / name) for name in PLAYBOOKS}
    version = _version(collection)
    for path, text in _tree(collection / "playbooks" / "files" / "repository"):
        name = "/".join(re.sub(f"^{HIDDEN}", ".", part) for part in path.parts)
        found[name] = text.replace("@fleet@", fleet)
    examples = {f"inventory/{path}": text for path, text in _tree(collection / "inventories" / "example")}
    examples |= {str(path): text for path, text in _tree(collection / "playbooks" / "files" / "examples" / example)}
    found |= {path: text.replace(EXAMPLE_NAME, f"fleet_name: {fleet}") for path, text in examples.items()}
    found["collections/requirements.yml"] = COLLECTIONS.format(version=version)
    core = yaml.safe_load(_text(collection / "meta" / "runtime.yml"))["requires_ansible"]
    found["requirements.txt"] = PACKAGES.format(core=core) + _text(collection / "meta" / "ee-requirements.txt")
    return dict(sorted(found.items()))


def fleet_name(directory: str) -> str:
    """A directory's name as that of a fleet: a DNS label."""
    return re.sub(r"[^a-z0-9]+", "-", directory.lower()).strip("-")[:LONGEST].rstrip("-") or "fleet"


def _version(collection: Path) -> str:
    """Of an installed collection, or of a checkout."""
    manifest = collection / "MANIFEST.json"
    about: dict[str, Any] = (
        json.loads(_text(manifest))["collection_info"]
        if manifest.exists()
        else yaml.safe_load(_text(collection / "galaxy.yml"))
    )
    return str(about["version"])


def _tree(top: Path) -> Iterator[tuple[PurePosixPath, str]]:
    for path in sorted(top.rglob("*")):
        if path.is_file():
            yield PurePosixPath(path.relative_to(top)), _text(path)


def _text(path: Path) -> str:
    return path.read_text("utf-8")
