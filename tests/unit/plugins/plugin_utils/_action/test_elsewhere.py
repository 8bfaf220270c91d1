# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Access over SSH as a run gets it: ansible-playbook itself, a program in the place of ssh, an API on loopback."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.identity import Identity
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server

CHECKOUT = Path(__file__).resolve().parents[5]
IDENTITY = "/api/v1/namespaces/kube-system/configmaps/rosops-fleet"
EDGES = ("192.0.2.1", "192.0.2.2", "192.0.2.3")
# Who is asked is written down. Edge 1 is off; the file of the others is one of the test.
SSH = """#!/bin/sh
for last; do :; done
case "$*" in *ControlMaster*-O*|*' -O '*) exit 0;; esac
for word; do case "$word" in 192.0.2.*) host=$word;; esac; done
echo "$host" >> {folder}/asked
[ "$host" = 192.0.2.1 ] && {{ echo "ssh: connect to host $host: No route to host" >&2; exit 255; }}
exec /bin/sh -c "$(printf %s "$last" | sed "s,/etc/rancher/k3s/k3s.yaml,{folder}/k3s.yaml,")"
"""
SUDO = """#!/bin/sh
while [ "$1" != root ]; do shift; done
shift
exec "$@"
"""
PLAYBOOK = """
- import_playbook: rosops.fleet.validate
- hosts: robots
  gather_facts: false
  tasks:
    - name: Give the robot its namespace
      ansible.builtin.import_role:
        name: rosops.fleet.robot_namespace
"""


@pytest.fixture
def server() -> Iterator[Server]:
    made = Server()
    made.put(IDENTITY, Identity("production", "edge").as_object())
    yield made
    made.stop()


class Control:
    """A control node: an empty home, an inventory, and the way to the hosts."""

    def __init__(self, folder: Path, server: Server) -> None:
        self.folder = folder
        port = server.server_address[1]
        self._write("ssh", SSH.format(folder=folder), 0o755)
        self._write("sudo", SUDO, 0o755)
        config = {
            "apiVersion": "v1",
            "clusters": [{"name": "default", "cluster": {"server": f"http://127.0.0.1:{port}"}}],
            "users": [{"name": "default", "user": {"token": "very-secret"}}],
        }
        self._write("k3s.yaml", yaml.safe_dump(config))
        hosts = {
            name: {"ansible_host": f"192.0.2.{number}"} for number, name in enumerate(("edge1", "edge2", "edge3"), 1)
        }
        robots = {f"robot{number}": {"ansible_host": f"192.0.2.{10 + number}"} for number in range(1, 11)}
        variables = {
            "fleet_name": "production",
            "k3s_api_endpoint": "127.0.0.1",
            "ansible_ssh_executable": str(folder / "ssh"),
            "ansible_become_exe": str(folder / "sudo"),
            "ansible_user": "robot",
            "ansible_python_interpreter": sys.executable,
        }
        children = {"edge": {"hosts": hosts}, "robots": {"hosts": robots}}
        self._write("hosts.yml", yaml.safe_dump({"all": {"vars": variables, "children": children}}))
        self._write("play.yml", PLAYBOOK)
        (folder / "home").mkdir()

    def plays(self, playbook: str) -> None:
        """Take one of the collection's own, on robots with an app."""
        self._write("play.yml", f"- import_playbook: rosops.fleet.{playbook}\n")
        inventory = yaml.safe_load((self.folder / "hosts.yml").read_text())
        apps = [{"name": "talker", "image": "talker:1", "command": ["talk"]}]
        inventory["all"]["vars"]["ros_apps"] = apps
        self._write("hosts.yml", yaml.safe_dump(inventory))

    def _write(self, name: str, text: str, mode: int = 0o644) -> None:
        (self.folder / name).write_text(text)
        (self.folder / name).chmod(mode)

    def run(self, *arguments: str, **environ: str) -> subprocess.CompletedProcess[str]:
        kept = {
            key: value for key, value in os.environ.items() if not key.startswith(("ANSIBLE_", "K8S_AUTH_", "KUBE"))
        }
        environment = {
            **kept,
            "HOME": str(self.folder / "home"),
            "ANSIBLE_CONFIG": str(CHECKOUT / "ansible.cfg"),
            "ANSIBLE_COLLECTIONS_PATH": str(CHECKOUT / ".ansible" / "collections"),
            "ANSIBLE_LOCAL_TEMP": str(self.folder / "tmp"),
            "ANSIBLE_NOCOLOR": "1",
            "ROSOPS_FLEET_REPORT": str(self.folder / "report.json"),
            **environ,
        }
        program = str(Path(sys.executable).parent / "ansible-playbook")
        command = [program, "-i", str(self.folder / "hosts.yml"), str(self.folder / "play.yml"), *arguments]
        return subprocess.run(  # noqa: S603 - our own
            command, cwd=self.folder, env=environment, capture_output=True, text=True, timeout=300, check=False
        )

    @property
    def asked(self) -> list[str]:
        path = self.folder / "asked"
        return path.read_text().split() if path.exists() else []

    def left(self) -> list[Path]:
        """Files that hold the credentials, but for the server's own."""
        files = [path for path in self.folder.rglob("*") if path.is_file() and path.name != "k3s.yaml"]
        return [path for path in files if b"very-secret" in path.read_bytes()]


