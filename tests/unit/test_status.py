# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""status.yml is harmless: it subscribes to nothing, and no disk keeps it waiting for ever."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

PLAYBOOK = Path(__file__).resolve().parents[2] / "playbooks" / "status.yml"


def task(action: str) -> dict[str, Any]:
    plays = yaml.safe_load(PLAYBOOK.read_text())
    found: dict[str, Any] = next(one[action] for play in plays for one in play.get("tasks", ()) if action in one)
    return found


def test_nobody_begins_to_publish_because_somebody_looks() -> None:
    read = task("rosops.fleet.ros_graph_info")
    assert (read["rate_source"], read.get("md5sums", False)) == ("counters", False)


def test_a_page_on_the_control_node_is_no_change_of_a_host() -> None:
    """Else the report of a look says of a host that it was updated."""
    tasks = [one for play in yaml.safe_load(PLAYBOOK.read_text()) for one in play.get("tasks", ())]
    assert [one["changed_when"] for one in tasks if "rosops.fleet._fleet_status" in one] == [False]


def test_measuring_the_volumes_ends() -> None:
    assert '["timeout", ' in task("ansible.builtin.command")["argv"]
