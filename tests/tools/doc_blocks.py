# SPDX-License-Identifier: GPL-3.0-or-later
"""What README, docs and the roles' READMEs show as code, block by block."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import yaml

CHECKOUT = Path(__file__).resolve().parents[2]
PAGES = [CHECKOUT / name for name in ("README.md", "CONTRIBUTING.md")]
PAGES += sorted(
    [*CHECKOUT.glob("docs/**/*.md"), *CHECKOUT.glob("roles/*/README.md"), *CHECKOUT.glob("tests/*/README.md")]
)
FIRST_KEY = re.compile(r"(- )?[A-Za-z_][\w.-]*:( |$)")
FENCE = re.compile(r"^ *```(?P<language>\S*)")
COMMENT = re.compile(r"^ *<!-- (?P<text>.*) -->$")
SHELLS = ("bash", "sh", "shell", "console")


class Block(NamedTuple):
    """Text that is set off by four columns, or stands between fences."""

    where: str
    text: str
    language: str = ""  # a fence's; of columns nothing is known
    mark: str = ""  # the comment right above it

    @property
    def value(self) -> Any:
        return yaml.safe_load(self.text)

    @property
    def is_yaml(self) -> bool:
        if self.mark == "not a fleet":  # of another program, or with words of ours that are no inventory
            return False
        first = next((line for line in self.text.splitlines() if not line.startswith("#")), "")
        return self.language in ("yaml", "yml") or (not self.language and bool(FIRST_KEY.match(first)))

    @property
    def is_shell(self) -> bool:
        """Whatever is not said to be something else: `<!-- not commands -->`."""
        return self.language in SHELLS or not (
            self.language or self.is_yaml or self.mark in ("not commands", "not a fleet")
        )

    @property
    def commands(self) -> list[str]:
        """One a line, without comments and the blanks that align them."""
        lines = self.text.replace("\\\n", " ").splitlines()
        said = [re.sub(r"(^|\s)#\s.*", "", line).strip() for line in lines]
        return [" ".join(line.split()) for line in said if line]


def blocks_of(name: str, page: str) -> Iterator[Block]:
    lines = ["", *page.splitlines(), ""]
    number = 1
    while number < len(lines):
        line, begin = lines[number], number
        if fence := FENCE.match(line):
            number = next(n for n in range(begin + 1, len(lines)) if lines[n].strip() == "```") + 1
            inner, language = lines[begin + 1 : number - 1], fence["language"]
        elif line.startswith("    ") and line.strip() and not lines[number - 1].strip():
            number = next((n for n in range(begin, len(lines)) if lines[n][:4].strip()), len(lines))
            inner, language = lines[begin:number], ""
        else:
            number += 1
            continue
        above = next((text for text in reversed(lines[:begin]) if text.strip()), "")
        comment = COMMENT.match(above)
        text = textwrap.dedent("\n".join(inner)).rstrip() + "\n"
        yield Block(f"{name}:{begin}", text, language, comment["text"] if comment else "")


def blocks() -> Iterator[Block]:
    """Those of all pages."""
    for page in PAGES:
        yield from blocks_of(str(page.relative_to(CHECKOUT)), page.read_text("utf-8"))
