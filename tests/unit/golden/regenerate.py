# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Write the golden files anew: `.venv/bin/python tests/unit/golden/regenerate.py`. Read the diff before keeping it.

A case is `cases/<name>.yml` with `robot` and `variables`; its golden file is `<name>.yml` beside this script:
`{objects: [..], conditions: {..}, images: {local: [..], remote: [..]}}`.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import yaml

CODE = {"run.py": "# stands for the code\n"}
HERE = Path(__file__).resolve().parent
if __name__ == "__main__":  # pytest's conftest.py has done this already
    sys.path.insert(0, str(HERE.parents[2] / ".ansible" / "collections"))

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot  # noqa: E402
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects  # noqa: E402
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
            *app_objects(robot, CODE),
        ],
        "conditions": graph_conditions(robot),
        "images": {placement: images(robot, placement) for placement in ("local", "remote")},
    }


def cases() -> dict[str, dict[str, Any]]:
    """The cases by name."""
    return {path.stem: yaml.safe_load(path.read_text("utf-8")) for path in sorted((HERE / "cases").glob("*.yml"))}


class _Dumper(yaml.SafeDumper):
    """Without anchors and with indented lists: a golden file is read by people, and linted."""

    def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002
        return True

    def increase_indent(self, flow: bool = False, indentless: bool = False) -> None:  # noqa: ARG002
        super().increase_indent(flow, False)


def write(path: Path, value: Any) -> None:
    """One golden file."""
    path.write_text(f"---\n{yaml.dump(value, Dumper=_Dumper, sort_keys=False, width=120)}", encoding="utf-8")


def main() -> None:
    """Write all golden files."""
    for name, case in cases().items():
        write(HERE / f"{name}.yml", built(case))


if __name__ == "__main__":
    main()
