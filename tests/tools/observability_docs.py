# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes the table of the dissertation's keys into docs/observability.md, from the role's defaults: they stand once.

python tests/tools/observability_docs.py            # write it
python tests/tools/observability_docs.py --check    # fail if the page is not what would be written
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

import yaml

CHECKOUT = Path(__file__).resolve().parents[2]
PAGE = CHECKOUT / "docs" / "observability.md"
DEFAULTS = CHECKOUT / "roles" / "observability" / "defaults" / "main.yml"
BEGIN = "<!-- BEGIN keys -->"
END = "<!-- END keys -->"
NOTE = "<!-- From roles/observability/defaults, by tests/tools/observability_docs.py. Do not edit. -->"
EXPRESSION = re.compile(r"\{\{ (?P<key>observability(?:\.\w+)+) \| default\((?P<default>.*)\) \}\}")


def keys(defaults: dict[str, object]) -> dict[str, tuple[str, str]]:
    """`{key of the dissertation: (variable, default)}`."""
    found = {}
    for variable, value in defaults.items():
        # what a missing mapping stands for is in the way of its keys' names
        text = re.sub(r"[()]", "", str(value).replace(" | default({})", "")) if isinstance(value, str) else ""
        match = EXPRESSION.fullmatch(re.sub(r"\| default(.*?) \}\}", r"| default(\1) }}", text))
        if match:
            found[match["key"]] = (variable, match["default"].strip("'"))
    return found


def table(defaults: dict[str, object]) -> str:
    rows = [
        f"| `{key}` | `{name}` | {f'`{default}`' if default else ''} |"
        for key, (name, default) in keys(defaults).items()
    ]
    return "\n".join([NOTE, "", "| key | variable | default |", "|---|---|---|", *rows])


def rendered(page: str, defaults: dict[str, object]) -> str:
    """The page with its table."""
    head, rest = page.split(BEGIN)
    return f"{head}{BEGIN}\n{table(defaults)}\n{END}{rest.split(END)[1]}"


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--check", action="store_true", help="change nothing, fail if something would be changed")
    check = parser.parse_args(arguments).check
    before = PAGE.read_text(encoding="utf-8")
    after = rendered(before, yaml.safe_load(DEFAULTS.read_text(encoding="utf-8")))
    if before != after and not check:
        PAGE.write_text(after, encoding="utf-8")
    if before != after and check:
        print("docs/observability.md: run python tests/tools/observability_docs.py", file=sys.stderr)
    return 1 if before != after and check else 0


if __name__ == "__main__":
    sys.exit(main())
