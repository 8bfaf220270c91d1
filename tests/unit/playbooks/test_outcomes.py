# SPDX-License-Identifier: GPL-3.0-or-later
"""What a playbook says of hosts is what became of them in this run, to every reader, and is each host's alone."""

from __future__ import annotations

import json
import os
import re
import signal
import threading
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import CHECKOUT, Control
from ansible_collections.rosops.fleet.tests.unit.playbooks.robot_runs import APP, WAVE, Run, path_of, runs
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server

ASKS = """#!/bin/sh
while [ "$1" != -p ]; do shift; done
printf %s "$2" >&2
read -r password
echo "Sorry, try again." >&2
exit 1
"""


def artifacts(run: Run) -> dict[str, str]:
    """The outcomes that AWX would get, by host."""
    said = run.output.partition("CUSTOM STATS")[2]
    return dict(re.findall(r"(\w+):\s+outcome: (\S+)", said))


def earlier_run(folder: Path, *hosts: str) -> dict[str, str]:
    """A fact cache that holds what became of hosts in another run, and facts that are no variables."""
    (folder / "facts").mkdir()
    facts = {
        "fleet_outcome": {"outcome": "rolled-back", "reason": "long ago", "steps": []},
        "fleet_at_work": True,
        "fleet_waiting": True,
    }
    for host in hosts:
        (folder / "facts" / f"s1_{host}").write_text(json.dumps(facts))
        (folder / "facts" / host).write_text(json.dumps(facts))
    return {
        "ANSIBLE_CACHE_PLUGIN": "ansible.builtin.jsonfile",
        "ANSIBLE_CACHE_PLUGIN_CONNECTION": str(folder / "facts"),
        "ANSIBLE_SHOW_CUSTOM_STATS": "1",
    }


def test_facts_neither_hide_nor_invent_outcomes(server: Server, control: Control, tmp_path: Path) -> None:
    """Where they are variables, and where they are not."""
    server.put("/api/v1/namespaces/kube-system", {"metadata": {"name": "kube-system"}})
    runs(server, "robot2")
    runs(server, "robot4", "x.example/talker:1")
    hosts = ("edge2", "robot2", "robot3", "robot4")
    environ = {**earlier_run(tmp_path, *hosts), "ANSIBLE_INJECT_FACT_VARS": "True"}
    run = Run(control, ",".join(hosts), "--tags", "apps", environ=environ)
    assert run.plays.count(WAVE) == 1
    words = {name: run.outcome(name)[0] for name in hosts}
    assert [*words.values()] == ["unchanged", "failed", "deferred-offline", "unchanged"]
    assert artifacts(run) == words
    assert "long ago" not in run.output
    assert run.status == 4
    again = Run(control, "edge2,robot4", "--tags", "apps", environ={**environ, "ANSIBLE_INJECT_FACT_VARS": "False"})
    assert (again.status, again.output.count("take the robot's steps")) == (0, 1)  # no wave


def test_a_host_that_is_off_or_on_which_ansible_cannot_work_ends_no_waves(server: Server, control: Control) -> None:
    """Each is the only one of its wave; sudo does not take the password of the first."""
    for name in ("robot2", "robot5"):
        runs(server, name)
    control.write("sudo-asks", ASKS, 0o755)
    inventory = yaml.safe_load((control.folder / "hosts.yml").read_text())
    asked = {"ansible_become_exe": str(control.folder / "sudo-asks"), "ansible_become_password": "wrong"}
    inventory["all"]["children"]["robots"]["hosts"]["robot2"].update(asked)
    control.write("hosts.yml", yaml.safe_dump(inventory))
    run = Run(control, "robot2,robot3,robot5", playbook="update", update_waves=[1])
    assert run.outcome("robot2")[0] == "failed"
    assert "Incorrect sudo password" in run.outcome("robot2")[1]
    assert run.outcome("robot3")[0] == "deferred-offline"
    assert "the ROS master does not answer" in run.outcome("robot5")[1]
    assert "What became of every host" in run.plays


def test_where_nobody_is_left_the_artifact_says_why(control: Control) -> None:
    run = Run(control, "robot3,edge1", "--tags", "preflight,k3s", environ={"ANSIBLE_SHOW_CUSTOM_STATS": "1"})
    assert artifacts(run) == dict.fromkeys(("robot3", "edge1"), "deferred-offline")
    assert {run.outcome(name)[0] for name in ("robot3", "edge1")} == {"deferred-offline"}
    assert "No route to host" in run.outcome("robot3")[1]
    assert run.status == 4
    assert control.asked.count("192.0.2.13") == 1


@pytest.mark.parametrize(
    ("ending", "of", "ends"),
    [
        (signal.SIGKILL, "run", (-signal.SIGKILL, "")),
        (signal.SIGINT, "run", (99, "[ERROR]: User interrupted execution")),
        (signal.SIGINT, "worker", (1, "[ERROR]: A worker was found in a dead state")),
    ],
)
def test_what_is_known_is_kept_before_the_end_and_a_cancelled_run_lets_its_robots_go(
    server: Server, control: Control, ending: signal.Signals, of: str, ends: tuple[int, str]
) -> None:
    """While its worker waits for minutes: by SIGKILL of ansible-playbook alone, as tools do it, and as people do it."""
    server.put("/api/v1/namespaces/kube-system", {"metadata": {"name": "kube-system"}})
    control.write("play.yml", f"- import_playbook: {CHECKOUT}/playbooks/site.yml\n")
    given = {"ros_apps": [APP], "ros_app_rollout_timeout": 300}
    process = control.start("--limit", "robot1,robot3", "--tags", "namespace,master,apps", "-e", json.dumps(given))
    until(lambda: bool(server.find(path_of("Deployment", "robot-robot1", "talker"))))
    lease = "/apis/coordination.k8s.io/v1/namespaces/robot-robot1/leases/robot-update"
    assert server.find(lease)["spec"]["holderIdentity"]
    os.kill(process.pid if of == "run" else worker_of(process.pid), ending)
    out, err = process.communicate(timeout=120)
    assert (process.returncode, err.strip()) == ends
    assert "FLEET REPORT" not in out
    until(lambda: server.find(lease)["spec"]["holderIdentity"] == "")
    outcomes = "/api/v1/namespaces/kube-system/configmaps/rosops-outcomes"
    until(lambda: set(server.find(outcomes)["data"]) == {"robot1", "robot3"})
    kept = {host: json.loads(text) for host, text in server.find(outcomes)["data"].items()}
    assert {host: one["outcome"] for host, one in kept.items()} == {"robot1": "failed", "robot3": "deferred-offline"}
    assert "the run was cancelled" in kept["robot1"]["reason"]
    assert kept["robot3"]["playbook"] == "play.yml"


def worker_of(run: int) -> int:
    """The one that is with the robot. That of the robot that is off has ended, and may not have been waited for."""

    def living() -> list[int]:
        children = Path(f"/proc/{run}/task/{run}/children").read_text().split()
        return [int(child) for child in children if works(Path(f"/proc/{child}/status"))]

    until(lambda: len(living()) == 1)
    return living()[0]


def works(status: Path) -> bool:
    try:
        return "(zombie)" not in status.read_text()
    except (FileNotFoundError, ProcessLookupError):  # it was listed, and has ended meanwhile
        return False


def until(condition: Callable[[], bool]) -> None:
    for _look in range(1200):
        if condition():
            return
        threading.Event().wait(0.1)
    pytest.fail("it did not come to that within two minutes")
