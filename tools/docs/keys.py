# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes the keys of apps and volumes, which plugins/plugin_utils/_model/app.py has, into their roles' argument specs.

python tools/docs/keys.py
"""

from __future__ import annotations

import ast
import inspect
import itertools
import re
import sys
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, Union

import yaml

CHECKOUT = Path(__file__).resolve().parents[2]
if __name__ == "__main__":  # pytest's conftest.py has done this already
    sys.path.insert(0, str(CHECKOUT / ".ansible" / "collections"))

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.app import App, Volume  # noqa: E402
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.keys import Kind, keys  # noqa: E402

TABLES = {"ros_app": App, "storage": Volume}
PLACE = re.compile(r"( *)(# BEGIN keys: written by tools/docs/keys.py\n).*?(?= *# END keys)", re.DOTALL)
WIDTH = 140
TYPES = {str: "str", int: "int", float: "float", bool: "bool"}


def options(of: type) -> dict[str, dict[str, Any]]:
    """The keys of a type as options of an argument spec."""
    said, found = words(of), {}
    for name, key in keys(of).items():
        found[name] = _typed(key.kind)
        inner = found[name].pop("options", None)
        if key.required:
            found[name]["required"] = True
        elif isinstance(key.default, (str, int, float)) and key.default != "":
            found[name]["default"] = key.default
        paragraphs = [" ".join(part.split()) for part in said[name].split("\n\n")]
        found[name]["description"] = paragraphs if len(paragraphs) > 1 else paragraphs[0]
        if inner:
            found[name]["options"] = inner
    return found


def words(of: type) -> dict[str, str]:
    """The text below each field of a type."""
    [made] = ast.parse(textwrap.dedent(inspect.getsource(of))).body
    body = made.body if isinstance(made, ast.ClassDef) else []
    return {
        ast.unparse(field.target): str(text.value.value)
        for field, text in itertools.pairwise(body)
        if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant)
    }


def _typed(kind: Kind) -> dict[str, Any]:
    kind = kind.said
    if kind.type is Union:  # of scalars the first
        first, *others = map(_typed, kind.inner)
        return first if {one["type"] for one in others} <= {"str", "int", "float", "bool"} else {"type": "raw"}
    if kind.type is Literal:
        return {"type": "str", "choices": list(kind.inner)}
    if kind.type is tuple:
        item = _typed(kind.inner[0])
        return {"type": "list", "elements": item.pop("type"), **item}
    if isinstance(kind.inner, Mapping) and words(kind.type):
        return {"type": "dict", "options": options(kind.type)}
    return {"type": TYPES.get(kind.type, "dict")}


class _Dumper(yaml.SafeDumper):
    """A row for each key, but for those with keys of their own or more than one paragraph; lists are indented."""

    def represent_data(self, data: Any) -> yaml.Node:
        node = super().represent_data(data)
        if isinstance(node, yaml.MappingNode):
            node.flow_style = isinstance(data.get("description"), str) and "options" not in data
        elif isinstance(node, yaml.SequenceNode):
            node.flow_style = max(map(len, data)) < WIDTH / 4
        return node

    def increase_indent(self, flow: bool = False, indentless: bool = False) -> None:  # noqa: ARG002
        super().increase_indent(flow, False)


def rendered(spec: str, of: type) -> str:
    """An argument spec's text with the keys of a type where they belong."""

    def written(place: re.Match[str]) -> str:
        text = yaml.dump(options(of), Dumper=_Dumper, sort_keys=False, width=WIDTH - len(place[1]), allow_unicode=True)
        return place[1] + place[2] + textwrap.indent(text, place[1])

    return PLACE.sub(written, spec)


if __name__ == "__main__":
    for role, table in TABLES.items():
        path = CHECKOUT / "roles" / role / "meta" / "argument_specs.yml"
        path.write_text(rendered(path.read_text("utf-8"), table), encoding="utf-8")
