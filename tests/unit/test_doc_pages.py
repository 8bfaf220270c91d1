# SPDX-License-Identifier: GPL-3.0-or-later
"""The pages together: all are found from the index, its tables are the tree's, quoted messages are the code's."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import yaml
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.role_specs import role_options
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.spec import PORTS
from ansible_collections.rosops.fleet.plugins.plugin_utils._preflight.findings import TAKEN
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.hosts import PORTS as NODE_PORTS
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.launches import SINGLE
from imports import loaded

CHECKOUT = Path(__file__).resolve().parents[2]
DOCS = CHECKOUT / "docs"
LINK = re.compile(r"\]\(([^)#:\s]+)")
QUOTED = re.compile(r"`([^`]+)`")
TEMPLATE = re.compile(r"\{\{.*?\}\}|\{[\w.:!]*\}|%s", re.DOTALL)


def test_the_index_has_what_the_tree_has() -> None:
    index = loaded(CHECKOUT / "tools" / "docs" / "index.py")
    page = (DOCS / "index.md").read_text("utf-8")
    assert page == index.rendered(page), "run python tools/docs/index.py"


def test_every_page_is_in_the_index() -> None:
    """GitHub's readers have no other table of contents, and Sphinx makes its own of it."""
    there = {path.resolve() for path in [*DOCS.glob("*.md"), *CHECKOUT.glob("roles/*/README.md")]}
    listed = {(DOCS / name).resolve() for name in LINK.findall((DOCS / "index.md").read_text("utf-8"))}
    assert there - listed == {DOCS / "index.md"}


def test_what_there_must_not_be_two_of_is_on_the_page_that_says_so() -> None:
    packages = (DOCS / "apps.md").read_text("utf-8").partition("## Common packages")[2].partition("\n\nA ")[0]
    assert {*SINGLE} - {*QUOTED.findall(packages)} == set()


def test_the_ports_that_hosts_open_are_on_the_page_that_lists_them() -> None:
    opened = {str(port) for part in TAKEN.values() for _protocol, port in part} | {str(PORTS["node-exporter"])}
    opened |= {str(role_options("observability")[name]["default"]) for name in NODE_PORTS}
    assert opened - {*re.findall(r"\d+", (DOCS / "ports.md").read_text("utf-8"))} == set()


# --- links ------------------------------------------------------------------------------------------------------------

TARGET = re.compile(r"\]\(([^)\s]+)\)|^\[[^\]]+\]: (\S+)$", re.MULTILINE)
USED = re.compile(r"(?<!\])\[([^\]\n]+)\](?:\[([^\]\n]+)\])?(?![(:\w])")
HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)


def anchors(page: Path) -> set[str]:
    """Of its headings, as GitHub makes them."""
    headings = HEADING.findall(page.read_text("utf-8"))
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def broken(page: Path, target: str) -> bool:
    """Whether a link of that page leads to no file of the checkout, or to no heading of it."""
    name, _, anchor = target.partition("#")
    to = (page.parent / name).resolve() if name else page
    return not to.exists() or bool(anchor and anchor not in anchors(to))


def test_readme_s_links_work_where_it_stands_alone() -> None:
    """Galaxy shows README and no other page: its links are whole addresses in the repository that galaxy.yml names."""
    repository = yaml.safe_load((CHECKOUT / "galaxy.yml").read_text("utf-8"))["repository"]
    page = CHECKOUT / "README.md"
    text = page.read_text("utf-8")
    targets = [inline or defined for inline, defined in TARGET.findall(text)]
    assert [target for target in targets if not target.startswith("https://")] == []
    ours = [target.removeprefix(f"{repository}/blob/main/") for target in targets if target.startswith(repository)]
    assert len(ours) > 20
    assert [target for target in ours if broken(page, target)] == []


def test_readme_s_links_are_defined_and_used() -> None:
    text = (CHECKOUT / "README.md").read_text("utf-8")
    prose = re.sub(r"`[^`]*`|^    .*$", "", text, flags=re.MULTILINE)
    defined = set(re.findall(r"^\[([^\]]+)\]: ", text, re.MULTILINE))
    assert {(by or said).lower() for said, by in USED.findall(prose)} == {name.lower() for name in defined}


def test_links_of_pages_lead_somewhere() -> None:
    pages = [*DOCS.rglob("*.md"), *CHECKOUT.glob("roles/*/README.md"), *CHECKOUT.glob("tests/*/README.md")]
    links = [(page, inline or defined) for page in pages for inline, defined in TARGET.findall(page.read_text("utf-8"))]
    links = [(page, target) for page, target in links if "://" not in target]
    assert len(links) > 200
    assert [f"{page.relative_to(CHECKOUT)}: {target}" for page, target in links if broken(page, target)] == []


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
    quoted, code = messages((DOCS / "troubleshooting.md").read_text("utf-8")), "\0".join(in_the_code())
    assert len(quoted) > 30
    # a table's title is in capitals on the screen
    assert [one for one in quoted if one not in code and one not in code.upper()] == []


def test_a_message_that_nobody_writes_is_found() -> None:
    table = "| message | x |\n|---|---|\n| `nobody writes this message` | `not this column` |\n"
    assert messages(f"{table}\nText with `some other quoted words`.") == ["nobody writes this message"]
    assert list(texts('f"{a} of {b} are {c!r}"; "x {y} z"')) == ["... of ... are ...", "x ... z"]
