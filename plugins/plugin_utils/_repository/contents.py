# SPDX-License-Identifier: GPL-3.0-or-later
"""What the repository of one fleet holds, by path: made of the collection's own files, nothing is said twice.

And which of its files are there, which are to be written, which are somebody else's.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import NamedTuple

import yaml

from ...module_utils._common.errors import FleetError

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


def contents(collection: Path, fleet: str, example: str = EXAMPLE_FLEETS[0]) -> dict[str, str]:
    """Path -> text, of the collection in that directory for a fleet of that name with that example."""
    found = {name: _text(collection / name) for name in PLAYBOOKS}
    for path, text in _tree(collection / "playbooks" / "files" / "repository"):
        name = "/".join(re.sub(f"^{HIDDEN}", ".", part) for part in path.parts)
        found[name] = text.replace("@fleet@", fleet)
    examples = {f"inventory/{path}": text for path, text in _tree(collection / "inventories" / "example")}
    examples |= {str(path): text for path, text in _tree(collection / "playbooks" / "files" / "examples" / example)}
    found |= {path: text.replace(EXAMPLE_NAME, f"fleet_name: {fleet}") for path, text in examples.items()}
    found["collections/requirements.yml"] = COLLECTIONS.format(version=_version(collection))
    return dict(sorted(found.items()))


def fleet_name(directory: str) -> str:
    """A directory's name as that of a fleet: a DNS label."""
    return re.sub(r"[^a-z0-9]+", "-", directory.lower()).strip("-")[:LONGEST].rstrip("-") or "fleet"


def _version(collection: Path) -> str:
    """Of an installed collection, or of a checkout."""
    manifest = collection / "MANIFEST.json"
    if manifest.exists():
        return str(json.loads(_text(manifest))["collection_info"]["version"])
    return str(yaml.safe_load(_text(collection / "galaxy.yml"))["version"])


def _tree(top: Path) -> Iterator[tuple[PurePosixPath, str]]:
    for path in sorted(top.rglob("*")):
        if path.is_file():
            yield PurePosixPath(path.relative_to(top)), _text(path)


def _text(path: Path) -> str:
    return path.read_text("utf-8")


# ---- in its directory


class Change(NamedTuple):
    """A file that does not have the text; `before` is None where there is none."""

    path: str
    before: str | None
    after: str

    @property
    def diff(self) -> dict[str, str]:
        """As `--diff` shows it."""
        return {"before": self.before or "", "after": self.after, "before_header": self.path, "after_header": self.path}


def plan(wanted: Mapping[str, str], found: Mapping[str, str], force: bool) -> tuple[list[Change], list[str]]:
    """What to write, and the paths of files that differ and are kept. Only `force` takes one that is there."""
    changes = [Change(path, found.get(path), text) for path, text in wanted.items() if found.get(path) != text]
    write = [change for change in changes if force or change.before is None]
    return write, [change.path for change in changes if change not in write]


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
