# SPDX-License-Identifier: GPL-3.0-or-later
"""The fleet arm: the inventory is changed, and playbooks/update.yml does the rest."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from .cluster import EDGE, ROBOT, Cluster
from .cores import CONTROL_CORES, CORES, ROBOT_CORES, kubelet_arguments
from .errors import BenchError
from .fleet_inventory import variables
from .scenario import FLEET, App, Case
from .step import Step, fleet_step
from .windows import Span

STAGES = "namespace,storage,master,apps,ready"


class FleetArm:
    """Writes group variables beside the lab's inventory, and runs the playbooks as a user does.

    `more` are variables of the robots that this arm has beside the cases' apps.
    """

    namespace = f"robot-{ROBOT}"

    def __init__(
        self, cluster: Cluster, directory: Path, changer: str, name: str = FLEET, more: Mapping[str, Any] | None = None
    ) -> None:
        self.name = name
        self._more = dict(more or {})
        self._cluster = cluster
        self._changer = changer
        self._inventory = directory / "inventory"
        self._log = directory / "fleet.log"
        self._report = directory / "fleet-report.json"
        self._apps: dict[str, App] = {}
        self.control_cpu: list[float] = []  # CPU seconds of each update's run on the control node

    def prepare(self, archives: list[str]) -> None:
        """The generated inventory: this lab's robot, and images of every version on every node."""
        groups = self._inventory / "group_vars"
        groups.mkdir(parents=True, exist_ok=True)
        cores = {ROBOT: ROBOT_CORES, EDGE: CONTROL_CORES}
        own = {host: {"k3s_config": {"kubelet-arg": kubelet_arguments(cores[host], CORES)}} for host in cores}
        hosts: dict[str, Any] = {
            "edge": {"hosts": {EDGE: own[EDGE]}},
            "robots": {"hosts": {ROBOT: own[ROBOT]}},
        }
        (self._inventory / "hosts.yml").write_text(json.dumps(hosts, indent=2), encoding="utf-8")
        images = {"images_archives": [{"path": path} for path in archives]}
        (groups / "all.yml").write_text(json.dumps(images, indent=2), encoding="utf-8")
        self._write([])

    def site(self, *words: str) -> None:
        """site.yml has to end well: without it there is nothing to measure."""
        status, _start, _end, _cpu = self._play("playbooks/site.yml", *words)
        if status != 0:
            tail = self._log.read_text(encoding="utf-8").splitlines()[-40:]
            raise BenchError("\n".join([*tail, f"site.yml ended with {status}; its log is {self._log}"]))

    def deploy(self, case: Case) -> None:
        """Its apps at their first version, up."""
        self._apps = {app.name: app for app in case.apps}
        self._write(self._apps.values())
        self.site("--tags", STAGES)

    def update(self, case: Case) -> Step:
        """One run of the playbook after the case's apps changed in the inventory."""
        changed = {app.name: app for app in case.changed()}
        self._write({**self._apps, **changed}.values())
        status, start, end, cpu = self._play(self._changer)
        self.control_cpu.append(cpu)
        step = self._judge(status, Span(start, end))
        if step.problem:
            self._write(self._apps.values())  # the next update must not try this one again
        else:
            self._apps.update(changed)
        return step

    def _judge(self, status: int, run: Span) -> Step:
        if not self._report.exists():
            return Step(run, run, None, outcome="failed", problem=f"no report, exit status {status}")
        report: Mapping[str, Any] = json.loads(self._report.read_text(encoding="utf-8"))
        return fleet_step(report, ROBOT, run)

    def _play(self, *words: str) -> tuple[int, float, float, float]:
        return self._cluster.playbook(list(words), self._inventory, self._log, self._report)

    def _write(self, apps: Iterable[App]) -> None:
        text = json.dumps({**variables(apps), **self._more}, indent=2)
        (self._inventory / "group_vars" / "robots.yml").write_text(text, encoding="utf-8")