@pytest.fixture
def control(tmp_path: Path, server: Server) -> Control:
    return Control(tmp_path, server)


def tokens(server: Server) -> set[Any]:
    return {headers.get("authorization") for _path, _query, headers in list(server.requests.queue)}


def test_ten_robots_of_a_limit_fetch_it_once_from_a_living_server_outside_of_it(
    server: Server, control: Control
) -> None:
    done = control.run("--limit", "robots", "-vvvvv", K8S_AUTH_API_KEY="left in a shell")
    assert done.returncode == 0, done.stdout + done.stderr
    assert [host for host in control.asked if host in EDGES] == ["192.0.2.1", "192.0.2.2"]
    assert tokens(server) == {"Bearer very-secret"}
    assert len([write for write in server.writes if "namespaces/robot-robot" in write]) >= 10
    said = [line for line in done.stdout.splitlines() if line.startswith("cluster edge: ")]
    assert said == [f"cluster edge: {server.url} (from the cluster's own server)"]
    assert "very-secret" not in done.stdout + done.stderr
    assert control.left() == []
    assert not list((control.folder / "home").rglob("*kube*"))


def test_an_api_server_that_restarts_fails_no_robot(server: Server, control: Control) -> None:
    port, lists, back = server.server_address[1], server.lists, list[Server]()
    server.shutdown()
    server.server_close()

    log, over = control.folder / "log", threading.Event()

    def come_back() -> None:
        """Once it was said that the server is missed."""
        while not over.wait(0.1) and not (log.exists() and "cannot be reached" in log.read_text()):
            pass
        back.append(Server(port))
        back[0].lists = lists

    thread = threading.Thread(target=come_back)
    thread.start()
    try:
        done = control.run("--limit", "robots", ANSIBLE_LOG_PATH=str(log))
    finally:
        over.set()
        thread.join()
        back[0].stop()
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"] The Kubernetes API at {server.url} cannot be reached: connection refused." in done.stdout
    assert "It is tried again for 5" in done.stdout
    assert "unknown type" not in done.stdout + done.stderr


def test_nothing_is_left_after_a_failure(server: Server, control: Control) -> None:
    server.put(IDENTITY, Identity("staging", "edge").as_object())
    done = control.run("--limit", "robot1")
    assert done.returncode == 2
    assert "the cluster edge of the fleet staging" in done.stdout
    assert (server.writes, control.left()) == ([], [])


@pytest.mark.parametrize("playbook", ["update", "rollback", "status", "site"])
def test_stagings_access_under_productions_name_is_refused_by_every_playbook(
    server: Server, control: Control, playbook: str
) -> None:
    server.put(IDENTITY, Identity("staging", "edge").as_object())
    control.plays(playbook)
    tags = ["--tags", "namespace,node"] if playbook == "site" else []
    done = control.run("--limit", "robot1", *tags, K8S_AUTH_HOST=server.url, K8S_AUTH_API_KEY="t")
    said = " ".join(done.stdout.split())
    assert "the cluster edge of the fleet staging; the inventory's is the cluster edge of the fleet production" in said
    assert (done.returncode == 0) == (playbook == "status")  # which shows it as a problem
    assert {path for path, _query, _headers in list(server.requests.queue)} == {IDENTITY}
    assert server.writes == []


def test_another_control_node_sees_what_became_of_a_run(server: Server, control: Control, tmp_path: Path) -> None:
    server.put("/api/v1/namespaces/kube-system", {"metadata": {"name": "kube-system"}})
    control.plays("rollback")
    done = control.run("--limit", "robot1", ANSIBLE_SHOW_CUSTOM_STATS="1")
    assert done.returncode == 0, done.stdout + done.stderr
    word = re.search(r"RUN: fleet_outcomes: robot1: outcome: (\w+)", " ".join(done.stdout.split()))
    assert word, done.stdout
    (tmp_path / "other").mkdir()
    other = Control(tmp_path / "other", server)
    other.plays("status")
    seen = other.run("--limit", "robot1")
    assert seen.returncode == 0, seen.stdout + seen.stderr
    assert re.search(rf"LAST OUTCOMES\n.*\n  robot1 +{word[1]} +play.yml +20", seen.stdout)
    assert other.asked[1:] == ["192.0.2.1", "192.0.2.2"]
    assert (control.left(), other.left()) == ([], [])
