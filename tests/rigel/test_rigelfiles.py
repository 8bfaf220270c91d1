# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""One Rigelfile for each application of the dissertation: imported, deployed, its results collected and compared."""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from cluster import STORAGE, Hosts
from runs import CHECKOUT, Playbooks, Run

RIGELFILES = CHECKOUT / "tests" / "unit" / "fixtures" / "rigel"
LAB = CHECKOUT / "inventories" / "lab"
# What the fleet's operator fills in: the lab's hosts, and images that its nodes have.
FILLED_IN = {"rigel_base_image": "lab/apps:1.0", "ros_master_image": "lab/ros:noetic"}
# Rigelfile -> the host and the claim that its client writes to, and the file.
RESULTS = {
    "action": ("robot1", "primes", "prime-factors.jsonl"),
    "pubsub": ("edge1", "logs-volume", "temperature-stats.jsonl"),
    "service": ("edge1", "arithmetic-logs", "add-two-ints.jsonl"),
}


class Imported:
    """The repository that a Rigelfile became, on the lab's hosts."""

    def __init__(self, name: str, folder: Path) -> None:
        self.name = name
        self.output = CHECKOUT / "reports" / "rigel" / name
        said = {"rigelfile": str(RIGELFILES / name / "Rigelfile"), "dest": str(folder / name)}
        # the import needs no host; Ansible wants an inventory all the same
        self.brought = Playbooks(LAB / "hosts.sh", self.output).run("import_rigelfile", said)
        self.inventory = folder / name / "inventory"
        self.playbooks = Playbooks(self.inventory, self.output / "fleet")
        (self.inventory / "hosts.yml").unlink(missing_ok=True)
        (self.inventory / "hosts.sh").symlink_to(LAB / "hosts.sh")
        lab: dict[str, Any] = yaml.safe_load((LAB / "group_vars" / "all.yml").read_text("utf-8"))
        self.variables = {**lab, **FILLED_IN}

    def run(self, playbook: str, *arguments: str, **more: Any) -> Run:
        return self.playbooks.run(playbook, {**self.variables, **more}, *arguments)


def first_bytes(hosts: Hosts, host: str, claim: str, file: str, count: int) -> str:
    """The sum of so many bytes of a file of robot1's, as its host itself finds it."""
    path = f"{STORAGE}/*_robot-robot1_{claim}-pvc/{shlex.quote(file)}"
    return hosts.ssh(host, f"head -c {count} {path} | sha256sum").split()[0]


@pytest.fixture(scope="module")
def fleet(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Imported]:
    """Of the Rigelfile named, on bare hosts; they are bare again afterwards."""
    request.getfixturevalue("lab")  # the playbooks find its name in their environment
    imported = Imported(request.param, tmp_path_factory.mktemp(request.param))
    assert imported.brought.status == 0, imported.brought
    site = imported.run("site")
    assert site.status == 0, f"{site}\n{site.output[-3000:]}"
    yield imported
    reset = imported.run("reset", reset_confirm="yes")
    assert reset.status == 0, reset


@pytest.mark.parametrize("fleet", [*RESULTS], indirect=True, scope="module")
def test_imported_deployed_and_collected(hosts: Hosts, fleet: Imported, tmp_path: Path) -> None:
    again = fleet.run("site")
    assert (again.status, again.changed) == (0, 0), again

    host, claim, file = RESULTS[fleet.name]
    dest = tmp_path / "results"
    collected = fleet.run("collect", collect_dest=str(dest), collect_claims=[claim], collect_robots=["robot1"])
    assert collected.status == 0, f"{collected}\n{collected.output[-3000:]}"
    here = (dest / "robot1" / claim / file).read_bytes()
    assert here.startswith(b"{")
    found = hashlib.sha256(here).hexdigest()
    assert found == first_bytes(hosts, host, claim, file, len(here))
    assert f"{found}  {file}" in (dest / "robot1" / f"{claim}.sha256").read_text("utf-8").splitlines()


@pytest.mark.parametrize("fleet", ["action"], indirect=True, scope="module")
def test_a_large_file_of_an_odd_name_and_a_link_that_leads_out(hosts: Hosts, fleet: Imported, tmp_path: Path) -> None:
    claim = f"{STORAGE}/*_robot-robot1_primes-pvc"
    hosts.ssh("robot1", f"cd {claim} && head -c 200000000 /dev/urandom > 'a bag.bag' && ln -sf /etc/shadow out.bag")
    dest = tmp_path / "results"
    wanted = {"collect_dest": str(dest), "collect_claims": ["primes"], "collect_match": ["*.bag"]}
    collected = fleet.run("collect", **wanted)
    assert (collected.status, collected.changed) == (0, 1), f"{collected}\n{collected.output[-3000:]}"
    assert sorted(path.name for path in (dest / "robot1" / "primes").iterdir()) == ["a bag.bag"]
    with (dest / "robot1" / "primes" / "a bag.bag").open("rb") as file:
        found = hashlib.file_digest(file, "sha256").hexdigest()
    assert found == hosts.ssh("robot1", f"cd {claim} && sha256sum < 'a bag.bag'").split()[0]
    again = fleet.run("collect", **wanted)
    assert (again.status, again.changed) == (0, 0), again
    hosts.ssh("robot1", f"cd {claim} && rm -f 'a bag.bag' out.bag")
