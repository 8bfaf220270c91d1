# SPDX-License-Identifier: GPL-3.0-or-later
"""Tasks of a user's own behind the gate: tasks that fail, and a reboot of a robot at work."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from cluster import LAB
from fleet import ROBOTS, Fleet
from runs import Run
from test_3_interrupted import wait_for_new_goal

MARK = "/var/tmp/guarded"  # noqa: S108 - on the lab's hosts
DONE = f"""
- name: Leave a mark
  ansible.builtin.copy: {{content: done, dest: {MARK}, mode: "0644"}}
  become: true
"""
FAILS = f"""
{DONE}
- name: Find something wrong
  ansible.builtin.fail: {{msg: the disk is full}}
"""
UNDONE = f"""
- name: Take the mark away
  ansible.builtin.file: {{path: {MARK}, state: absent}}
  become: true
"""
REBOOTS = """
- name: Restart the robot, from outside, as a container cannot do it by itself
  ansible.builtin.command: {argv: [%s, host, --lab, %s, "{{ inventory_hostname }}", reboot]}
  delegate_to: localhost
- name: Wait until it is there
  ansible.builtin.wait_for_connection: {timeout: 120}
"""


@pytest.fixture
def tasks(fleet: Fleet, tmp_path: Path) -> Iterator[Any]:
    """Writes a file of tasks; the hosts have no mark before and after."""

    def clean() -> None:
        for robot in ROBOTS:
            fleet.hosts.ssh(robot, f"rm -f {MARK}")

    def written(text: str, name: str = "tasks.yml") -> str:
        (tmp_path / name).write_text(f"---{text}", encoding="utf-8")
        return str(tmp_path / name)

    clean()
    yield written
    clean()


def guarded(fleet: Fleet, tasks: str, **variables: Any) -> Run:
    wanted = {**fleet.variables, "guarded_tasks": tasks, **variables}
    return fleet.playbooks.run("guarded", wanted, "--limit", "robot2,edge1")


def marked(fleet: Fleet) -> list[str]:
    return [robot for robot in ROBOTS if fleet.hosts.ssh(robot, f"ls {MARK} || true").strip()]


@pytest.mark.long
@pytest.mark.promise("tasks of one's own go through the gate, and are proven or taken back")
def test_tasks_are_proven_and_what_fails_is_taken_back(fleet: Fleet, tasks: Any) -> None:
    """On a robot whose goals are short, with time between them."""
    watch, pods = fleet.watch(), fleet.running()
    guarded(fleet, tasks(DONE)).must(0, robot2="updated")
    assert marked(fleet) == ["robot2"]
    guarded(fleet, tasks(DONE)).must(0, robot2="unchanged").must_change_nothing()
    back = guarded(fleet, tasks(FAILS), guarded_undo=tasks(UNDONE, "undo.yml")).must(2, robot2="rolled-back")
    assert "Find something wrong: the disk is full" in back.host("robot2")["reason"], back
    assert marked(fleet) == []
    fleet.assert_still_running(pods)
    watch.assert_nothing_lost()


def test_a_reboot_waits_for_the_robot_to_rest_and_is_proven(fleet: Fleet, tasks: Any) -> None:
    watch, before = fleet.watch(), fleet.running()["robot2"]
    wait_for_new_goal(fleet, "robot2")
    guarded(fleet, tasks(REBOOTS % (LAB, fleet.hosts.lab)), guarded_ready_timeout=240).must(0, robot2="updated")
    after = fleet.running()["robot2"]
    local = [app for app, pods in before.items() if app in ("temperature", "add-two-ints", "prime-factors")]
    assert len(local) == 3 and all(after[app] != before[app] for app in local), after
    losses = watch.losses("robot2", patience=150)["robot2"]
    assert (losses.unsuccessful, losses.twice) == ([], []), losses  # no goal was under way, and none was lost
