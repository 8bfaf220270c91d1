# SPDX-License-Identifier: GPL-3.0-or-later
"""What comes in between: a busy robot, one that is off, a ROS master that restarts, a control node that dies."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import evidence
import pytest
from awx_job import Job
from cluster import KEEPER, MASTER
from fleet import ALL_AT_ONCE, LIMIT, Fleet, Variables
from runs import Run, Running, wait_until

# --- a busy robot ---------------------------------------------------------------------------------------------------


def step_end(run: Run, robot: str) -> float:
    """When the robot's last step ended."""
    last = run.steps(robot)[-1]
    return float(last["started"] + sum(last["phases"].values()))


def wait_for_new_goal(fleet: Fleet, robot: str) -> None:
    """Until the robot has begun to work on a goal that it had not when this was asked."""
    asked = time.time()

    def newest() -> float:
        logs = fleet.hosts.logs(robot)
        return max(
            (line["time"] for name, lines in logs.items() if name.startswith(evidence.SERVER)
             for line in lines if line["event"] == "goal started"), default=0.0)  # fmt: skip

    wait_until(newest, lambda started: started > asked, 120, f"a goal that {robot} begins")


@pytest.mark.promise("a busy robot finishes first, and holds up no other")
def test_busy_robot_is_waited_for(fleet: Fleet) -> None:
    """Its goals take 15 to 30 seconds. The other robot is updated in the same run and not held up."""
    normal = fleet.variables
    fleet.update(fleet.changed("robot1", "prime-factors", env={"FACTOR_PAUSE": 0.6}), *LIMIT).must(0)
    wanted = fleet.new_version("robot2", "temperature", on=fleet.new_version("robot1", "prime-factors", on=normal))
    watch = fleet.watch()
    wait_for_new_goal(fleet, "robot1")
    run = fleet.update(wanted, **ALL_AT_ONCE, update_on_busy="wait").must(0, robot1="updated", robot2="updated")
    assert run.steps("robot1")[-1]["busy_wait"] > 0, run
    assert step_end(run, "robot2") < step_end(run, "robot1"), f"robot2 was held up by robot1: {run}"
    watch.assert_nothing_lost()


@pytest.mark.promise("a robot may say no, by what its messages say")
def test_robot_that_says_no_is_left_alone_until_it_says_yes(fleet: Fleet) -> None:
    """The other robot, whose messages say what they have to, is updated in the same run."""

    def asked(robot: str, degrees: float, on: Variables) -> Variables:
        value = {"topic": "temperature", "field": "celsius", "above": degrees}
        return fleet.changed(robot, "add-two-ints", on, update={"when": [value]})

    before, watch = fleet.running(), fleet.watch()
    wanted = fleet.new_version("robots", "add-two-ints")
    cold = asked("robot2", -300.0, asked("robot1", 300.0, wanted))
    run = fleet.update(cold, **ALL_AT_ONCE, update_on_busy="defer").must(2, robot1="deferred-busy", robot2="updated")
    assert "/temperature celsius above 300.0: is " in run.host("robot1")["reason"], run
    fleet.assert_still_running(before, "robot1")

    quiet = fleet.changed("robot1", "add-two-ints", wanted, update={"when": [{"topic": "joy", "quiet": 3}]})
    run = fleet.update(quiet, **ALL_AT_ONCE, update_on_busy="defer").must(0, robot1="updated", robot2="updated")
    assert run.host("robot2")["reason"] == "ConfigMap robot-robot2/robot-rest", run  # it is asked nothing any more
    assert run.steps("robot1")[-1]["busy_wait"] >= 3, run
    watch.assert_nothing_lost()


