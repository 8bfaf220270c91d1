# SPDX-License-Identifier: GPL-3.0-or-later
"""What a browser would forgive, and a test must not: tags that do not match, ids that are twice there or not at all."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from html.parser import HTMLParser
from typing import Any

VOID = frozenset({"meta", "link", "br", "hr", "img", "input"})
# Where a link may lead: nothing is fetched before somebody follows it, and then nobody is told from where.
RUNBOOKS = "https://github.com/rosops/fleet/blob/main/docs/runbooks/"
FETCHING = frozenset({"src", "srcset", "action", "data", "poster", "background", "xlink:href"})


class Page(HTMLParser):
    """What stands in a page, and what is wrong with it."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.problems: list[str] = []
        self.tags: list[str] = []
        self.texts: list[str] = []
        self.attributes: list[tuple[str, dict[str, str]]] = []
        self._open: list[str] = []
        self._ids: list[str] = []
        self._wanted: list[str] = []
        self.feed(text)
        self.close()
        self.problems += [f"<{tag}> is not closed" for tag in self._open]
        self.problems += [f"the id {name} is there twice" for name in {*self._ids} if self._ids.count(name) > 1]
        self.problems += [f"there is no id {name}" for name in self._wanted if name not in self._ids]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = {name: value or "" for name, value in attrs}
        if len(found) != len(attrs):
            self.problems.append(f"<{tag}> has an attribute twice")
        self.tags.append(tag)
        self.attributes.append((tag, found))
        self._ids += [found["id"]] if "id" in found else []
        self._wanted += [found["href"][1:]] if found.get("href", "").startswith("#") else []
        self.problems += [f"<{tag} {name}> is run" for name in found if name.startswith("on")]
        self.problems += [f"<{tag} {name}> is fetched" for name in found if name in FETCHING]
        out = {"rel": "noreferrer"}.items() <= found.items() and found["href"].startswith(RUNBOOKS)
        if not found.get("href", "#").startswith(("#", "data:")) and not out:
            self.problems.append(f"<{tag} href={found['href']}> leads out of the page")
        if tag not in VOID:
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if not self._open or self._open.pop() != tag:
            self.problems.append(f"</{tag}> closes nothing")

    def handle_data(self, data: str) -> None:
        if self._open and self._open[-1] != "style":
            self.texts.append(data)


def rewritten(value: Any, text: str) -> Any:
    """A row, a section or a whole status with this in the place of every text, keys of mappings, too."""
    if isinstance(value, str):
        return text
    if isinstance(value, tuple):
        return tuple(rewritten(item, text) for item in value)
    if isinstance(value, dict):
        return {f"{text}{number}": rewritten(item, text) for number, item in enumerate(value.values())}
    if is_dataclass(value) and not isinstance(value, type):
        return replace(value, **{item.name: rewritten(getattr(value, item.name), text) for item in fields(value)})
    return value
