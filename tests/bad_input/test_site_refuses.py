# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of bad inputs, end to end: `site.yml` refuses each before it touches anything.

Run on its own: `.venv/bin/pytest tests/bad_input` (about 2 s a case). Hosts are 127.0.0.1 and on, port 1: whoever got
past the validation would be seen as unreachable. Only `ansible-playbook` is run, as an operator does it.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

CHECKOUT = Path(__file__).resolve().parents[2]
PLAYBOOK = CHECKOUT / "playbooks" / "site.yml"
VALIDATE = CHECKOUT / "playbooks" / "validate.yml"  # what site.yml imports first
sys.path.insert(0, str(CHECKOUT / ".ansible" / "collections"))
from ansible_collections.rosops.fleet.tests.unit.bad_input import table  # noqa: E402 - found through the line above
from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import ended, started  # noqa: E402

NOWHERE = {"ansible_port": 1, "ansible_connection": "ssh"}
TASK = re.compile(r"^TASK \[(?P<name>.*?)\]", re.MULTILINE)
PLAY = re.compile(r"^PLAY \[(?P<name>.*?)\]", re.MULTILINE)
VALIDATION = "rosops.fleet._fleet_config"
IMPORT = "ansible.builtin.import_tasks"


# Each case is checked as data by the unit tests. That the playbook ends there is the same for all of them: where time
# matters (`make test`), some will do.
STEP = 12 if os.environ.get("ROSOPS_TEST_CASES") == "promises" else 1
CASES: list[dict[str, Any]] = [case for case in table.load_cases() if "pure" not in case][::STEP]


def inventory(case: dict[str, Any]) -> str:
    """The case as an inventory file."""
    fleet = table.fleet_of(case)
    groups = {name: hosts for name, hosts in fleet["groups"].items() if name != "all"}
    return yaml.safe_dump(
        {
            "all": {
                "hosts": {
                    host: {**NOWHERE, "ansible_host": f"127.0.0.{number}", **fleet["hosts"].get(host, {})}
                    for number, host in enumerate(fleet["groups"]["all"], 1)
                },
                "children": {name: {"hosts": dict.fromkeys(hosts, None)} for name, hosts in groups.items()},
            }
        }
    )


def site(text: str, home: Path) -> subprocess.CompletedProcess[str]:
    """`ansible-playbook playbooks/site.yml` with an inventory, as the operator of a checkout starts it."""
    path = home / "inventory.yml"
    path.write_text(text, encoding="utf-8")
    return ended(started(home, str(path), PLAYBOOK))


def first_tasks() -> set[str]:
    """The names of what runs before a host is touched: the validation, and what it imports before."""
    plays = yaml.safe_load(VALIDATE.read_text("utf-8"))
    tasks = [task for play in plays for task in play.get("tasks", [])]
    imported = [VALIDATE.parent / task[IMPORT] for task in tasks if IMPORT in task]
    first = [task for path in imported for task in yaml.safe_load(path.read_text("utf-8"))]
    return {task["name"] for task in [*first, *(task for task in tasks if VALIDATION in task)]}


def refused(text: str, home: Path) -> str:
    """What is said of an inventory; nothing but the validation ran, and it changed nothing."""
    result = site(text, home)
    output = result.stdout + result.stderr
    assert result.returncode not in (0, 4), output  # 4: somebody tried to reach a host
    assert "Traceback" not in output
    assert set(TASK.findall(result.stdout)) <= first_tasks()
    assert len(PLAY.findall(result.stdout)) <= 1
    assert "changed: [" not in result.stdout
    assert "UNREACHABLE" not in result.stdout
    assert not re.search(r"changed=[1-9]", result.stdout)
    return output


@pytest.mark.parametrize("case", CASES, ids=lambda case: str(case["says"]))
def test_refused(case: dict[str, Any], tmp_path: Path) -> None:
    output = refused(inventory(case), tmp_path)
    assert table.missing_words(case, output.replace("\\n", "\n")) == [], output
    assert "hush" not in output


def test_malformed_yaml(tmp_path: Path) -> None:
    """Ansible's own words, but still no traceback, no host and an exit status that says so (`ansible.cfg`)."""
    text = "all:\n  hosts:\n    robot1:\n      ros_master_image: ros: noetic\n"
    assert "inventory.yml" in refused(text, tmp_path)


def test_a_good_inventory_gets_past_the_validation(tmp_path: Path) -> None:
    """Else everything above could pass because nothing ever works."""
    result = site(inventory({"app": {}}), tmp_path)
    assert len(PLAY.findall(result.stdout)) > 1, result.stdout + result.stderr
    assert "UNREACHABLE" in result.stdout
