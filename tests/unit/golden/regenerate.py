# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Write the golden files anew: `.venv/bin/python tests/unit/golden/regenerate.py`. Read the diff before keeping it.

A case is `cases/<name>.yml` with `robot` and `variables`; its golden file is `<name>.yml` beside this script:
`{objects: [..], conditions: {..}, images: {local: [..], remote: [..]}}`.

The case `minimal` is there as a whole. The others have what is not as there: `same` names the objects that are, and of
another one there is what differs from one of its kind above it or in `minimal` (null: it has no such key; of a list
that has all names of the other, the entries that differ). The hashes of a Deployment, and of its pods' template, are
those of the whole.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import yaml

CODE = {"run.py": "# stands for the code\n"}
HERE = Path(__file__).resolve().parent
BASE = "minimal"
ROOM = 90  # characters, beside the indentation
Object = dict[str, Any]
if __name__ == "__main__":  # pytest's conftest.py has done this already
    sys.path.insert(0, str(HERE.parents[2] / ".ansible" / "collections"))

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot  # noqa: E402
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects  # noqa: E402
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.code_maps import code_maps  # noqa: E402
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.conditions import graph_conditions  # noqa: E402
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.files import file_maps  # noqa: E402
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.images import images  # noqa: E402
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.master import master_objects  # noqa: E402
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.namespace import (  # noqa: E402
    namespace_objects,
    pull_secret_objects,
    storage_objects,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.ports import port_services  # noqa: E402


def built(case: dict[str, Any]) -> dict[str, Any]:
    """All that the workload functions make of a case."""
    robot = Robot.from_variables(case["variables"], case["robot"])
    return {
        "objects": [
            *namespace_objects(robot),
            *pull_secret_objects(robot, case["variables"].get("robot_namespace_pull_secrets", [])),
            *storage_objects(robot),
            *master_objects(robot),
            *file_maps(robot),
            *port_services(robot),
            *code_maps(robot, CODE),
            *app_objects(robot),
        ],
        "conditions": graph_conditions(robot),
        "images": {placement: images(robot, placement) for placement in ("local", "remote")},
    }


def cases() -> dict[str, dict[str, Any]]:
    """The cases by name."""
    return {path.stem: yaml.safe_load(path.read_text("utf-8")) for path in sorted((HERE / "cases").glob("*.yml"))}


def golden(name: str) -> dict[str, Any]:
    """What the case's golden file holds."""
    every = cases()
    made = built(every[name])
    return made if name == BASE else beside(made, built(every[BASE]))


def beside(made: dict[str, Any], base: dict[str, Any]) -> dict[str, Any]:
    """What is not as in the base."""
    same = [named(item) for item in made["objects"] if item in base["objects"]]
    others = [item for item in made["objects"] if item not in base["objects"]]
    shown = [from_alike(item, [*base["objects"], *others[:place]]) for place, item in enumerate(others)]
    conditions = differing(made["conditions"], base["conditions"])
    return {"same": same, "objects": shown, "conditions": conditions, "images": made["images"]}


def from_alike(item: Object, objects: Iterable[Object]) -> Object:
    """What is not as in that one of its kind that is most like it; `like` names one of another name."""
    found = [(one["metadata"]["name"], differing(item, one)) for one in objects if one["kind"] == item["kind"]]
    like, rest = min(found, key=lambda one: len(json.dumps(one[1])), default=("", item))
    return rest if like in ("", item["metadata"]["name"]) else {"like": like, **rest}


def differing(item: Object, base: Object) -> Object:
    """What of a mapping is not as in the base, with its kind and name; null for a key that it has not."""
    found = {
        key: value if key in ("kind", "name") else _differing(value, base.get(key))
        for key, value in item.items()
        if value != base.get(key) or key in ("kind", "name")
    }
    return {**found, **{key: None for key in base if key not in item}}


def _differing(value: Any, base: Any) -> Any:
    """Of a list that has all names of the base's, the entries that are not as there."""
    if isinstance(value, dict) and isinstance(base, dict):
        return differing(value, base)
    own, there = _by_name(value), _by_name(base)
    if not own or not there or there.keys() - own.keys():
        return value
    return [differing(one, there.get(name, {})) for name, one in own.items() if one != there.get(name)]


def _by_name(items: Any) -> dict[str, Object]:
    """The entries of a list of mappings that all have a name; nothing of another one."""
    named = isinstance(items, list) and all(isinstance(one, dict) and "name" in one for one in items)
    return {one["name"]: one for one in items} if named else {}


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

    def represent_sequence(self, *given: Any, **more: Any) -> yaml.SequenceNode:
        node = super().represent_sequence(*given, **more)
        node.flow_style = bool(node.flow_style) and _words(node.value) <= ROOM
        return node

    def represent_mapping(self, *given: Any, **more: Any) -> yaml.MappingNode:
        node = super().represent_mapping(*given, **more)
        node.flow_style = bool(node.flow_style) and sum(map(_words, node.value)) <= ROOM
        return node


def _words(leaves: Iterable[yaml.Node]) -> int:
    """The room that they take in a line."""
    return sum(len(leaf.value) + 4 for leaf in leaves)


def _text(dumper: yaml.SafeDumper, value: str) -> yaml.ScalarNode:
    return dumper.represent_scalar("tag:yaml.org,2002:str", value, style="|" if "\n" in value else None)


_Dumper.add_representer(str, _text)


def write(path: Path, value: Any) -> None:
    """One golden file."""
    text = yaml.dump(value, Dumper=_Dumper, sort_keys=False, width=120, default_flow_style=None)
    path.write_text(f"---\n{text}", encoding="utf-8")


def main() -> None:
    """Write all golden files."""
    for name in cases():
        write(HERE / f"{name}.yml", golden(name))


if __name__ == "__main__":
    main()
