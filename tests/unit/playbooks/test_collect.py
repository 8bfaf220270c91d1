# SPDX-License-Identifier: GPL-3.0-or-later
"""Results out of claims by ansible-playbook and rsync; hosts are directories behind a program in the place of ssh."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import sys
from pathlib import Path

import pytest
import yaml
from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import CHECKOUT, Control

APP = {"name": "talker", "image": "x.example/talker:1", "command": ["talk"]}
# What ssh is told is written down. A host's command runs here, its own programs before ours; at the edge root connects.
SSH = """#!/bin/sh
case "$*" in *ControlMaster*-O*|*' -O '*) exit 0;; esac
echo "$*" >> {folder}/asked
while [ "${{1#192.0.2.}}" = "$1" ]; do shift; done
host=$1; shift
[ "$host" = 192.0.2.1 ] && export WHO=0
PATH={folder}/$host:{folder}/bin:$PATH exec /bin/sh -c "$*"
"""
SUDO = """#!/bin/sh
while [ "$1" != root ]; do shift; done
shift
WHO=0 exec "$@"
"""
ID = "#!/bin/sh\necho ${WHO:-1000}\n"
# A host's rsync of which so many bytes come, with something in them exchanged, as root there can have it.
RSYNC = """#!{python}
import os, subprocess, sys
os.set_blocking(1, True)  # rsync leaves it otherwise to what it takes for ssh
left = {most}
with subprocess.Popen(["{rsync}", *sys.argv[1:]], stdout=subprocess.PIPE) as rsync:
    while left > 0 and (data := rsync.stdout.read1(min(left, 65536))):
        sys.stdout.buffer.write(data.replace({was!r}, {becomes!r}))
        sys.stdout.buffer.flush()
        left -= len(data)
    rsync.kill()
sys.exit(rsync.returncode != 0)
"""
EDGE, ROBOT = "192.0.2.1", "192.0.2.11"


class Hosts:
    """Two hosts that have claims, each in a directory of its own, and a control node."""

    def __init__(self, control: Control) -> None:
        self.control, self.folder = control, control.folder
        for name, text in (("bin/ssh", SSH.format(folder=self.folder)), ("bin/sudo", SUDO), ("bin/id", ID)):
            self.program(name, text)
        variables = {
            "fleet_name": "production",
            "ansible_user": "robot",
            "ansible_ssh_executable": str(self.folder / "bin" / "ssh"),
            "ansible_ssh_common_args": "-o UserKnownHostsFile=ours",
            "ansible_become": True,
            "ansible_become_exe": str(self.folder / "bin" / "sudo"),
            "ansible_python_interpreter": sys.executable,
            "ros_apps": [APP],
        }
        address = {"edge1": EDGE, "robot1": ROBOT}
        hosts = {
            name: {"ansible_host": address[name], "storage": str(self.folder / "storage of" / name)} for name in address
        }
        children = {"edge": {"hosts": {"edge1": hosts["edge1"]}}, "robots": {"hosts": {"robot1": hosts["robot1"]}}}
        control.write("hosts.yml", yaml.safe_dump({"all": {"vars": variables, "children": children}}))
        control.write("play.yml", f"- import_playbook: {CHECKOUT}/playbooks/collect.yml\n")
        self.claim("edge1", "results")
        self.dest = self.folder / "here"
        self.results = self.dest / "robot1"

    def program(self, path: str, text: str) -> None:
        (self.folder / path).parent.mkdir(exist_ok=True)
        self.control.write(path, text, 0o755)

    def rsync(self, address: str, most: int = sys.maxsize, was: bytes = b"-", becomes: bytes = b"-") -> None:
        """What a host has in rsync's place."""
        real = shutil.which("rsync")
        text = RSYNC.format(python=sys.executable, rsync=real, most=most, was=was, becomes=becomes)
        self.program(f"{address}/rsync", text)

    def claim(self, host: str, volume: str, robot: str = "robot1") -> Path:
        made = self.folder / "storage of" / host / f"pvc-u_robot-{robot}_{volume}-pvc"
        made.mkdir(parents=True, exist_ok=True)
        return made

    def collect(self, *arguments: str, **environ: str) -> tuple[int, str]:
        path = f"{self.folder / 'bin'}:{os.environ['PATH']}"
        places = "collect_dest=here __collect_storage_path='{{ storage }}'"
        done = self.control.run("-e", places, *arguments, **{"PATH": path, **environ})
        return done.returncode, done.stdout + done.stderr


@pytest.fixture
def hosts(control: Control) -> Hosts:
    return Hosts(control)


