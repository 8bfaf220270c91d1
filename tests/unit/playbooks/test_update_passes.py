# SPDX-License-Identifier: GPL-3.0-or-later
"""The role update as a run has it: robots that work do not keep the forks from those that rest.

ansible-playbook and the role are the real ones; what the action does to a robot is played.
"""

from __future__ import annotations

import os
from pathlib import Path

from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import CHECKOUT, ended, started

# so deep are its tasks nested in each other; a robot that works for ten minutes is looked at as often as all of it
LOOKS = 60 if os.environ.get("ROSOPS_TEST_ALL") else 6
PLAY = """
- hosts: robots
  gather_facts: false
  tags: [apps]
  roles:
    - role: rosops.fleet.update
      vars: {update_apps: [talker]}
  tasks:
    - name: Be unreachable never
      ansible.builtin.debug:
        msg: "{{ inventory_hostname }} is {{ update_result.outcome.outcome }}"
"""
INVENTORY = f"""
[robots]
robot1 looks={LOOKS}
robot2 looks=3
robot3 looks=0
[robots:vars]
ansible_connection=local
ansible_become=false
"""
# busy for so many looks, and every look is written down
ACTION = """
from ansible.plugins.action import ActionBase
class ActionModule(ActionBase):
    def run(self, tmp=None, task_vars=None):
        assert task_vars["update_apps"] == ["talker"]
        host, path = task_vars["inventory_hostname"], task_vars["playbook_dir"] + "/looks"
        with open(path, "a+") as file:
            file.seek(0)
            waits = file.read().split().count(host) < int(task_vars["looks"])
            file.write(host + "\\n")
        return {"waiting": True} if waits else {"outcome": {"outcome": "updated"}}
"""


def collection(folder: Path) -> None:
    """Ours, but for the action."""
    root = folder / "ansible_collections/rosops/fleet"
    (root / "plugins/action").mkdir(parents=True)
    for name in ("roles", "meta", "galaxy.yml", "plugins/filter", "plugins/plugin_utils", "plugins/module_utils"):
        (root / name).symlink_to(CHECKOUT / name)
    (root / "plugins/action/_robot_update.py").write_text(ACTION)


def test_more_robots_work_than_there_are_forks(tmp_path: Path) -> None:
    collection(tmp_path)
    (tmp_path / "play.yml").write_text(PLAY)
    (tmp_path / "ansible.cfg").write_text("[defaults]\n")
    (tmp_path / "hosts").write_text(INVENTORY)
    environ = {"ANSIBLE_COLLECTIONS_PATH": str(tmp_path), "ANSIBLE_CONFIG": str(tmp_path / "ansible.cfg")}
    done = ended(started(tmp_path, "hosts", "play.yml", "--forks", "2", "--tags", "apps", **environ))
    assert done.returncode == 0
    assert done.stdout.count(" is updated") == 3
    looks = (tmp_path / "looks").read_text().split()
    assert looks.index("robot3") <= 2, looks  # it had its turn while the others worked
    assert [looks.count(name) for name in ("robot1", "robot2", "robot3")] == [LOOKS + 1, 4, 1]
