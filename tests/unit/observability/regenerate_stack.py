# SPDX-License-Identifier: GPL-3.0-or-later
"""Write the golden files of the stack anew: `.venv/bin/python tests/unit/observability/regenerate_stack.py`.

Read the diff before keeping it.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
if __name__ == "__main__":  # pytest's conftest.py has done this already
    sys.path.insert(0, str(HERE.parents[2] / ".ansible" / "collections"))

from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import stack  # noqa: E402
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.files import Files  # noqa: E402
from ansible_collections.rosops.fleet.tests.unit.golden.regenerate import named, write  # noqa: E402
from ansible_collections.rosops.fleet.tests.unit.observability.specs import full  # noqa: E402

TEMPLATE = "as its template has it"
WHOLE = "alertmanager"  # the workload that is shown with its pod, for what all pods have in common
HASHES = ("rosops.fleet/spec-hash", "rosops.fleet/config-hash")
OF_TEMPLATES = {"prometheus.yml", "loki.yml", "otelcol.yml", "datasources.yml", "dashboards.yml"}
ADMIN = {"password": "a-password", "version": "v1"}
FILES = Files(
    rules={"ros.yml": "groups: []\n"}, dashboards={"Fleet": {"fleet.json": "{}"}, "Own": {"my-robot.json": "{}"}}
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
    return [*stack.stack_objects(full(spec), FILES, ADMIN["version"]), *stack.stack_secrets(full(spec), ADMIN)]


def golden(name: str) -> list[dict[str, Any] | str]:
    """What a golden file holds: all of `standalone`; of the others what is new, and the kinds and names of the rest."""
    there = {named(one) for one in built(SPECS["standalone"])} if name != "standalone" else set()
    return [named(one) if named(one) in there else shown(one) for one in built(SPECS[name])]


def shown(item: dict[str, Any]) -> dict[str, Any]:
    """The object without what is said elsewhere: labels that are those of a part, by its name, what templates say, and
    what all workloads have in common.

    That is in the hashes of the workload and of its configuration: an update restarts who has another one.
    """
    body: dict[str, Any] = json.loads(json.dumps(item))
    api, kind, metadata = (body.pop(key) for key in ("apiVersion", "kind", "metadata"))
    name = metadata["labels"].get("rosops.fleet/app")
    part = {"app.kubernetes.io/name": name, "rosops.fleet/app": name, "app.kubernetes.io/managed-by": "rosops.fleet"}
    template = body.get("spec", {}).get("template", {"metadata": {}})
    for one in (metadata, template["metadata"]):
        if part.items() <= one.get("labels", {}).items():
            rest = [f"{key}={value}" for key, value in one["labels"].items() if key not in part]
            one["labels"] = ", ".join([f"of {name}", *rest])
    if kind in ("Deployment", "DaemonSet") and name != WHOLE:
        notes = {**metadata.pop("annotations"), **template["metadata"]["annotations"]}
        strategy = {key: value for key, value in body["spec"].items() if key.lower().endswith("strategy")}
        body = {"hashes": " ".join(notes[key][:12] for key in HASHES), **strategy}
    if kind == "ConfigMap":
        body["data"] = {file: TEMPLATE if file in OF_TEMPLATES else text for file, text in item["data"].items()}
    place = "/".join(filter(None, (metadata.pop("namespace", ""), metadata.pop("name"))))
    labels = metadata.pop("labels")
    head = f"{api} {kind} {place}" + (f", {labels}" if isinstance(labels, str) else "")
    return {head: {**({} if isinstance(labels, str) else {"labels": labels}), **metadata, **body}}


def main() -> None:
    """Write all golden files."""
    for name in SPECS:
        write(HERE / "golden" / f"{name}.yml", golden(name))


if __name__ == "__main__":
    main()
