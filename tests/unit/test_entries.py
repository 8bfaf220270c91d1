# SPDX-License-Identifier: GPL-3.0-or-later
"""Where text of others enters: each place has one parser, on which hostile values are tried, before it is anything.

A new place, found by the few functions through which such text comes, fails here until the table names its parser.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import yaml
from ansible_collections.rosops.fleet.tests.unit.hostile import PARSERS

PLUGINS = Path(__file__).resolve().parents[2] / "plugins"
FUNCTIONS = frozenset({
    "json.loads", "json_of", "yaml.load", "yaml.safe_load", "yaml_load", "loads", "parse_qsl", "b64decode",
    "base64.b64decode", "base64.urlsafe_b64decode", "tarfile.open", "zlib.decompress", "open_url", "expat.ParserCreate",
})  # fmt: skip
METHODS = frozenset({
    "recv", "recv_into", "getresponse", "urlopen", "run_module", "_execute_module", "_low_level_execute_command", "job",
    "module",
})  # fmt: skip
OURS = "ours"


# parser -> what becomes of the text -> places
TABLE: dict[str, dict[str, str]] = yaml.safe_load(Path(__file__).with_name("entries.yml").read_text("utf-8"))


def enters(node: ast.AST) -> bool:
    """Whether text of others may come in here; of another host's variables, too, which tasks there have registered."""
    if isinstance(node, ast.Call):
        called = ast.unparse(node.func)
        return called in FUNCTIONS or (isinstance(node.func, ast.Attribute) and node.func.attr in METHODS)
    return isinstance(node, ast.Subscript) and ast.unparse(node.value).endswith(("hostvars", "['hostvars']"))


def places(node: ast.AST, file: str, function: str = "") -> Iterator[str]:
    for inner in ast.iter_child_nodes(node):
        if enters(inner):
            yield f"{file}:{function}"
        yield from places(inner, file, inner.name if isinstance(inner, ast.FunctionDef) else function)


def test_each_place_has_its_parser() -> None:
    files = {str(path.relative_to(PLUGINS).with_suffix("")): path for path in sorted(PLUGINS.rglob("*.py"))}
    found = {place for name, path in files.items() for place in places(ast.parse(path.read_text("utf-8")), name)}
    assert found == {place for entries in TABLE.values() for listed in entries.values() for place in listed.split()}


def test_each_parser_is_tried() -> None:
    assert TABLE.keys() <= {OURS, *PARSERS}


def test_a_new_place_is_found() -> None:
    for text in ("sock.recv(1)", "json.loads(said)", "host.job('x', {})", "known['hostvars'][other]['said']"):
        assert [*places(ast.parse(f"class A:\n    def f(self):\n        return {text}"), "x")] == ["x:f"]
