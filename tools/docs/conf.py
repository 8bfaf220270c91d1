# SPDX-License-Identifier: GPL-3.0-or-later
"""Sphinx's settings for `make docs`.

The pages are written for GitHub, too: plain Markdown with relative links. What Sphinx needs beside that is added while
it reads them: lists of pages are tables of contents, and a link to a file that is no page leads to its reference page
or to the repository.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml
from docutils.nodes import reference

if TYPE_CHECKING:
    from docutils.nodes import Element
    from sphinx.addnodes import pending_xref
    from sphinx.application import Sphinx

CHECKOUT = Path(__file__).resolve().parents[2]
GALAXY = yaml.safe_load((CHECKOUT / "galaxy.yml").read_text("utf-8"))
REPOSITORY = f"{GALAXY['repository']}/blob/main"

project = f"{GALAXY['namespace']}.{GALAXY['name']}"
copyright = f"2026, {GALAXY['authors'][0]}"
version = release = GALAXY["version"]

extensions = ["myst_parser", "sphinx_antsibull_ext"]
root_doc = "docs/index"
myst_heading_anchors = 4  # links to headings are GitHub's
myst_enable_extensions = ["tasklist"]
highlight_language = "none"  # blocks are set off by columns and do not say what they are

html_theme = "furo"
html_title = f"{project} {release}"
html_show_sphinx = False

LINK = re.compile(r"\]\((?P<path>[\w./-]+)(?P<anchor>#[\w-]+)?\)")
# a page that begins an item of a list, or a row of a table
CONTENTS = re.compile(r"^## (?P<heading>.+)$|^[*|] \[(?P<title>[^]]+)\]\((?P<page>[\w./-]+\.md)\)", re.MULTILINE)
PLUGIN = re.compile(r"plugins/(?:modules/(?P<module>\w+)|callback/(?P<callback>\w+))\.py")
# What the reference refers to in Ansible's documentation, whose inventory of labels is not fetched for it.
ANSIBLE = "https://docs.ansible.com/ansible/latest"
LABELS = {
    "action_plugins": "plugins/action.html",
    "ansible_configuration_settings": "reference_appendices/config.html",
    "callback_plugins": "plugins/callback.html",
    "common_return_values": "reference_appendices/common_return_values.html",
}
OTHERS = re.compile(r"ansible_collections\.(?!rosops\.fleet\.)(\w+)\.(\w+)\.(\w+)")
LISTS = ("docs/index", "docs/runbooks/README")


def toctree(caption: str, pages: list[str]) -> str:
    captions = [f":caption: {caption}"] if caption else []
    return "\n".join(["", "```{toctree}", ":hidden:", *captions, "", *pages, "```", ""])


def contents(page: str) -> str:
    """The page's lists as Sphinx's tables of contents, headings as captions."""
    lists: dict[str, list[str]] = {}
    heading = ""
    for found in CONTENTS.finditer(page):
        heading = found["heading"] or heading
        if found["page"]:
            lists.setdefault(heading, []).append(f"{found['title']} <{found['page']}>")
    return "".join(toctree(caption, pages) for caption, pages in lists.items())


def linked(text: str, page: Path, source: Path) -> str:
    """The text, where links to files that are no pages lead to the reference or the repository."""

    def target(found: re.Match[str]) -> str:
        path = (page.parent / found["path"]).resolve()
        if path.exists() or not path.is_relative_to(source):  # a page or a picture, or for Sphinx to refuse
            return found[0]
        name = path.relative_to(source).as_posix()
        if not (CHECKOUT / name).exists():
            return found[0]  # Sphinx says that it is missing
        if plugin := PLUGIN.fullmatch(name):
            up = "../" * len(page.relative_to(source).parent.parts)
            return f"]({up}reference/{plugin[plugin.lastgroup or 0]}_{plugin.lastgroup}.rst)"
        return f"]({REPOSITORY}/{name}{found['anchor'] or ''})"

    return LINK.sub(target, text)


def prepare(app: Sphinx, name: str, content: list[str]) -> None:
    """What GitHub does not need and Sphinx does."""
    page = Path(app.env.doc2path(name)).resolve()
    if page.suffix == ".md":
        content[0] = content[0].replace(f"]: {REPOSITORY}/", "]: ")  # README's, which Galaxy shows without the others
        content[0] = linked(content[0], page, Path(app.srcdir).resolve())
        if name in LISTS:
            content[0] += contents(content[0])
        if name == root_doc:
            content[0] += toctree("Reference", ["../reference/index.rst"])


def elsewhere(_app: Sphinx, _env: object, node: pending_xref, content: Element) -> reference | None:
    """A link to Ansible's documentation; any other label that nobody defines stays Sphinx's to tell."""
    label = str(node["reftarget"])
    other = OTHERS.fullmatch(label)
    path = f"collections/{other[1]}/{other[2]}/{other[3]}.html" if other else LABELS.get(label)
    return reference("", "", content, refuri=f"{ANSIBLE}/{path}", internal=False) if path else None


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("source-read", prepare)
    app.connect("missing-reference", elsewhere)
    return {"parallel_read_safe": True}
