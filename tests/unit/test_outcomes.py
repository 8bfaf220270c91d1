# SPDX-License-Identifier: GPL-3.0-or-later
"""Playbooks hand on what became of hosts in one way, and have access to a cluster in no file; looking is harmless."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.callback.fleet_report import CORE

PLAYBOOKS = Path(__file__).resolve().parents[2] / "playbooks"
PARTS = ("edge_images.yml", "k3s_waves.yml", "outcomes.yml", "waves.yml", "validate.yml")  # of the others
ELSEWHERE = ("awx_setup.yml", "new.yml")  # of these no host of a fleet is asked
FOR_AWX = ("awx_access.yml", "awx_setup.yml")  # which needs one in a credential


def plays(name: str) -> list[dict[str, Any]]:
    return list(yaml.safe_load((PLAYBOOKS / name).read_text("utf-8")))


def imported(name: str) -> list[str]:
    return [str(play.get("ansible.builtin.import_playbook")) for play in plays(name)]


@pytest.mark.parametrize(
    "name", sorted(path.name for path in PLAYBOOKS.glob("*.yml") if path.name not in PARTS + ELSEWHERE)
)
def test_it_begins_with_the_validation_and_ends_with_the_outcomes(name: str) -> None:
    assert imported(name)[0] == "validate.yml"
    assert imported(name)[-1] == "outcomes.yml"


@pytest.mark.parametrize("name", ["validate.yml", "awx_setup.yml", "new.yml"])
def test_before_anything_else_an_ansible_core_that_is_too_old_is_refused(name: str) -> None:
    """All others begin with the validation."""
    assert plays(name)[0]["tasks"][0]["ansible.builtin.import_tasks"] == "tasks/core.yml"
    needed = yaml.safe_load((PLAYBOOKS / "tasks" / "core.yml").read_text("utf-8"))[0]["vars"]["needed"]
    meta = yaml.safe_load((PLAYBOOKS.parent / "meta" / "runtime.yml").read_text("utf-8"))
    assert meta["requires_ansible"] == f">={needed}"
    assert ".".join(map(str, CORE)) == needed.removesuffix(".0")


def test_a_run_that_ends_early_has_handed_something_on() -> None:
    begin = plays("validate.yml")[-1]["tasks"][-1]
    assert begin["rosops.fleet._outcomes"] == {"begin": True}


def test_only_looking_is_no_last_outcome() -> None:
    assert plays("status.yml")[-1]["vars"] == {"outcomes_kept": False}


def test_no_playbook_names_a_kubeconfig() -> None:
    for path in PLAYBOOKS.rglob("*.yml"):
        assert path.name in FOR_AWX or "kubeconfig" not in path.read_text("utf-8"), path


# --- status.yml is harmless: it subscribes to nothing, and no disk keeps it waiting for ever ------------------------


def tasks(action: str) -> list[dict[str, Any]]:
    return [one for play in plays("status.yml") for one in play.get("tasks", ()) if action in one]


def test_nobody_begins_to_publish_because_somebody_looks() -> None:
    read = tasks("rosops.fleet.ros_graph_info")[0]["rosops.fleet.ros_graph_info"]
    assert (read["rate_source"], read.get("md5sums", False)) == ("counters", False)


def test_a_page_on_the_control_node_is_no_change_of_a_host() -> None:
    """Else the report of a look says of a host that it was updated."""
    assert [one["changed_when"] for one in tasks("rosops.fleet._fleet_status")] == [False]


def test_measuring_the_volumes_ends() -> None:
    assert '["timeout", ' in tasks("ansible.builtin.command")[0]["ansible.builtin.command"]["argv"]
