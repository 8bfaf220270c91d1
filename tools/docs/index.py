# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes the tables of playbooks, roles and modules into docs/index.md: what each is for stands in the thing itself.

python tools/docs/index.py
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import yaml

CHECKOUT = Path(__file__).resolve().parents[2]
PAGE = CHECKOUT / "docs" / "index.md"
BEGIN = "<!-- BEGIN tables: written by tools/docs/index.py -->"
END = "<!-- END tables -->"


def playbooks() -> Iterator[tuple[Path, str]]:
    """Each with the first sentence of its first comment."""
    for path in sorted(CHECKOUT.glob("playbooks/*.yml")):
        lines = path.read_text("utf-8").splitlines()[1:]  # after the ---
        comment = lines[: next(n for n, line in enumerate(lines) if not line.startswith("#"))]
        text = " ".join(line.removeprefix("#").strip() for line in comment)
        yield path, re.split(r"(?<=[.:]) ", text)[0].rstrip(".:")


def roles() -> Iterator[tuple[Path, str]]:
    """Each README, with the role's short description."""
    for path in sorted(CHECKOUT.glob("roles/*/meta/argument_specs.yml")):
        said = yaml.safe_load(path.read_text("utf-8"))["argument_specs"]["main"]["short_description"]
        yield path.parents[1] / "README.md", said


def plugins() -> Iterator[tuple[Path, str]]:
    """Modules but for the private one, and the callback."""
    for path in [*sorted(CHECKOUT.glob("plugins/modules/[!_]*.py")), *sorted(CHECKOUT.glob("plugins/callback/*.py"))]:
        for node in ast.parse(path.read_text("utf-8")).body:
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "DOCUMENTATION":
                yield path, yaml.safe_load(ast.literal_eval(node.value))["short_description"]


def table(heading: str, rows: Iterator[tuple[Path, str]]) -> str:
    lines = ["", f"## {heading}", "", "| | |", "|---|---|"]
    for path, said in rows:
        name = path.parent.name if path.name == "README.md" else path.stem
        lines.append(f"| [{name}](../{path.relative_to(CHECKOUT)}) | {said} |")
    return "\n".join(lines)


def rendered(page: str) -> str:
    """The page with its tables."""
    head, rest = page.split(BEGIN)
    tables = [table("Playbooks", playbooks()), table("Roles", roles()), table("Modules and the callback", plugins())]
    return f"{head}{BEGIN}\n" + "\n".join(tables) + f"\n\n{END}{rest.split(END)[1]}"


if __name__ == "__main__":
    PAGE.write_text(rendered(PAGE.read_text("utf-8")), encoding="utf-8")
