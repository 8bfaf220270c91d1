# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Results out of claims by ansible-playbook itself, over connections to this machine: the module runs as on a host."""

from __future__ import annotations

import hashlib
import json
import os
import sys
from pathlib import Path

import pytest
import yaml
from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import CHECKOUT, Control

APP = {"name": "talker", "image": "x.example/talker:1", "command": ["talk"]}


@pytest.fixture
def storage(control: Control, tmp_path: Path) -> Path:
    """Two hosts that have claims, each in a directory of its own."""
    here = {"ansible_connection": "local", "ansible_python_interpreter": sys.executable}
    variables = {**here, "fleet_name": "production", "ansible_become_exe": str(tmp_path / "sudo"), "ros_apps": [APP]}
    hosts = {name: {"collect_storage_path": str(tmp_path / name)} for name in ("edge1", "robot1")}
    children = {"edge": {"hosts": {"edge1": hosts["edge1"]}}, "robots": {"hosts": {"robot1": hosts["robot1"]}}}
    control.write("hosts.yml", yaml.safe_dump({"all": {"vars": variables, "children": children}}))
    control.write("play.yml", f"- import_playbook: {CHECKOUT}/playbooks/collect.yml\n")
    claim(tmp_path, "robot1", "logs")
    claim(tmp_path, "edge1", "results")
    (tmp_path / "robot1" / "pvc-u_robot-other_logs-pvc").mkdir()
    return tmp_path


def claim(storage: Path, host: str, volume: str) -> Path:
    made = storage / host / f"pvc-u_robot-robot1_{volume}-pvc"
    made.mkdir(parents=True, exist_ok=True)
    return made


def collect(control: Control, *arguments: str) -> tuple[int, str]:
    done = control.run("-e", "collect_dest=here", *arguments)
    print(done.stdout + done.stderr)
    return done.returncode, done.stdout + done.stderr


def sums(folder: Path) -> dict[bytes, str]:
    paths = [path for path in folder.rglob("*") if path.is_file() and not path.is_symlink()]
    return {os.fsencode(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in paths}


def test_results_come_with_their_sums_and_once(control: Control, storage: Path) -> None:
    logs, results = claim(storage, "robot1", "logs"), claim(storage, "edge1", "results")
    (logs / "run 1").mkdir()
    (logs / "run 1" / "big.bag").write_bytes(os.urandom(9 << 20))  # more than one call brings
    Path(os.fsdecode(os.fsencode(logs) + b"/\xff\n")).write_bytes(b"odd")
    (logs / "out").symlink_to(storage / "k3s.yaml")
    (results / "answers.jsonl").write_text("{}\n")
    status, output = collect(control, "--check")
    assert (status, output.count("changed=1")) == (0, 2)
    assert not (storage / "here").exists()
    status, output = collect(control)
    assert (status, output.count("changed=1")) == (0, 2)
    assert sums(storage / "here" / "robot1" / "logs") == sums(logs)
    assert sums(storage / "here" / "robot1" / "results") == sums(results)
    assert not os.path.lexists(storage / "here" / "robot1" / "logs" / "out")
    status, output = collect(control)
    assert (status, output.count("changed=0")) == (0, 2)


@pytest.mark.parametrize(
    "said",
    [
        ("-e", json.dumps({"collect_claims": ["logs"], "collect_match": ["*.bag"]})),
        ("-e", "collect_claims=logs", "-e", "collect_match='*.bag' collect_robots=robot1"),
    ],
    ids=["lists", "texts"],
)
def test_one_claim_one_pattern(control: Control, storage: Path, said: tuple[str, ...]) -> None:
    logs = claim(storage, "robot1", "logs")
    for name in ("a.bag", "b.log"):
        (logs / name).write_text(name)
    status, output = collect(control, *said)
    assert status == 0, output
    assert {*sums(storage / "here")} == {b"robot1/logs/a.bag", b"robot1/logs.sha256"}


def test_a_volume_that_nobody_has_is_named(control: Control, storage: Path) -> None:
    (claim(storage, "robot1", "logs") / "a").write_text("a")
    status, output = collect(control, "-e", json.dumps({"collect_claims": ["logs", "bags"]}))
    assert status == 2
    assert "bags: no host of this run has a claim of this volume" in output
    assert (storage / "here" / "robot1" / "logs" / "a").read_text() == "a"
