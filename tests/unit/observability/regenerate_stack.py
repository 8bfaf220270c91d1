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
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.files import Files  # noqa: E402
from ansible_collections.rosops.fleet.tests.unit.golden.regenerate import named, write  # noqa: E402
from ansible_collections.rosops.fleet.tests.unit.observability.specs import full  # noqa: E402

OF_TEMPLATES, TEMPLATE = {"loki.yml", "otelcol.yml", "datasources.yml", "dashboards.yml"}, "as its template has it"
RULES = {"relabel_configs", "metric_relabel_configs"}
ADMIN = {"password": "a-password", "version": "v1"}
FILES = Files(
    rules={"ros.yml": "groups: []\n"},
    dashboards={"Fleet": {"fleet.json": "{}"}, "Own": {"My Robot.json": "{}"}},
)
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


def golden(name: str) -> list[dict[str, Any] | str]:
    """What a golden file holds: all of `standalone`; of the others what is new, and the kinds and names of the rest."""
    there = {named(one) for one in built(SPECS["standalone"])} if name != "standalone" else set()
    return [named(one) if named(one) in there else shown(one) for one in built(SPECS[name])]


def shown(item: dict[str, Any]) -> dict[str, Any]:
    """The object with what its YAML files say in place of their text, which follows from that (`yaml_text`).

    Of a file that is made of a template that says as much; its text is in the hash that the pod's template has. A rule
    of relabelling is a line.
    """
    if item["kind"] != "ConfigMap":
        return item
    data = {
        name: TEMPLATE if name in OF_TEMPLATES else yaml.safe_load(text) if name.endswith(".yml") else text
        for name, text in item["data"].items()
    }
    for job in data.get("prometheus.yml", {}).get("scrape_configs", ()):
        for rules in RULES & job.keys():
            job[rules] = [" ".join(f"{key}={_words(said)}" for key, said in rule.items()) for rule in job[rules]]
    return {**item, "data": data}


def _words(said: Any) -> str:
    return ",".join(said) if isinstance(said, list) else str(said)


def main() -> None:
    """Write all golden files."""
    for name in SPECS:
        write(HERE / "golden" / f"{name}.yml", golden(name))


if __name__ == "__main__":
    main()
