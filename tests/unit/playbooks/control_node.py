# SPDX-License-Identifier: GPL-3.0-or-later
"""A control node for ansible-playbook itself: a program in the place of ssh, another in that of sudo."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import yaml
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server

CHECKOUT = Path(__file__).resolve().parents[3]
ROBOTS = ("robot1", "robot2", "robot3", "robot4", "robot5")
IDENTITY = "/api/v1/namespaces/kube-system/configmaps/rosops-fleet"
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


def started(folder: Path, inventory: str, play: str | Path, *words: str, **environ: str) -> subprocess.Popen[str]:
    """ansible-playbook in a folder, as by a user of this checkout whose home is in it and who has set nothing else."""
    (folder / "home").mkdir(exist_ok=True)
    set_for_it = ("ANSIBLE_", "K8S_AUTH_", "KUBE", "CONTROLLER_")
    environment = {
        **{key: value for key, value in os.environ.items() if not key.startswith(set_for_it)},
        "HOME": str(folder / "home"),
        "ANSIBLE_CONFIG": str(CHECKOUT / "ansible.cfg"),
        "ANSIBLE_COLLECTIONS_PATH": str(CHECKOUT / ".ansible" / "collections"),
        "ANSIBLE_LOCAL_TEMP": str(folder / "tmp"),
        "ANSIBLE_NOCOLOR": "1",
        "ANSIBLE_PIPELINING": "1",  # of localhost, too: what it runs is half as many processes
        "LC_ALL": "C.UTF-8",
        "ROSOPS_FLEET_REPORT": str(folder / "report.json"),
        **environ,
    }
    command = [str(Path(sys.executable).parent / "ansible-playbook"), "-i", inventory, str(play), *words]
    return subprocess.Popen(  # noqa: S603 - our own
        command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def ended(process: subprocess.Popen[str]) -> subprocess.CompletedProcess[str]:
    """Once it has ended, with what it has printed."""
    out, err = process.communicate(timeout=300)
    print(out[-20000:], err[-2000:])
    return subprocess.CompletedProcess(process.args, process.returncode, out, err)


class Control:
    """A control node: an empty home, an inventory, and the way to the hosts."""

    def __init__(self, folder: Path, server: Server) -> None:
        self.folder = folder
        self.started: list[subprocess.Popen[str]] = []
        port = server.server_address[1]
        self.write("ssh", SSH.format(folder=folder), 0o755)
        self.write("sudo", SUDO, 0o755)
        config = {
            "apiVersion": "v1",
            "clusters": [{"name": "default", "cluster": {"server": f"http://127.0.0.1:{port}"}}],
            "users": [{"name": "default", "user": {"token": "very-secret"}}],
        }
        self.write("k3s.yaml", yaml.safe_dump(config))
        hosts = {
            name: {"ansible_host": f"192.0.2.{number}"} for number, name in enumerate(("edge1", "edge2", "edge3"), 1)
        }
        robots = {name: {"ansible_host": f"192.0.2.{10 + number}"} for number, name in enumerate(ROBOTS, 1)}
        variables = {
            "fleet_name": "production",
            "k3s_api_endpoint": "127.0.0.1",
            "ansible_ssh_executable": str(folder / "ssh"),
            "ansible_ssh_transfer_method": "piped",  # others begin with sftp, which has a way to hosts of its own
            "ansible_become_exe": str(folder / "sudo"),
            "ansible_user": "robot",
            "ansible_python_interpreter": sys.executable,
        }
        children = {"edge": {"hosts": hosts}, "robots": {"hosts": robots}}
        self.write("hosts.yml", yaml.safe_dump({"all": {"vars": variables, "children": children}}))
        self.write("play.yml", PLAYBOOK)

    def write(self, name: str, text: str, mode: int = 0o644) -> None:
        (self.folder / name).write_text(text)
        (self.folder / name).chmod(mode)

    def run(self, *arguments: str, **environ: str) -> subprocess.CompletedProcess[str]:
        return ended(self.start(*arguments, **environ))

    def start(self, *arguments: str, **environ: str) -> subprocess.Popen[str]:
        process = started(self.folder, "hosts.yml", "play.yml", *arguments, **environ)
        self.started.append(process)
        return process

    def end(self) -> None:
        """What a test that failed has left running."""
        for process in self.started:
            if process.poll() is None:
                process.terminate()
                process.communicate()

    @property
    def asked(self) -> list[str]:
        path = self.folder / "asked"
        return path.read_text().split() if path.exists() else []

    def left(self) -> list[Path]:
        """Files that hold the credentials, but for the server's own."""
        files = [path for path in self.folder.rglob("*") if path.is_file() and path.name != "k3s.yaml"]
        return [path for path in files if b"very-secret" in path.read_bytes()]
