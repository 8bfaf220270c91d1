# SPDX-License-Identifier: GPL-3.0-or-later
"""The fleet as AWX runs it: jobs from an empty home, hosts in any order, cancelled by SIGKILL, silent 20 s at most.

What a run in a shell shows is not shown again; nor is what needs no robot at work (tests/unit/playbooks/test_awx.py).
"""

from __future__ import annotations

import itertools
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from awx_job import IDLE, Ended, Job, Template
from fleet import ALL_AT_ONCE, Fleet
from kubernetes import client, config
from runs import CHECKOUT
from test_3_interrupted import PHASES, wait_for_sign

ROBOT1 = "robot1,edge1"


class Controller:
    """Launches jobs at the verbosity that a template has, 0; whatever still runs in the end is killed.

    With 1 a job says each of its phases, for whoever waits for one.
    """

    def __init__(self, fleet: Fleet, folder: Path) -> None:
        self._fleet, self._folder = fleet, folder
        self._numbers, self._jobs = itertools.count(1), list[Job]()
        program = str(Path(sys.executable).parent / "ansible-inventory")
        environ = {**os.environ, "ANSIBLE_CONFIG": str(CHECKOUT / "ansible.cfg")}
        told = subprocess.run(  # noqa: S603
            [program, "-i", str(fleet.playbooks.inventory), "--list", "--export"],
            env=environ, cwd=CHECKOUT, capture_output=True, check=True,
        )  # fmt: skip
        self.inventory = json.loads(told.stdout)

    def launch(
        self, playbook: str, own: Mapping[str, Any], answers: Mapping[str, Any] | None = None, **more: Any
    ) -> Job:
        template = Template(playbook, self.inventory, answers or {}, own, **more)
        self._jobs.append(Job(self._folder / f"job{next(self._numbers)}", template))
        return self._jobs[-1]

    def run(
        self, playbook: str, own: Mapping[str, Any], answers: Mapping[str, Any] | None = None, **more: Any
    ) -> Ended:
        """To its end, which came without a silence for which AWX would have ended it."""
        ended = self.launch(playbook, own, answers, **more).finish()
        print(ended.output)
        assert ended.status != "timeout"
        assert ended.silence < IDLE
        return ended

    def close(self) -> None:
        for job in self._jobs:
            ended = job.ended or job.cancel()
            self._fleet.figures.append(f"longest silence of {job.template.playbook}: {ended.silence:.1f} s")


@pytest.fixture
def awx(fleet: Fleet, tmp_path: Path) -> Iterator[Controller]:
    made = Controller(fleet, tmp_path)
    yield made
    made.close()


@pytest.mark.promise("what was killed, as AWX cancels a job, is ended by the next run, from another empty home")
def test_a_cancelled_job_and_the_next_one(fleet: Fleet, awx: Controller) -> None:
    app, sign = PHASES["rollout"]
    wanted, history = fleet.new_version("robot1", app), fleet.cluster.history("robot1", app)
    watch = fleet.watch()
    job = awx.launch("update", wanted, {"update_waves": "1, 100%"}, limit=ROBOT1, verbosity=1)
    wait_for_sign(fleet, job, app, sign, history)
    assert job.cancel().artifacts == {}
    began = time.monotonic()
    ended = awx.run(
        "update", wanted, {"update_waves": "1, 100%", "update_apps": "", "update_busy_timeout": "300"}, limit=ROBOT1
    )
    fleet.figures.append(f"the next job took {time.monotonic() - began:.0f} s")
    assert (ended.status, ended.outcomes) == ("successful", {"edge1": "unchanged", "robot1": "updated"})
    fleet.wait_settled()
    fleet.accept(wanted)
    watch.assert_nothing_lost("robot1")


def test_site_rollback_and_two_jobs_at_once(fleet: Fleet, awx: Controller) -> None:
    """Hosts come in another order in each job, and no host is changed for that."""
    for _job in range(2):
        site = awx.run("site", fleet.variables)
        assert set(site.outcomes.values()) == {"unchanged"}
    watch = fleet.watch()
    wanted = fleet.new_version("robot2", "temperature", on=fleet.new_version("robot1", "temperature"))
    jobs = [awx.launch("update", {**wanted, **ALL_AT_ONCE}) for _job in range(2)]
    found = [job.finish() for job in jobs]
    words = [{ended.outcomes[robot] for ended in found} for robot in ("robot1", "robot2")]
    assert all("updated" in those and those <= {"updated", "unchanged", "deferred-busy"} for those in words), words
    fleet.wait_settled()
    fleet.accept(wanted)
    back = awx.run("rollback", fleet.variables, {"update_apps": "temperature", "update_to": ""}, limit=ROBOT1)
    assert back.outcomes["robot1"] == "updated"
    watch.assert_nothing_lost()


def test_the_account_for_awx_is_enough(fleet: Fleet, awx: Controller, tmp_path: Path) -> None:
    """What awx_access makes, as AWX's credential hands it on: for an update, a rollback and a look, on a real API."""
    made = awx.run("awx_access", {**fleet.variables, "awx_access_dir": str(tmp_path)})
    assert made.status == "successful"
    access = tmp_path / "edge.yaml"
    assert access.stat().st_mode & 0o777 == 0o600
    token = next(line for line in access.read_text().splitlines() if "token:" in line).split()[1]
    assert token not in made.output
    again = awx.run("awx_access", {**fleet.variables, "awx_access_dir": str(tmp_path)})
    assert set(again.outcomes.values()) <= {"unchanged"}
    assert token in access.read_text()
    core = client.CoreV1Api(config.new_client_from_config(str(access)))
    assert core.list_namespaced_secret("robot-robot1") is not None
    for space in ("kube-system", "default"):
        with pytest.raises(client.ApiException, match="403"):
            core.list_namespaced_secret(space)
    with pytest.raises(client.ApiException, match="403"):
        core.patch_namespaced_config_map("rosops-fleet", "kube-system", {"data": {}})
    credential = {"K8S_AUTH_KUBECONFIG": str(access)}
    wanted = fleet.new_version("robot1", "temperature")
    ended = awx.run("update", wanted, limit=ROBOT1, credential=credential)
    assert ended.outcomes == {"edge1": "unchanged", "robot1": "updated"}
    fleet.accept(wanted)
    back = awx.run("rollback", fleet.variables, {"update_apps": "temperature"}, limit=ROBOT1, credential=credential)
    assert back.outcomes["robot1"] == "updated"
    status = awx.run("status", fleet.variables, credential=credential)
    assert status.status == "successful"
    assert "ROS nodes" in status.output
