# SPDX-License-Identifier: GPL-3.0-or-later
"""One host's failure stays its own in the plays of k3s: they run here, with a role that fails where told to."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import CHECKOUT, ended, started
from ansible_collections.rosops.fleet.tests.unit.robots import fleet

SERVERS, ROBOTS = ["edge1", "edge2", "edge3"], ["robot1", "robot2", "robot3", "robot4"]
LOOK = """
- ansible.builtin.set_fact:
    __k3s:
      any: "{{ way != 'as it should be' }}"
      guarded: "{{ at_work }}"
      wait: false
      undone: "{{ way != 'as it should be' and (done | default('no')) == 'no' }}"
- ansible.builtin.fail:
    msg: refused
  when: way == 'refused'
"""
WORK = """
- ansible.builtin.shell: echo {{ inventory_hostname }} >>{{ journal }}
- ansible.builtin.fail:
    msg: it broke
  when: way == 'broken'
- ansible.builtin.set_fact:
    ansible_connection: ssh
  when: way == 'away'
- ansible.builtin.set_fact:
    __k3s_change: {outcome: {outcome: unchanged}}
  when: way == 'over budget'
- ansible.builtin.set_fact:
    ansible_connection: ssh
  when: way == 'away for a moment'
- ansible.builtin.command: "true"
  register: worked
- ansible.builtin.set_fact:
    ansible_connection: "{{ 'local' if way == 'away for a moment' else ansible_connection }}"
    done: "{{ 'no' if worked is unreachable or way == 'over budget' else 'yes' }}"
"""
LAST = {
    "name": "What goes on",
    "hosts": "all",
    "gather_facts": False,
    "tasks": [{"ansible.builtin.shell": "echo {{ inventory_hostname }} >>{{ survivors }}"}],
}


@pytest.fixture
def collection(tmp_path: Path) -> Path:
    ours = tmp_path / "collections/ansible_collections/rosops/fleet"
    role = ours / "roles/k3s/tasks"
    role.mkdir(parents=True)
    (ours / "plugins").symlink_to(CHECKOUT / "plugins")  # names of modules have to be known
    (role / "look.yml").write_text(LOOK)
    (role / "main.yml").write_text(WORK)
    shutil.copy(CHECKOUT / "roles/k3s/tasks/isolated.yml", role)
    plays = yaml.safe_load((CHECKOUT / "playbooks/k3s_waves.yml").read_text("utf-8"))
    waves = yaml.safe_load((CHECKOUT / "playbooks/vars/fleet.yml").read_text("utf-8"))["fleet_waves"]
    for play in plays:
        variables = {"fleet_self": FLEET_SELF, "fleet": FLEET, "fleet_waves": waves}
        play.update(become=False, vars_files=[], vars=variables)
    (tmp_path / "ansible.cfg").write_text("")
    (tmp_path / "site.yml").write_text(yaml.safe_dump([*plays, LAST]))
    return tmp_path


GROUPS = {"edge": SERVERS, "robots": ROBOTS}
FLEET = fleet(GROUPS, {name: {} for names in GROUPS.values() for name in names}).as_dict()
FLEET_SELF = {
    "role": "{{ 'server' if inventory_hostname in groups['edge'] else 'agent' }}",
    "cluster": "edge",
    "servers": SERVERS,
}


def run(
    base: Path, ways: dict[str, str], *robots: str, at_work: bool = True, **more: str
) -> tuple[int, list[str], set[str]]:
    """Exit status, hosts in the order in which their k3s was worked on, hosts that go on."""
    hosts: dict[str, Any] = {
        name: {"way": ways.get(name, "well"), **({"ansible_ssh_port": 1} if "away" in ways.get(name, "") else {})}
        for name in [*SERVERS, *ROBOTS]
    }
    common = {
        "ansible_connection": "local", "ansible_python_interpreter": sys.executable, "at_work": at_work,
        "journal": str(base / "journal"), "survivors": str(base / "survivors"),
        "ansible_host": "127.0.0.1", **more,
    }  # fmt: skip
    children = {group: {"hosts": {name: hosts[name] for name in names}} for group, names in GROUPS.items()}
    (base / "hosts.yml").write_text(yaml.safe_dump({"all": {"vars": common, "children": children}}))
    environ = {
        "ANSIBLE_COLLECTIONS_PATH": str(base / "collections"), "ANSIBLE_CONFIG": str(base / "ansible.cfg"),
        "ANSIBLE_FORKS": "6", "ANSIBLE_TIMEOUT": "3",
    }  # fmt: skip
    done = ended(started(base, "hosts.yml", "site.yml", "--limit", ",".join([*SERVERS, *robots]), **environ))

    def lines(name: str) -> list[str]:
        path = base / name
        return path.read_text().split() if path.exists() else []

    return done.returncode, lines("journal"), set(lines("survivors"))


def test_servers_come_first_one_after_the_other(collection: Path) -> None:
    ways = {"robot3": "as it should be"}
    status, order, survivors = run(collection, ways, "robot1", "robot2", "robot3", at_work=False)
    assert status == 0
    assert order[:3] == SERVERS
    assert set(order[3:]) == {"robot1", "robot2"}
    assert survivors == {*SERVERS, "robot1", "robot2", "robot3"}


def test_of_another_token_all_servers_have_their_turn_and_nobody_else(collection: Path) -> None:
    """The others see only at theirs that the first one has it made. Agents have nothing to do with it."""
    later = dict.fromkeys(SERVERS[1:], "as it should be")
    status, order, survivors = run(collection, later, "robot1", __k3s_rotate="token")
    assert (status, order, survivors) == (0, SERVERS, {*SERVERS, "robot1"})


def test_a_host_that_is_lost_is_lost_alone(collection: Path) -> None:
    """All hosts of four waves, each in another way. Whose work was cut off does not go on, though it is back."""
    lost = {"edge1": "broken", "edge2": "away for a moment", "robot1": "refused", "robot2": "broken"}
    status, order, survivors = run(collection, {**lost, "robot3": "over budget", "robot4": "away"}, *ROBOTS)
    assert status in (2, 4)
    assert survivors == {"edge3", "robot3"}
    assert order[:4] == [*SERVERS, "robot2"]
    assert set(order[4:]) == {"robot3", "robot4"}
