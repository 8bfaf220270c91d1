# SPDX-License-Identifier: GPL-3.0-or-later
"""Results come from a robot's claim to the control node."""

from __future__ import annotations

import hashlib
from pathlib import Path

from cluster import SENSOR, STORAGE
from fleet import Fleet

ODD = "$HOME;\n-rf.bag"


def test_large_files_and_odd_names_come_and_a_link_that_leads_out_does_not(fleet: Fleet, tmp_path: Path) -> None:
    claim, volume = f"{STORAGE}/*_robot-robot1_{SENSOR}", SENSOR.removesuffix("-pvc")
    robot, results = fleet.hosts, tmp_path / "robot1" / volume
    robot.ssh("robot1", f"cd {claim} && head -c 200000000 /dev/urandom > 'a bag.bag' && ln -sf /etc/shadow out.bag")
    robot.ssh("robot1", f"cd {claim} && echo odd > '{ODD}' && ln -sfn /etc away && echo '- *' > .rsync-filter")
    wanted = {"collect_dest": str(tmp_path), "collect_claims": [volume], "collect_match": ["*.bag", "away/*"]}
    variables = {**fleet.variables, **wanted, "collect_robots": ["robot1"]}
    collected = fleet.playbooks.run("collect", variables)
    assert (collected.status, collected.changed) == (0, 1), collected
    assert sorted(path.name for path in results.iterdir()) == [ODD, "a bag.bag"]
    assert (results / ODD).read_text() == "odd\n"
    with (results / "a bag.bag").open("rb") as file:
        found = hashlib.file_digest(file, "sha256").hexdigest()
    assert found == robot.ssh("robot1", f"cd {claim} && sha256sum < 'a bag.bag'").split()[0]
    fleet.playbooks.run("collect", variables).must_change_nothing()
    robot.ssh("robot1", f"cd {claim} && rm -f 'a bag.bag' '{ODD}' out.bag away .rsync-filter")
