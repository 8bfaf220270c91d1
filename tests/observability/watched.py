# SPDX-License-Identifier: GPL-3.0-or-later
"""The scenario's lab: a hub at the edge with one robot of its cluster, and a robot that stands alone."""

from __future__ import annotations

import json
import shlex
import time
from pathlib import Path
from typing import Any

import gaps
import memory
from cluster import Hosts, there
from kubernetes import client, config
from runs import Playbooks, Run, wait_until
from watchers import Loki, Prometheus

EDGE, MEMBER, ALONE = "edge1", "robot1", "robot2"
ROBOTS = [MEMBER, ALONE]
NAMESPACE = "observability"
METRICS_PORT, LOGS_PORT = 30090, 30100  # the hub's
INTERVAL = 10.0  # of scrapes
STREAM = {"robot", "namespace", "app", "pod", "placement"}  # the labels of an app's lines, and of its series
RECORD = "robot-updates"
GRAPH = """
import json, sys, xmlrpc.client
code, _text, state = xmlrpc.client.ServerProxy(sys.argv[1]).getSystemState("/rosops_test")
print(json.dumps(dict(zip(("publishers", "subscribers", "services"), map(dict, state)))))
"""


class Watched:
    """The fleet, and those who watch it."""

    def __init__(self, lab: str, inventory: Path, output: Path) -> None:
        self.hosts = Hosts(lab)
        self.playbooks = Playbooks(inventory, output)
        self._directory = Path(self.hosts.variables["lab_dir"]) / "kube"
        hub = self.hosts.address(EDGE)
        self.prometheus = Prometheus(f"http://{hub}:{METRICS_PORT}")
        self.loki = Loki(f"http://{hub}:{LOGS_PORT}")
        self.figures: list[str] = []

    def _api(self, host: str) -> Any:
        """The API of the cluster that a host belongs to."""
        name = ALONE if host == ALONE else "edge"
        return config.new_client_from_config(str(self._directory / f"{name}.yaml"))

    def core(self, host: str) -> Any:
        return client.CoreV1Api(self._api(host))

    def apps(self, host: str) -> Any:
        return client.AppsV1Api(self._api(host))

    def say(self, *lines: str) -> None:
        """Figures, shown at the end of the tests."""
        self.figures.extend(lines)

    # --- what is there ----------------------------------------------------------------------------------------------

    def pods(self, host: str, namespace: str = "", app: str = "") -> list[Any]:
        """Pods of a host's cluster that are not on their way out."""
        selector = {"label_selector": f"rosops.fleet/app={app}"} if app else {}
        if namespace:
            selector["field_selector"] = f"metadata.namespace={namespace}"
        found = self.core(host).list_pod_for_all_namespaces(**selector)
        return [pod for pod in found.items if pod.metadata.deletion_timestamp is None]

    def memory(self, host: str) -> list[memory.Held]:
        """What the pods on one host hold."""
        text = self.hosts.ssh(host, f"python3 -c {shlex.quote(memory.LOOK)}")
        return memory.parse(text, self.pods(host))

    def graph(self, robot: str) -> dict[str, dict[str, list[str]]]:
        """Who publishes, subscribes and serves, by the master's word."""
        service = self.core(robot).read_namespaced_service("ros-master", f"robot-{robot}")
        uri = f"http://{service.spec.cluster_ip}:11311"
        answer = self.hosts.ssh(robot, f"python3 -c {shlex.quote(GRAPH)} {uri}")
        return dict(json.loads(answer))

    # --- what is done to it -----------------------------------------------------------------------------------------

    def run(self, playbook: str, *arguments: str, **variables: Any) -> Run:
        return self.playbooks.run(playbook, variables, *arguments)

    def scale(self, robot: str, deployment: str, replicas: int) -> None:
        self.apps(robot).patch_namespaced_deployment_scale(
            deployment, f"robot-{robot}", {"spec": {"replicas": replicas}}
        )

    def record(self, robot: str) -> str:
        """What the robot's record of updates holds; empty without one."""
        found = there(lambda: self.core(robot).read_namespaced_config_map(RECORD, f"robot-{robot}"))
        return str(((found and found.data) or {}).get("updates.json", ""))

    def write_record(self, robot: str, text: str) -> None:
        """In place of what it holds; without text it goes."""
        core, namespace = self.core(robot), f"robot-{robot}"
        if not text:
            core.delete_namespaced_config_map(RECORD, namespace)
            return
        body = {"metadata": {"name": RECORD}, "data": {"updates.json": text}}
        if there(lambda: core.patch_namespaced_config_map(RECORD, namespace, body)) is None:
            core.create_namespaced_config_map(namespace, body)

    def counted(self, robot: str, since: float) -> dict[str, gaps.Numbers]:
        """What came of the counting app's lines, by its runs."""
        return gaps.numbers(self.loki.lines(f'{{robot="{robot}",app="counter"}}', since, time.time()))

    # --- alerts -----------------------------------------------------------------------------------------------------

    def wait_alert(self, alert: str, fires: bool, seconds: float, **labels: str) -> float:
        """Until it fires, or does not any more; how long that took."""
        began, what = time.monotonic(), f"{alert} firing" if fires else f"the end of {alert}"
        wait_until(
            lambda: self.prometheus.firing(alert, **labels), lambda found: bool(found) is fires, seconds, what, 1
        )
        return time.monotonic() - began
