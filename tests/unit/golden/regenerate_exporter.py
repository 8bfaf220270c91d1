# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Write the exporter's golden files anew: `.venv/bin/python tests/unit/golden/regenerate_exporter.py`.

Read the diff before keeping it.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
FILES = HERE / "exporter"
if __name__ == "__main__":  # pytest's conftest.py has done this already
    sys.path.insert(0, str(HERE.parents[2] / ".ansible" / "collections"))

from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.exporter import (  # noqa: E402 - after the path
    ExporterOptions,
    exporter_objects,
)
from ansible_collections.rosops.fleet.tests.unit.golden.regenerate import from_alike, write  # noqa: E402
from ansible_collections.rosops.fleet.tests.unit.robots import robot  # noqa: E402

CODE = {"run.py": "# stands for the code\n"}
CASES: dict[str, tuple[dict[str, Any], ExporterOptions]] = {
    "robot": ({"name": "r1", "master": {"image": "example.org/ros:1"}}, ExporterOptions()),
    "everything": (
        {
            "name": "r-1",
            "master": {"mode": "external", "uri": "http://192.0.2.1:11311"},
            "volumes": [{"name": "maps", "size": "2Gi"}, {"name": "bags", "size": "500M"}],
            "pull_secrets": [{"name": "registry", "user": "x"}],
        },
        ExporterOptions(interval=5, timeout=1.5, statistics=True, claims_path="/var/lib/rancher/k3s/storage"),
    ),
}


def built(name: str) -> list[dict[str, Any]]:
    given, options = CASES[name]
    return exporter_objects(robot(**given), CODE, options)


def golden(name: str) -> list[dict[str, Any]]:
    """What the golden file holds: the case `robot` as a whole, of another one what is not as there."""
    base = built("robot")
    return base if name == "robot" else [from_alike(item, base) for item in built(name)]


def main() -> None:
    FILES.mkdir(exist_ok=True)
    for name in CASES:
        write(FILES / f"{name}.yml", golden(name))


if __name__ == "__main__":
    main()
