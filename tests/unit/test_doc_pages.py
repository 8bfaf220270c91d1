# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The pages together: all are found from the index, its tables are the tree's, quoted messages are the code's."""

from __future__ import annotations

import ast
import importlib.util
import re
from collections.abc import Iterator
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[2]
DOCS = CHECKOUT / "docs"
LINK = re.compile(r"\]\(([^)#:\s]+)")
QUOTED = re.compile(r"`([^`]+)`")
TEMPLATE = re.compile(r"\{\{.*?\}\}|\{[\w.:!]*\}|%s", re.DOTALL)


def test_the_index_has_what_the_tree_has() -> None:
    spec = importlib.util.spec_from_file_location("index", CHECKOUT / "tools" / "docs" / "index.py")
    assert spec and spec.loader
    index = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(index)
    page = (DOCS / "index.md").read_text("utf-8")
    assert page == index.rendered(page), "run python tools/docs/index.py"


def test_every_page_is_in_the_index() -> None:
    """GitHub's readers have no other table of contents, and Sphinx makes its own of it."""
    there = {path.resolve() for path in [*DOCS.glob("*.md"), *CHECKOUT.glob("roles/*/README.md")]}
    listed = {(DOCS / name).resolve() for name in LINK.findall((DOCS / "index.md").read_text("utf-8"))}
    assert there - listed == {DOCS / "index.md"}


# --- messages ---------------------------------------------------------------------------------------------------------


def texts(source: str) -> Iterator[str]:
    """Every text of a program, with `...` for what is filled in."""
    parts: set[ast.expr] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.JoinedStr):
            parts.update(node.values)
            yield "".join(str(one.value) if isinstance(one, ast.Constant) else "..." for one in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in parts:
            yield TEMPLATE.sub("...", node.value)


def in_the_code() -> list[str]:
    found = [text for path in CHECKOUT.glob("plugins/**/*.py") for text in texts(path.read_text("utf-8"))]
    for path in [*CHECKOUT.glob("playbooks/**/*.yml"), *CHECKOUT.glob("roles/*/tasks/*.yml")]:
        found.append(TEMPLATE.sub("...", " ".join(path.read_text("utf-8").split())))
    return found


def messages(page: str) -> list[str]:
    """What tables have under `message`, and bold lines: texts of at least three words."""
    quoted, under = [], False
    for line in page.splitlines():
        under = line.startswith("|") and (under or line.startswith("| message "))
        if under or line.startswith("**"):
            quoted += QUOTED.findall(line.split(" | ")[0])
    return [one for one in quoted if len(one.split()) > 2]


def test_quoted_messages_are_in_the_code() -> None:
    quoted, code = messages((DOCS / "troubleshooting.md").read_text("utf-8")), in_the_code()
    assert len(quoted) > 30
    assert [one for one in quoted if not any(one in text for text in code)] == []


def test_a_message_that_nobody_writes_is_found() -> None:
    table = "| message | x |\n|---|---|\n| `nobody writes this message` | `not this column` |\n"
    assert messages(f"{table}\nText with `some other quoted words`.") == ["nobody writes this message"]
    assert list(texts('f"{a} of {b} are {c!r}"; "x {y} z"')) == ["... of ... are ...", "x ... z"]
