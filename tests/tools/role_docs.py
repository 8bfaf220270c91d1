# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes the variables of every role into its README, from meta/argument_specs.yml: they are documented once.

python tests/tools/role_docs.py            # write them
python tests/tools/role_docs.py --check    # fail if a README is not what would be written
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from pathlib import Path
from typing import Any

import yaml

CHECKOUT = Path(__file__).resolve().parents[2]
BEGIN = "<!-- BEGIN variables -->"
END = "<!-- END variables -->"
NOTE = "<!-- From meta/argument_specs.yml, by tests/tools/role_docs.py. Do not edit. -->"
HEADER = "| variable | type | default | |\n|---|---|---|---|"
# Ansible's markup. C, V, O and the rest say what kind of thing is named; in Markdown all of them are code.
CODE = re.compile(r"\b[CVOEMIBP]\(([^()]*(?:\([^()]*\)[^()]*)*)\)")
ROLE_TAG = re.compile(r"#(filter|lookup|module|role)\b")


class RoleDocsError(Exception):
    """A README or a specification that the variables cannot be written from."""


def plain(text: str) -> str:
    """Ansible's markup as Markdown, in one line."""
    text = CODE.sub(lambda found: f"`{ROLE_TAG.sub('', found[1])}`", text)
    return " ".join(text.split()).replace("|", "\\|")


def described(option: dict[str, Any]) -> str:
    """Description, and the choices where there are some."""
    lines = option.get("description", "")
    text = plain(" ".join(lines) if isinstance(lines, list) else str(lines))
    if choices := option.get("choices"):
        text += " One of " + ", ".join(f"`{choice}`" for choice in choices) + "."
    return text


def default_of(option: dict[str, Any]) -> str:
    """The default as code; `required` for what has to be given."""
    if option.get("required"):
        return "required"
    if option.get("default") is None:
        return ""
    value = option["default"]
    text = value if isinstance(value, str) and value else json.dumps(value)
    return f"`{text}`".replace("|", "\\|")


def type_of(option: dict[str, Any]) -> str:
    """`list of str` and the like."""
    kind = str(option.get("type", "str"))
    return f"{kind} of {option['elements']}" if "elements" in option else kind


def rows(options: dict[str, dict[str, Any]], above: str = "") -> list[str]:
    """One row per option, its suboptions below it with their whole path."""
    found: list[str] = []
    for name, option in options.items():
        path = above + name
        found.append(f"| `{path}` | {type_of(option)} | {default_of(option)} | {described(option)} |")
        below = path + ("[]." if option.get("type") == "list" else ".")
        found += rows(option.get("options") or {}, below)
    return found


def section(specs: dict[str, Any]) -> str:
    """What stands between the markers."""
    parts = [NOTE]
    for entry, spec in specs.items():
        if entry != "main":
            parts.append(f"Entry point `{entry}` (`tasks_from: {entry}`): {plain(str(spec['short_description']))}.")
        options = spec.get("options") or {}
        parts.append(HEADER + "\n" + "\n".join(rows(options)) if options else "No variables.")
    return "\n\n".join(parts)


def rendered(readme: str, specs: dict[str, Any]) -> str:
    """The README with its variables; at its end where it has no markers yet."""
    counts = readme.count(BEGIN), readme.count(END)
    if counts == (0, 0):
        readme = readme.rstrip("\n") + f"\n\n## Variables\n\n{BEGIN}\n{END}\n"
    elif counts != (1, 1) or readme.index(BEGIN) > readme.index(END):
        raise RoleDocsError(f"needs one {BEGIN} and one {END} after it")
    head, rest = readme.split(BEGIN)
    tail = rest.split(END)[1]
    return f"{head}{BEGIN}\n{section(specs)}\n{END}{tail}"


def update(role: Path, check: bool) -> bool:
    """Whether the README was, or has to be, changed."""
    readme = role / "README.md"
    found = sorted((role / "meta").glob("argument_specs.y*ml"))
    if not readme.is_file() or not found:
        raise RoleDocsError("needs a README.md and meta/argument_specs.yml")
    specs = yaml.safe_load(found[0].read_text(encoding="utf-8"))["argument_specs"]
    before = readme.read_text(encoding="utf-8")
    after = rendered(before, specs)
    if before == after:
        return False
    if not check:
        readme.write_text(after, encoding="utf-8")
    return True


def main(arguments: list[str] | None = None, roles: Path = CHECKOUT / "roles") -> int:
    """Write or check all roles; says what it found."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--check", action="store_true", help="change nothing, fail if something would be changed")
    check = parser.parse_args(arguments).check
    wrong = 0
    for role in sorted(path for path in roles.iterdir() if path.is_dir()):
        try:
            changed = update(role, check)
        except (RoleDocsError, KeyError, yaml.YAMLError) as error:
            print(f"{role.name}: {error}", file=sys.stderr)
            wrong += 1
            continue
        if changed:
            print(f"{role.name}: README.md {'is not up to date' if check else 'written'}")
            wrong += check
    if wrong and check:
        print("run python tests/tools/role_docs.py", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
