# SPDX-License-Identifier: GPL-3.0-or-later
"""The lab and its cluster: commands of the checkout, SSH to the hosts, the Kubernetes API. All I/O of both arms."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import yaml
from kubernetes import client, config
from lab_environment import CHECKOUT, LAB, environment, inventory

from .cores import CONTROL_CORES, on_cores
from .errors import BenchError

EDGE, ROBOT = "edge1", "robot1"
HOSTS = f"{EDGE}:edge,{ROBOT}:robots"
KUBECONFIG = "/etc/rancher/k3s/k3s.yaml"
STORAGE = "/var/lib/rancher/k3s/storage"
# The control node of a fleet is no robot. Here it shares the robot's cores, so what it does itself comes after the
# robot's work; what it starts on the hosts does not.
NICE = 10
NICELY = ("nice", "-n", str(NICE))


class Cluster:
    """One lab: its hosts, and the cluster that site.yml makes of them. Playbooks are the checkout's."""

    def __init__(self, lab: str, sockets: Path, checkout: Path = CHECKOUT) -> None:
        self.lab = lab
        self.checkout = checkout
        self.environment = environment(lab)
        self.inventory = inventory(lab, checkout, sockets / "inventory")
        self._sockets = sockets
        self._hosts: dict[str, Mapping[str, Any]] = {}
        self._apps: Any = None
        self._core: Any = None

    # --- the lab -----------------------------------------------------------------------------------------------------

    def lab_command(self, *words: str) -> None:
        """A command of the lab."""
        done = subprocess.run([str(LAB), *words], cwd=CHECKOUT, env=self.environment, check=False)  # noqa: S603 - our own
        if done.returncode != 0:
            raise BenchError(f"tests/lab/lab {' '.join(words)} ended with {done.returncode}")

    def playbook(self, words: list[str], beside: Path, log: Path, report: Path) -> tuple[int, float, float, float]:
        """ansible-playbook, with one inventory beside the lab's.

        Returns exit status, start and end on the wall clock, CPU seconds that it took here.
        """
        report.unlink(missing_ok=True)
        command = [
            *on_cores(CONTROL_CORES),
            *NICELY,
            "ansible-playbook",
            *(word for path in (self.inventory, beside) for word in ("-i", str(path))),
            *words,
        ]
        env = {**environment(self.lab, self.checkout), "ROSOPS_FLEET_REPORT": str(report)}
        before = os.times()
        started = time.time()
        with log.open("a", encoding="utf-8") as file:
            done = subprocess.run(command, cwd=self.checkout, env=env, stdout=file, stderr=file, check=False)  # noqa: S603
        ended = time.time()
        after = os.times()
        cpu = after.children_user + after.children_system - before.children_user - before.children_system
        return done.returncode, started, ended, cpu

    def connect(self) -> None:
        """Learn the hosts from the inventory, and the way to the cluster's API from its server, once there is one."""
        command = ["ansible-inventory", "-i", "inventories/lab", "--list"]
        done = subprocess.run(  # noqa: S603 - our own
            command, cwd=CHECKOUT, env=self.environment, stdout=subprocess.PIPE, text=True, check=False
        )
        if done.returncode != 0:
            raise BenchError(f"ansible-inventory ended with {done.returncode}")
        self._hosts = json.loads(done.stdout)["_meta"]["hostvars"]
        access = yaml.safe_load(self.ssh(EDGE, f"cat {KUBECONFIG}", check=False))
        if access:
            access["clusters"][0]["cluster"]["server"] = f"https://{self._hosts[EDGE]['ansible_host']}:6443"
            api = config.new_client_from_config_dict(access)
            self._apps, self._core = client.AppsV1Api(api), client.CoreV1Api(api)

    @property
    def variables(self) -> Mapping[str, Any]:
        """The lab's inventory variables."""
        return self._hosts[ROBOT]

    # --- hosts -------------------------------------------------------------------------------------------------------

    def ssh_words(self, host: str, command: str) -> list[str]:
        """A shell command on a host, over one connection that stays open."""
        known = self._hosts[host]
        master = ["-o", "ControlMaster=auto", "-o", "ControlPersist=60s", "-o", f"ControlPath={self._sockets}/%C"]
        key = str(known["ansible_ssh_private_key_file"]).replace("%%", "%")
        options = [*shlex.split(str(known["ansible_ssh_common_args"])), "-o", "LogLevel=ERROR", "-o", "BatchMode=yes"]
        address = f"{known['ansible_user']}@{known['ansible_host']}"
        return ["ssh", "-F", "none", *master, *options, "-i", key, address, command]

    def ssh(self, host: str, command: str, stdin: bytes = b"", check: bool = True) -> bytes:
        """Run it there; its standard output."""
        done = subprocess.run(  # noqa: S603 - our own
            self.ssh_words(host, command), input=stdin, capture_output=True, check=False, timeout=300
        )
        if check and done.returncode != 0:
            raise BenchError(f"on {host}: {command}: {done.stderr.decode(errors='replace').strip()}")
        return done.stdout

    def kubectl(self, words: str, stdin: bytes = b"", check: bool = True) -> str:
        """The cluster's own kubectl."""
        return self.ssh(EDGE, f"{' '.join(NICELY)} k3s kubectl {words}", stdin, check).decode(errors="replace")

    # --- the API -----------------------------------------------------------------------------------------------------

    def deployments(self, namespace: str) -> list[dict[str, Any]]:
        """The namespace's Deployments as the API has them."""
        return self._plain(self._apps.list_namespaced_deployment(namespace))

    def pods(self, namespace: str | None = None) -> list[dict[str, Any]]:
        """Pods of a namespace, or of all."""
        listed = self._core.list_namespaced_pod(namespace) if namespace else self._core.list_pod_for_all_namespaces()
        return self._plain(listed)

    def _plain(self, listed: Any) -> list[dict[str, Any]]:
        found: list[dict[str, Any]] = client.ApiClient().sanitize_for_serialization(listed)["items"]
        return found


def wait_for(what: str, condition: Callable[[], str], seconds: float, interval: float = 0.2) -> float:
    """Wait until the condition has nothing to complain of; returns the moment when that was so."""
    deadline = time.monotonic() + seconds
    while True:
        complaint = condition()
        if not complaint:
            return time.time()
        if time.monotonic() > deadline:
            raise BenchError(f"{what}: not within {seconds:g} s: {complaint}")
        time.sleep(interval)