def test_a_program_of_the_site_says_no_behind_a_url(fleet: Fleet) -> None:
    """Here it looks whether a file is there: HTTP's 404 says no, and 200 says yes."""
    port, before, watch = 8099, fleet.running(), fleet.watch()
    url = f"http://{fleet.hosts.address('edge1')}:{port}/may-update"
    serve = f"systemd-run --unit=says -p RuntimeMaxSec=600 python3 -m http.server {port} --directory /tmp/says"
    fleet.hosts.ssh("edge1", f"mkdir -p /tmp/says && {serve}")
    try:
        wanted = fleet.new_version("robot1", "add-two-ints")
        asked = fleet.changed("robot1", "add-two-ints", wanted, update={"when": [{"url": url}]})
        run = fleet.update(asked, *LIMIT, update_on_busy="defer").must(2, robot1="deferred-busy")
        assert url in run.host("robot1")["reason"], run
        assert "404" in run.host("robot1")["reason"], run
        fleet.assert_still_running(before, "robot1")
        fleet.hosts.ssh("edge1", "touch /tmp/says/may-update")
        fleet.update(asked, *LIMIT, update_on_busy="defer").must(0, robot1="updated")
    finally:
        fleet.hosts.ssh("edge1", "systemctl stop says; rm -r /tmp/says")
    fleet.update(wanted, *LIMIT).must(0)
    watch.assert_nothing_lost("robot1")


# --- a robot that is off --------------------------------------------------------------------------------------------


@pytest.mark.promise("a robot that is off is deferred, and updated by the next run")
def test_robot_that_is_off_is_picked_up_by_the_next_run(fleet: Fleet) -> None:
    wanted = fleet.new_version("robot2", "temperature", on=fleet.new_version("robot1", "temperature"))
    watch = fleet.watch()
    fleet.hosts.power("robot2", "down")
    try:
        run = fleet.update(wanted, **ALL_AT_ONCE).must(4, robot1="updated", robot2="deferred-offline")
        watch.assert_nothing_lost("robot1", goals=False)
    finally:
        fleet.hosts.power("robot2", "up")
        back = time.time()
    fleet.wait_settled(240)
    # the apps at the edge ran on meanwhile: their registrations with the robot's new master are back
    fleet.playbooks.run("site", fleet.variables, "--tags", "ready", "--limit", "robot2,edge1").must(0)
    fleet.wait_for_goal("robot2", back)
    before, watch = fleet.running(), fleet.watch()
    run = fleet.update(wanted, **ALL_AT_ONCE).must(0, robot1="unchanged", robot2="updated")
    assert [step["name"] for step in run.steps("robot2")] == ["temperature"], run
    fleet.assert_still_running(before, "robot1")
    watch.assert_nothing_lost()


# --- a ROS master that restarts -------------------------------------------------------------------------------------


def apps_only(pods: Mapping[str, Any]) -> dict[str, Any]:
    return {app: there for app, there in pods.items() if app != MASTER}


@contextmanager
def nothing_comes(fleet: Fleet, robot: str, sender: str, receiver: str) -> Iterator[None]:
    """From one pod of the robot's, which is on the robot, to another one."""
    pods = [pod for there in fleet.pods()[robot].values() for pod in there]
    source, to = (next(pod.address for pod in pods if pod.name.startswith(name)) for name in (sender, receiver))
    rule = f"PREROUTING -s {source} -d {to} -j DROP"
    fleet.hosts.ssh(robot, f"iptables -w -t raw -I {rule}")
    try:
        yield
    finally:
        fleet.hosts.ssh(robot, f"iptables -w -t raw -D {rule}")


@pytest.mark.promise("apps outlive their ROS master")
def test_apps_outlive_their_master(fleet: Fleet) -> None:
    """Also one that the keeper cannot ask for a while: its publisher's next version must not do without it."""
    before, watch = fleet.running()["robot1"], fleet.watch()
    with nothing_comes(fleet, "robot1", KEEPER, "temperature-stats"):
        fleet.cluster.delete_pod("robot1", MASTER)
        wait_until(
            lambda: fleet.running()["robot1"].get(MASTER),
            lambda pods: pods is not None and len(pods) == 1 and pods != before[MASTER],
            60,
            "a new pod of the master",
        )
        fleet.wait_settled()
        # the edge goes on asking where the old pod was, until its kube-proxy and 3 s of ARP are over
        fleet.wait_for_answer("robot1", time.time())
        assert apps_only(fleet.running()["robot1"]) == apps_only(before)
        fleet.update(fleet.new_version("robot1", "temperature"), *LIMIT).must(0, robot1="updated")
    watch.assert_only_lookups_failed("robot1")


