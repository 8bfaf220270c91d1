# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs of the collection's own playbooks on robots that work, and on others.

No controller runs there: what is applied never gets ready.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import Ref
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.master import master_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import CODE, PARTS, ground_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.addresses import NAMES
from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import CHECKOUT, Control
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import SERVICE_ADDRESS, Server
from ansible_collections.rosops.fleet.tests.unit.robots import robot

STAGES = ",".join(PARTS)
APP = {"name": "talker", "image": "x.example/talker:1", "command": ["run"], "pattern": "pubsub"}
WAVE = "Robots are updated, wave by wave"
KINDS = ("Deployment", "Service", "ConfigMap", "NetworkPolicy")


def path_of(kind: str, namespace: str, name: str) -> str:
    return Ref(kind, name, namespace).path


def runs(server: Server, name: str, image: str = "x.example/talker:0") -> None:
    """A robot that works, on an earlier version of its app or on another one."""
    named = robot({**APP, "image": image}, name=name)
    made = replace(named, master=replace(named.master, addresses=dict.fromkeys(NAMES, SERVICE_ADDRESS)))
    space = f"/api/v1/namespaces/robot-{name}"
    server.put(space, {"metadata": {}})
    for item in [*ground_objects(made, ["apps"], [], CODE), *master_objects(made), *app_objects(made)]:
        if item["kind"] in KINDS:
            item = {**item, "spec": {**item.get("spec", {}), "clusterIP": SERVICE_ADDRESS}}  # noqa: PLW2901
            server.put(path_of(item["kind"], f"robot-{name}", item["metadata"]["name"]), item)


class Run:
    def __init__(
        self,
        control: Control,
        robots: str,
        *arguments: str,
        playbook: str = "site",
        environ: Mapping[str, str] = MappingProxyType({}),
        **variables: Any,
    ) -> None:
        control.write("play.yml", f"- import_playbook: {CHECKOUT}/playbooks/{playbook}.yml\n")
        said = {"ros_apps": [APP], "ros_app_rollout_timeout": 1, "update_failure_budget": 9, **variables}
        done = control.run("--limit", robots, "-e", json.dumps(said), *arguments, **environ)
        self.status, self.output = done.returncode, done.stdout + done.stderr
        report: dict[str, Any] = json.loads((control.folder / "report.json").read_text())
        self.hosts = {one["host"]: one for one in report["hosts"]}
        self.plays = [play["name"] for play in report["plays"]]

    def outcome(self, name: str) -> tuple[str, str]:
        return self.hosts[name]["outcome"], self.hosts[name]["reason"]
