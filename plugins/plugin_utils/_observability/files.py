# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Read rules and dashboards: those that come with the role observability, and the inventory's own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from .._model.finding import Problem
from .dashboards import Dashboard, checked

# By the place of the code and not of the play: the role's tasks run inside other roles', too.
FILES = Path(__file__).resolve().parents[3] / "roles" / "observability" / "files"


@dataclass(frozen=True)
class Files:
    """Texts by file; of dashboards by folder and file, whose name is good for an object."""

    rules: Mapping[str, str] = field(default_factory=dict)
    dashboards: Mapping[str, Mapping[str, str]] = field(default_factory=dict)


def folder(path: Path, suffix: str) -> dict[str, str]:
    """The files of one kind in a folder of the role."""
    return {file.name: file.read_text("utf-8") for file in sorted(path.glob(f"*{suffix}"))}


def stack_files(paths: Sequence[str], base: str, default_dashboards: bool, root: Path = FILES) -> Files:
    """What the stack is built with: the role's files, and the dashboards of the inventory that lie at `paths`."""
    own = folder(root / "dashboards", ".json") if default_dashboards else {}
    # theirs must not have the uid of one that is shown beside them
    beside = {str(root / "dashboards" / name): text for name, text in own.items()}
    theirs = {f"{one.name}.json": one.json for one in read_dashboards(paths, beside, base)} if paths else {}
    return Files(folder(root / "rules", ".yml"), {"Fleet": own, "Own": theirs})


def read_dashboards(paths: Sequence[str], own: Mapping[str, str], base: str = "") -> list[Dashboard]:
    """Those of the files, read and checked, all problems in one SpecError; relative `paths` start from `base`.

    `own` ones, by path, come first, so that a user's duplicate is the one that is named.
    """
    texts, unread = dict(own), list[Problem]()
    for path in dict.fromkeys(Path(base).expanduser() / Path(one).expanduser() for one in paths):
        try:
            texts[str(path)] = path.read_text("utf-8")
        except OSError as error:
            unread.append(Problem(str(path), str(error.strerror)))
        except UnicodeDecodeError:
            unread.append(Problem(str(path), "is no text in UTF-8"))
    return checked(texts.items(), unread)[len(own) :]