def test_update_of_the_master_itself(fleet: Fleet) -> None:
    before, watch = fleet.running()["robot1"], fleet.watch()
    container = {"name": "ros-master-container", "env": [{"name": "EXAMPLE", "value": str(int(time.time()))}]}
    overrides = {"template": {"spec": {"containers": [container]}}}
    run = fleet.update(fleet.changed("robot1", MASTER, spec=overrides), *LIMIT).must(0, robot1="updated")
    assert [step["name"] for step in run.steps("robot1")] == [MASTER], run
    after = fleet.running()["robot1"]
    assert after[MASTER] != before[MASTER]
    assert apps_only(after) == apps_only(before)
    watch.assert_only_lookups_failed("robot1")
    fleet.watch().assert_nothing_lost("robot1")


def test_the_keeper_begins_anew_with_its_code_and_nothing_else_does(fleet: Fleet) -> None:
    before, watch, robot = fleet.running(), fleet.watch(), "robot1"
    fleet.cluster.bring_other_code(robot)
    wait_until(
        lambda: fleet.cluster.keeper_log(robot).partition("begins anew")[2],
        lambda since: " keeping " in since,
        180,  # the kubelet brings a changed ConfigMap within about a minute
        "a keeper that has begun anew",
    )
    fleet.assert_still_running(before)
    watch.assert_nothing_lost("robot1")
    # its goals are held by that keeper
    fleet.update(fleet.new_version("robot1", "prime-factors"), *LIMIT).must(0, robot1="updated")
    watch.assert_nothing_lost("robot1")
    fleet.update(fleet.variables, *LIMIT).must(0)


# --- a control node that dies ---------------------------------------------------------------------------------------


# What is changed, and what is seen when the control node dies: a line of `-v`, which names the phase that begins, or a
# word of IN_THE_CLUSTER, which is looked for there.
def begins(step: str, phase: str) -> str:
    """The line with which a phase of a step begins."""
    return rf"^\[robot1\] {step}: {phase}"


PHASES = {
    "record": ("temperature", r"^\[robot1\] record"),
    "gate": ("prime-factors", begins("prime-factors", "wait")),
    "apply-begun": ("temperature", begins("temperature", "apply")),
    "apply-midway": ("temperature", "history"),
    "rollout": ("temperature", "two pods"),
    "beside": ("prime-factors", "two pods"),
    "drain": ("prime-factors", begins("prime-factors", "rollout")),
    "verify": ("temperature", begins("temperature", "verify")),
    "proven": ("temperature", begins("temperature", "finish")),  # but its mark is still on
}
IN_THE_CLUSTER = ("history", "two pods")
MARKS = {"proven": [pytest.mark.faults]}  # of the other ones a cancelled job's is the promise: test_8_awx.py


def wait_for_sign(fleet: Fleet, update: Running | Job, app: str, sign: str, history: str) -> None:
    """Until the playbook has come so far."""
    there = fleet.cluster
    if sign not in IN_THE_CLUSTER:
        update.wait_for(sign)
    elif sign == "history":  # the first of the objects that are applied in one call
        wait_until(lambda: there.history("robot1", app), lambda seen: seen != history, 300, "a new history", pause=0.01)
    else:
        wait_until(lambda: there.pods("robot1")[app], lambda seen: len(seen) == 2, 300, "two pods", pause=0.01)


@pytest.mark.parametrize("phase", [pytest.param(one, marks=MARKS.get(one, [])) for one in PHASES])
def test_control_node_killed(fleet: Fleet, phase: str) -> None:
    app, sign = PHASES[phase]
    wanted = fleet.new_version("robot1", app)
    history = fleet.cluster.history("robot1", app)
    watch = fleet.watch()
    update = fleet.start_update(wanted, *LIMIT)
    wait_for_sign(fleet, update, app, sign, history)
    update.kill()
    watch.assert_nothing_lost("robot1")  # the robot works on by itself

    fleet.update(wanted, *LIMIT).must(0, robot1="updated")
    fleet.wait_settled()
    watch.assert_nothing_lost("robot1")
