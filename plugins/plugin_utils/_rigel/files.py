# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The imported fleet as files of a repository: an inventory, and what is said about the import."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

import yaml
from ansible_collections.rosops.fleet.plugins.module_utils._common.printable import printable
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.fleet import EDGE, HOSTS, ROBOT, Imported
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.part import CHANGED, LEFT, OPEN, SAME, TAKEN, Note
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.variables import Filled, Verbatim

REPORT = "IMPORT.md"
PLACEHOLDER = "FILL IN"
HOSTS_TEXT = f"""\
---
# A Rigelfile knows no hosts. {PLACEHOLDER} the addresses, and add a line for each further robot. Names are those of
# robots and Kubernetes nodes: lower case letters, digits, dashes. Hosts need SSH, Python 3 and a user who may become
# root.
all:
  children:
    edge:
      hosts:
        {EDGE}:
          ansible_host: {HOSTS[EDGE]} # {PLACEHOLDER}: the host near the robots or in the cloud
    robots:
      hosts:
        {ROBOT}:
          ansible_host: {HOSTS[ROBOT]} # {PLACEHOLDER}: the robot
"""
_HEADINGS = {
    OPEN: "To fill in or to decide",
    LEFT: "No counterpart",
    CHANGED: "Done another way",
    TAKEN: "Taken over",
    SAME: "The same without a word",
}


class _Dumper(yaml.SafeDumper):
    """Sequences are indented, and texts with variables are Ansible's templates."""

    def increase_indent(self, flow: bool = False, indentless: bool = False) -> None:  # noqa: ARG002 - yaml's signature
        super().increase_indent(flow, False)

    def ignore_aliases(self, _data: Any) -> bool:
        return True


_Dumper.add_representer(
    Filled, lambda dumper, text: dumper.represent_scalar("tag:yaml.org,2002:str", text.template, style='"')
)
_Dumper.add_representer(Verbatim, lambda dumper, text: dumper.represent_scalar("!unsafe", str(text), style='"'))


def files(found: Imported, source: str, inventory: str) -> dict[str, str]:
    """Paths below the repository, with their texts. Nothing in them changes from run to run."""
    base = f"{inventory}/" if inventory else ""
    return {
        f"{base}hosts.yml": HOSTS_TEXT,
        f"{base}group_vars/all.yml": _variables(
            found.all, f"# Imported from {source}; {REPORT} has what became of each key."
        ),
        f"{base}group_vars/robots.yml": _variables(found.robots, "# What every robot runs."),
        REPORT: report(found, source, inventory),
    }


def _variables(variables: Mapping[str, Any], comment: str) -> str:
    text = yaml.dump(dict(variables), Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=120)
    return f"---\n{comment}\n{text}"


def report(found: Imported, source: str, inventory: str) -> str:
    """IMPORT.md."""
    place = inventory or "."
    lines = [
        f"# Imported from {_cell(source)}",
        "",
        f"1. {PLACEHOLDER} the addresses in `{place}/hosts.yml`: {', '.join(HOSTS)} are placeholders.",
        f"2. Look through *{_HEADINGS[OPEN]}* below.",
        "3. Then, in this directory:",
        "",
        f"       ansible-playbook -i {place} rosops.fleet.validate",
        f"       ansible-playbook -i {place} rosops.fleet.site --check --diff",
        f"       ansible-playbook -i {place} rosops.fleet.site",
        f"       ansible-playbook -i {place} rosops.fleet.update     # later, after a change of image",
    ]
    for verdict, heading in _HEADINGS.items():
        notes = _of(found.notes, verdict)
        if notes:
            lines += ["", f"## {heading}", "", "| in the Rigelfile | here |", "|---|---|"]
            lines += [f"| `{_cell(note.path)}` | {_cell(note.told)} |" for note in notes]
    return "\n".join(lines) + "\n"


def screen(found: Imported, dest: str, inventory: str) -> str:
    """What has to be known at once; the rest is counted."""
    return "\n".join(_screen(found, dest, inventory))


def _screen(found: Imported, dest: str, inventory: str) -> Iterator[str]:
    for verdict in (OPEN, LEFT):
        notes = _of(found.notes, verdict)
        if notes:
            yield _HEADINGS[verdict].upper()
        for note in notes:
            yield f"  {printable(note.path)}"
            yield textwrap.fill(printable(note.told), 110, initial_indent="    ", subsequent_indent="    ")
    counts = ", ".join(f"{len(_of(found.notes, verdict))} {verdict}" for verdict in (TAKEN, SAME, CHANGED, LEFT, OPEN))
    yield f"{counts}: {dest}/{REPORT}"
    place = f"{dest}/{inventory}" if inventory else dest
    yield f"{PLACEHOLDER} the addresses in {place}/hosts.yml, then: ansible-playbook -i {place} rosops.fleet.site"


def _of(notes: tuple[Note, ...], verdict: str) -> list[Note]:
    return [note for note in notes if note.verdict == verdict]


def _cell(text: str) -> str:
    """Text within a table of Markdown."""
    return " ".join(printable(text).split()).replace("|", "\\|").replace("`", "'")