def sums(folder: Path) -> dict[bytes, str]:
    paths = [path for path in folder.rglob("*") if path.is_file() and not path.is_symlink()]
    return {os.fsencode(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in paths}


def test_results_come_once_and_links_stay_there(hosts: Hosts) -> None:
    logs, results = hosts.claim("robot1", "logs"), hosts.claim("edge1", "results")
    (logs / "run 1").mkdir()
    (logs / "run 1" / "a big.bag").write_bytes(os.urandom(9 << 20))
    Path(os.fsdecode(os.fsencode(logs) + b"/\xff\n'\"$HOME")).write_bytes(b"odd")
    (logs / "out").symlink_to(hosts.folder / "hosts.yml")
    (logs / "away").symlink_to(hosts.folder)
    os.mkfifo(logs / "pipe")
    (results / "answers.jsonl").write_text("{}\n")
    (results / "answers.jsonl").chmod(0o4700)
    (results / ".rsync-filter").write_text("- *\n")  # an app's own: no rule of ours
    (hosts.claim("robot1", "logs", "other") / "forged").write_text("x")
    status, output = hosts.collect("--check", "--limit", "robot1")
    assert (status, output.count("changed=1")) == (0, 1)
    assert "run 1/a big.bag" in output
    assert not hosts.dest.exists()
    status, output = hosts.collect()
    assert (status, output.count("changed=1")) == (0, 2)
    assert sums(hosts.results / "logs") == sums(logs)
    assert sums(hosts.results / "results") == sums(results)
    assert (hosts.results / "results" / "answers.jsonl").stat().st_mode & 0o7111 == 0
    assert {path.name for path in hosts.results.rglob("*") if path.is_symlink() or path.is_fifo()} == set()
    assert [path.name for path in hosts.dest.iterdir()] == ["robot1"]
    called = [line for line in (hosts.folder / "asked").read_text().splitlines() if "--sender" in line]
    assert {"sudo -n -u root rsync" in line for line in called if ROBOT in line} == {True}
    assert {"sudo" in line for line in called if ROBOT not in line} == {False}
    assert {"UserKnownHostsFile=ours" in line for line in called} == {True}
    assert {"StrictHostKeyChecking=no" in line for line in called} == {False}
    status, output = hosts.collect()
    assert (status, output.count("changed=0")) == (0, 2)


def test_one_claim_some_patterns_and_a_volume_that_nobody_has(hosts: Hosts) -> None:
    """Names may come as a text, too."""
    logs = hosts.claim("robot1", "logs")
    (hosts.claim("edge1", "results") / "c.bag").write_text("c")
    names = {"a.bag", "b.log", "runs of/may/1", "other/a.bag", "other/runs of/1"}
    for path in (logs / name for name in names):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(path.name)
    wanted = {"collect_claims": "logs bags", "collect_match": ["*.bag", "runs of/*"], "collect_robots": "robot1"}
    status, output = hosts.collect("-e", json.dumps(wanted))
    assert status == 2
    assert "bags: no host of this run has a claim of this volume" in output
    assert {*sums(hosts.dest)} == {b"robot1/logs/a.bag", b"robot1/logs/runs of/may/1", b"robot1/logs/other/a.bag"}


def test_a_host_that_makes_up_names_writes_nothing(hosts: Hosts) -> None:
    absolute = hosts.folder / "mine"
    relative, long = "xx_xx_mine", "x" * len(str(absolute))
    (hosts.claim("robot1", "results") / relative).write_text("evil")
    (hosts.claim("edge1", "results") / long).write_text("evil")
    hosts.rsync(ROBOT, was=relative.encode(), becomes=b"../../mine")
    hosts.rsync(EDGE, was=long.encode(), becomes=os.fsencode(absolute))
    (hosts.claim("robot1", "logs") / "a").write_text("a")
    status, output = hosts.collect()
    assert status == 2
    assert "unsafe pathname from sender: ../../mine" in output
    assert f"unsafe pathname from sender: {absolute}" in output
    assert {*sums(hosts.dest)} == {b"robot1/logs/a"}  # another claim is not the worse for it
    assert list(hosts.folder.rglob("mine")) == []


def test_what_was_cut_off_does_not_look_finished_and_is_gone_on_with(hosts: Hosts) -> None:
    bag = hosts.claim("robot1", "logs") / "a.bag"
    bag.write_bytes(os.urandom(9 << 20))
    hosts.rsync(ROBOT, most=5_000_000)
    hosts.program(f"{EDGE}/rsync", "#!/bin/sh\nexit 127\n")
    status, output = hosts.collect()
    assert status == 2
    assert "edge1: `rsync` does not run" in output
    assert "install the package rsync there" in output
    assert [*sums(hosts.dest)] == [b"robot1/logs/.rsync-partial/a.bag"]
    hosts.rsync(ROBOT, most=6_000_000)
    (hosts.folder / EDGE / "rsync").unlink()
    status, output = hosts.collect()
    assert status == 0, output
    assert sums(hosts.dest) == {b"robot1/logs/a.bag": hashlib.sha256(bag.read_bytes()).hexdigest()}
    assert list(hosts.dest.rglob(".rsync-partial")) == []


def test_a_control_node_without_rsync_is_told_so(hosts: Hosts) -> None:
    (hosts.claim("robot1", "logs") / "a").write_text("a")
    few = hosts.folder / "few"
    few.mkdir()
    for program in Path("/usr/bin").iterdir():
        if program.name != "rsync":
            (few / program.name).symlink_to(program)
    status, output = hosts.collect("--limit", "robot1", PATH=f"{hosts.folder / 'bin'}:{few}")
    assert status == 2
    assert "the control node has no rsync; install the package rsync there" in output
