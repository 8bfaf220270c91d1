# SPDX-License-Identifier: GPL-3.0-or-later
"""Tasks of a user's own through the role guarded, by ansible-playbook itself: turns, failures, the end of the run."""

from __future__ import annotations

import re
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import CHECKOUT, Control, ended, started
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server

NODE, BEAT = "/api/v1/nodes/robot{}", "/apis/coordination.k8s.io/v1/namespaces/kube-node-lease/leases/robot{}"
READY = {"conditions": [{"type": "Ready", "status": "True"}]}
TASKS = """
- name: Leave a mark
  ansible.builtin.copy: {{content: done, dest: "{folder}/mark-{{{{ inventory_hostname }}}}"}}
- name: Find something wrong
  ansible.builtin.fail: {{msg: the disk is full}}
  when: inventory_hostname in broken | default([])
"""
UNDO = """
- name: Take the mark away
  ansible.builtin.file: {{path: "{folder}/mark-{{{{ inventory_hostname }}}}", state: absent}}
"""


@pytest.fixture
def control(tmp_path: Path, server: Server) -> Iterator[Control]:
    """Robots that run nothing; their kubelets are heard of all the time."""
    made = Control(tmp_path, server)
    made.write("play.yml", "- import_playbook: rosops.fleet.guarded\n")
    made.write("tasks.yml", TASKS.format(folder=tmp_path))
    made.write("undo.yml", UNDO.format(folder=tmp_path))
    over = threading.Event()

    def beat() -> None:
        count = 0
        while not over.wait(0.2):
            count += 1
            for number in (1, 2):
                server.put(BEAT.format(number), {"metadata": {}, "spec": {"renewTime": f"{count}"}})

    for number in (1, 2):
        server.put(NODE.format(number), {"metadata": {"name": f"robot{number}"}, "status": READY})
    kubelets = threading.Thread(target=beat)
    kubelets.start()
    yield made
    over.set()
    kubelets.join()


def given(control: Control, *more: str) -> list[str]:
    return ["-e", f"guarded_tasks={control.folder}/tasks.yml", "--limit", "robot1,robot2,edge2", *more]


def marks(control: Control) -> list[str]:
    return sorted(path.name for path in control.folder.glob("mark-*"))


def test_they_run_once_and_change_nothing_the_second_time(control: Control) -> None:
    check = control.run(*given(control, "--check", "--limit", "robot1"))
    assert (check.returncode, marks(control)) == (0, []), check.stdout
    with tempfile.TemporaryDirectory(prefix="beside-") as short:  # a socket's path may have 107 characters
        run = control.run(*given(control), TMPDIR=short)
        assert (run.returncode, marks(control)) == (0, ["mark-robot1", "mark-robot2"]), run.stdout
        end = time.monotonic() + 60
        while list(Path(short).glob("rosops-fleet-*/line")):
            assert time.monotonic() < end, "the process beside the run goes on"
            time.sleep(0.1)
    assert run.stdout.count("Leave a mark] ") == 2  # the first wave is one robot
    again = control.run(*given(control))
    assert again.returncode == 0
    assert again.stdout.count("changed=0") == 3, again.stdout


def test_what_fails_is_taken_back_and_the_wave_after_it_does_not_begin(control: Control) -> None:
    wrong = given(control, "-e", f"guarded_undo={control.folder}/undo.yml", "-e", '{"broken": ["robot1"]}')
    run = control.run(*wrong)
    assert (run.returncode, marks(control)) == (2, []), run.stdout
    assert "rolled-back: Find something wrong: the disk is full" in run.stdout
    assert "not begun: robot1 failed" in run.stdout


def test_without_a_way_back_what_was_done_stays_and_what_a_task_hides_stays_hidden(control: Control) -> None:
    """So many may fail that the next wave begins all the same."""
    hidden = "- name: Log in\n  ansible.builtin.fail: {msg: hush-hush}\n  no_log: true\n"
    control.write("tasks.yml", TASKS.format(folder=control.folder) + hidden)
    run = control.run(*given(control, "-e", "update_failure_budget=1"))
    assert (run.returncode, marks(control)) == (2, ["mark-robot1", "mark-robot2"]), run.stdout
    assert "what was done stays, as there is no guarded_undo" in run.stdout
    assert "Log in: hidden by no_log" in run.stdout
    assert "hush-hush" not in (control.folder / "report.json").read_text()
    ours = [line for line in run.stdout.splitlines() if "[ERROR]: Task failed" not in line]  # that one is Ansible's own
    assert "hush-hush" not in "".join(ours)


WAITS = "inventory_hostname == 'robot1' and looks | default(0) | int < 2"


def test_a_robot_at_rest_has_its_turn_before_one_that_works_is_looked_at_again(tmp_path: Path) -> None:
    """Its goals are held meanwhile. The role's own tasks run here, with an answer in the place of the look."""
    look, *rest = yaml.safe_load((CHECKOUT / "roles/guarded/tasks/main.yml").read_text("utf-8"))
    facts = {
        "looks": "{{ looks | default(0) | int + 1 }}",
        "update_result": f"{{{{ {{'waiting': true}} if {WAITS} else {{'turn': 'make'}} }}}}",
    }
    role = tmp_path / "roles/guarded/tasks"
    role.mkdir(parents=True)
    (role / "main.yml").write_text(yaml.safe_dump([{"name": look["name"], "ansible.builtin.set_fact": facts}, *rest]))
    (role / "turn.yml").write_text(
        "- {name: Do it, ansible.builtin.debug: {msg: 'turn of {{ inventory_hostname }}'}}\n"
        "- ansible.builtin.set_fact: {update_result: {}}\n"
    )
    variables = {"guarded_tasks": "tasks.yml", "guarded_undo": ""}
    roles = [{"hosts": "all", "gather_facts": False, "vars": variables, "roles": ["guarded"]}]
    (tmp_path / "play.yml").write_text(yaml.safe_dump(roles))
    run = ended(started(tmp_path, "robot1,robot2,", "play.yml", "-c", "local"))
    assert re.findall(r"turn of (\w+)", run.stdout) == ["robot2", "robot1"], run.stdout
