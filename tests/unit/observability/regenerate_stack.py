# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Write the golden files of the stack anew: `.venv/bin/python tests/unit/observability/regenerate_stack.py`.

Read the diff before keeping it.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import yaml

HERE = Path(__file__).resolve().parent
if __name__ == "__main__":  # pytest's conftest.py has done this already
    sys.path.insert(0, str(HERE.parents[2] / ".ansible" / "collections"))

from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import stack  # noqa: E402
from ansible_collections.rosops.fleet.tests.unit.observability.specs import full  # noqa: E402

ADMIN = {"password": "a-password", "version": "v1"}
FILES = {
    "rules": {"ros.yml": "groups: []\n"},
    "loki_rules": {},
    "dashboards": {"Fleet": {"fleet.json": "{}"}, "Own": {"My Robot.json": "{}"}},
}
ALERTS = {"route": {"receiver": "nobody", "group_by": ["alertname", "robot"]}, "receivers": [{"name": "nobody"}]}
SPECS: dict[str, dict[str, Any]] = {
    "standalone": {"remote_nodes": ["edge1"], "alertmanager_config": ALERTS},
    "robot": {"profile": "robot", "robot": "robot2", "hub_url": "http://192.0.2.10"},
    "hub": {"profile": "hub", "remote_nodes": ["edge1"], "allowed_networks": ["192.0.2.0/24"]},
    "no-shipper": {
        "log_shipper": "none",
        "remote_nodes": ["edge1", "edge2.example.org"],
        "grafana": {"service_type": "ClusterIP", "persistence": {"enabled": False}},
        "storage_class": "fast",
    },
}


def built(spec: dict[str, Any]) -> list[dict[str, Any]]:
    """All objects of a spec, the Secrets last."""
    return [
        *stack.stack_objects(full(spec), FILES, ADMIN["version"]),
        *stack.stack_secrets(full(spec), ADMIN),
    ]


def golden(name: str) -> list[dict[str, Any]]:
    """What a golden file holds: all of `standalone` and `robot`, of the others what `standalone` has not as it is."""
    objects = built(SPECS[name])
    return (
        objects
        if name in ("standalone", "robot")
        else [one for one in objects if one not in built(SPECS["standalone"])]
    )


class _Dumper(yaml.SafeDumper):
    """Without anchors and with indented lists: a golden file is read by people, and linted."""

    def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002
        return True

    def increase_indent(self, flow: bool = False, indentless: bool = False) -> None:  # noqa: ARG002
        super().increase_indent(flow, False)


def _text(dumper: yaml.SafeDumper, value: str) -> yaml.ScalarNode:
    return dumper.represent_scalar("tag:yaml.org,2002:str", value, style="|" if "\n" in value else None)


_Dumper.add_representer(str, _text)


def main() -> None:
    """Write all golden files."""
    for name in SPECS:
        text = yaml.dump(golden(name), Dumper=_Dumper, sort_keys=False, width=120)
        (HERE / "golden" / f"{name}.yml").write_text(f"---\n{text}", encoding="utf-8")


if __name__ == "__main__":
    main()
