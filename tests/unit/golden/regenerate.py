# SPDX-License-Identifier: GPL-3.0-or-later
"""Write the golden files anew: `.venv/bin/python tests/unit/golden/regenerate.py`. Read the diff before keeping it.

A case is `cases/<name>.yml` with `robot` and `variables`; its golden file is `<name>.yml` beside this script:
`{objects: .., conditions: {..}, images: {local: [..], remote: [..]}}`.

The case `minimal` is there as a whole. The others have what is not as there would be of their robot: `without` names
the objects that there are not, and of another one there is, by its path, each value that differs from the one of its
kind that is most like it (`like`), once their names are the same; null where it has none. Entries of a list are found
by their names. The hashes of a Deployment, and of its pods' template, are those of the whole. Of the keepers' policy
what is made for the API server alone, in CEL, stands as its hash, too: nobody reads it, and any change shows.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Iterable, Mapping
from itertools import chain
from pathlib import Path
from typing import Any

import yaml

CODE = {"run.py": "# stands for the code\n", "code.json.gz": b"stands for more"}
HERE = Path(__file__).resolve().parent
BASE = "minimal"
ROOM = 120  # characters, beside the indentation and the path
Object = dict[str, Any]
if __name__ == "__main__":  # pytest's conftest.py has done this already
    sys.path.insert(0, str(HERE.parents[2] / ".ansible" / "collections"))

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot  # noqa: E402
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects import parts  # noqa: E402


def built(case: Mapping[str, Any]) -> dict[str, Any]:
    """All that is made of a case."""
    robot, secrets = Robot.from_variables(case["variables"], case["robot"]), "robot_namespace_pull_secrets"
    return {
        "objects": [
            *parts.ground_objects(robot, parts.PARTS, case["variables"].get(secrets, []), CODE),
            *parts.workload_objects(robot, parts.PARTS),
        ],
        "conditions": parts.graph_conditions(robot),
        "images": {placement: parts.images(robot, placement) for placement in ("local", "remote")},
    }


def cases() -> dict[str, dict[str, Any]]:
    """The cases by name."""
    return {path.stem: yaml.safe_load(path.read_text("utf-8")) for path in sorted((HERE / "cases").glob("*.yml"))}


def golden(name: str) -> dict[str, Any]:
    """What the case's golden file holds."""
    every = cases()
    made = readable(built(every[name]))
    return made if name == BASE else beside(made, readable(built({**every[BASE], "robot": every[name]["robot"]})))


def readable(made: dict[str, Any]) -> dict[str, Any]:
    """With the hash of what is in CEL in its place."""
    for policy in (item["spec"] for item in made["objects"] if item["kind"] == "ValidatingAdmissionPolicy"):
        for part in ("variables", "validations"):
            policy[part] = hashlib.sha256(json.dumps(policy[part]).encode()).hexdigest()
    return made


def beside(made: dict[str, Any], base: dict[str, Any]) -> dict[str, Any]:
    """What is not as in the base."""
    there, shown = {placed(item) for item in made["objects"]}, dict[str, Object]()
    known: list[Object] = list(base["objects"])
    for item in made["objects"]:
        if item not in base["objects"]:
            shown[placed(item)] = from_alike(item, known)
            known.append(item)
    return {
        "without": [placed(item) for item in base["objects"] if placed(item) not in there],
        "objects": shown,
        "conditions": differing(made["conditions"], base["conditions"]),
        "images": made["images"],
    }


def from_alike(item: Object, objects: Iterable[Object]) -> Object:
    """What is not as in that one of its kind that is most like it; `like` names one of another name."""
    name = item["metadata"]["name"]
    alike = [one for one in objects if one["kind"] == item["kind"]]
    found = {one["metadata"]["name"]: differing(item, _renamed(one, name)) for one in alike} or {name: item}
    like = min(found, key=lambda one: len(json.dumps(found[one])))
    return found[like] if like == name else {"like": like, **found[like]}


def differing(own: Any, base: Any, path: str = "") -> Object:
    """By path, the values that are not as in the base; null for one that is not there."""
    inner, other = _by_key(own), _by_key(base)
    if not (isinstance(inner, dict) and isinstance(other, dict)):
        return {} if own == base else {path: own}
    found: Object = {}
    for key in [*inner, *(key for key in other if key not in inner)]:
        found |= differing(inner.get(key), other.get(key), f"{path}.{key}" if path else key)
    return found


def _by_key(value: Any) -> Any:
    """The entries of a list that all have names, by these; settings, which are JSON, as what they say."""
    if isinstance(value, list) and value and all(isinstance(one, dict) and "name" in one for one in value):
        return {one["name"]: one for one in value}
    return json.loads(value) if isinstance(value, str) and value.startswith("{") else value


def _renamed(item: Object, name: str) -> Object:
    renamed: Object = json.loads(json.dumps(item).replace(item["metadata"]["name"], name))
    return renamed


def placed(item: Object) -> str:
    """Kind, namespace and name."""
    metadata = item["metadata"]
    return f"{item['kind']} {metadata['namespace'] + '/' if 'namespace' in metadata else ''}{metadata['name']}"


def named(item: Object) -> str:
    """An object that another golden file has."""
    return f"{item['kind']} {item['metadata']['name']}"


class _Dumper(yaml.SafeDumper):
    """Without anchors, with indented lists, short mappings and lists in one line: people read golden files.

    The lint reads them, too.
    """

    def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002
        return True

    def increase_indent(self, flow: bool = False, indentless: bool = False) -> None:  # noqa: ARG002
        super().increase_indent(flow, False)

    def represent_data(self, data: Any) -> yaml.Node:
        node = super().represent_data(data)
        if isinstance(node, yaml.CollectionNode):
            node.flow_style = _words(node) <= ROOM
        return node


def _words(node: yaml.Node) -> int:
    """The room that it takes in a line; a text of several lines has none there."""
    if isinstance(node.value, str):
        return ROOM + 1 if "\n" in node.value else len(node.value) + 4
    inner = chain.from_iterable(node.value) if isinstance(node, yaml.MappingNode) else node.value
    return sum(map(_words, inner))


def _text(dumper: yaml.SafeDumper, value: str) -> yaml.ScalarNode:
    return dumper.represent_scalar("tag:yaml.org,2002:str", value, style="|" if "\n" in value else None)


_Dumper.add_representer(str, _text)


def write(path: Path, value: Any) -> None:
    """One golden file. No mapping or list in one line is broken: the lint would have it indented."""
    text = yaml.dump(value, Dumper=_Dumper, sort_keys=False, width=240)
    path.write_text(f"---\n{text}", encoding="utf-8")


def main() -> None:
    """Write all golden files."""
    for name in cases():
        write(HERE / f"{name}.yml", golden(name))


if __name__ == "__main__":
    main()
