# SPDX-License-Identifier: GPL-3.0-or-later
"""Rules and dashboards from files: those that come with the role observability, and the inventory's own dashboards.

What Grafana would refuse or pass over in silence is found before anything is applied.

Grafana reads provisioned files in the background: a broken one is a line in its log and a dashboard that is not
there. Two with one uid or title are worse, then it stops writing any of them. Runs on the control node.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from ...module_utils._common.documents import Document
from ...module_utils._common.errors import SpecError
from .._model.finding import Problem, shown, taken

# By the place of the code and not of the play: the role's tasks run inside other roles', too.
FILES = Path(__file__).resolve().parents[3] / "roles" / "observability" / "files"
# Kubernetes' own limit on what a ConfigMap holds: keys and values. Server-side apply keeps no second copy in an
# annotation, so this is the only one; `kubectl apply` without it ends at 262144 bytes.
LARGEST = 1024 * 1024
UID = re.compile(r"[A-Za-z0-9_-]{1,40}\Z")
UID_RULE = "1 to 40 letters, digits, '-' and '_'"


@dataclass(frozen=True)
class Files:
    """Texts by file; of dashboards by folder and file, whose name is good for an object."""

    rules: Mapping[str, str] = field(default_factory=dict)
    dashboards: Mapping[str, Mapping[str, str]] = field(default_factory=dict)


class Dashboard(NamedTuple):
    """One that can be applied: `name` suits a Kubernetes object and a file, `json` is what Grafana reads."""

    name: str
    uid: str
    title: str
    json: str


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
    contents: dict[str, bytes] = {path: text.encode() for path, text in own.items()}
    unread: list[Problem] = []
    for path in dict.fromkeys(Path(base).expanduser() / Path(one).expanduser() for one in paths):
        try:
            contents[str(path)] = path.read_bytes()
        except OSError as error:
            unread.append(Problem(str(path), str(error.strerror)))
    return checked(contents.items(), unread)[len(own) :]


def checked(files: Iterable[tuple[str, bytes]], unread: Sequence[Problem] = ()) -> list[Dashboard]:
    """The dashboards of (path, content), the collection's own first. Raises SpecError with every problem at once, those
    of files that could not be read, too."""
    problems = [*unread]
    good: dict[str, Dashboard] = {}
    for path, content in files:
        try:
            page = json.loads(content)
        except ValueError as error:
            problems.append(Problem(path, f"is no JSON ({error})", "a dashboard as Grafana exports it"))
            continue
        found = list(_page_problems(path, page))
        problems += found
        if not found:
            good[path] = _dashboard(page)
    problems += _clashes(good)
    if problems:
        lines = "".join(f"\n  {problem.line()}" for problem in problems)
        raise SpecError(f"dashboards that Grafana cannot take:{lines}", errors=[p._asdict() for p in problems])
    return list(good.values())


def _page_problems(path: str, page: Any) -> Iterator[Problem]:
    if not isinstance(page, dict):
        yield Problem(path, f"holds {shown(page)}", "one JSON object, the dashboard in Grafana's classic format")
        return
    if page.get("__inputs"):
        # provisioning fills in no inputs, so every panel would ask a data source named "${DS_...}"
        allowed = "an export without `Export for sharing externally`"
        yield Problem(
            f"{path}: __inputs", "asks for data sources at import, which a provisioned file cannot answer", allowed
        )
    uid = page.get("uid")
    if uid in (None, ""):
        yield Problem(f"{path}: uid", "is missing", f"{UID_RULE}; without it links break with every restart")
    elif not isinstance(uid, str) or not UID.match(uid):
        yield Problem(f"{path}: uid", f"is {shown(uid)}", UID_RULE)
    title = page.get("title")
    if not isinstance(title, str) or not title.strip():
        yield Problem(f"{path}: title", "is missing" if title in (None, "") else f"is {shown(title)}", "a text")


def _dashboard(page: Document) -> Dashboard:
    uid, title = str(page["uid"]), str(page["title"]).strip()
    # which has to begin and end with a letter or digit
    name = re.sub(r"[^a-z0-9]+", "-", uid.lower()).strip("-") or "dashboard"
    # An id is a row of the database that it was exported from; Grafana warns of it. Without spaces more of it fits.
    return Dashboard(name, uid, title, json.dumps({**page, "id": None}, ensure_ascii=False, separators=(",", ":")))


def _clashes(good: Mapping[str, Dashboard]) -> Iterator[Problem]:
    """With what a ConfigMap holds, and with one another."""
    for path, dashboard in good.items():
        size = len(f"{dashboard.name}.json") + len(dashboard.json.encode())
        if size > LARGEST:
            yield Problem(path, f"is {size} bytes without its spaces", f"{LARGEST}, all that a ConfigMap holds")
    # uids that differ in case or in signs alone make one name of an object, too
    for path, _name, first in taken((path, one.name) for path, one in good.items()):
        problem = f"'{good[path].uid}' is too much like '{good[first].uid}', the uid of {first}"
        yield Problem(f"{path}: uid", problem, "a uid of its own, that differs in letters or digits")
    for path, _title, first in taken((path, one.title.lower()) for path, one in good.items()):
        problem = f"'{good[path].title}' is the title of {first}, too"
        yield Problem(f"{path}: title", problem, "a title of its own: they lie in one folder")
