# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults in the middle of a change that no run makes: who says when pods are Ready is away, or begins anew."""

from __future__ import annotations

import time

import pytest
from cluster import KEEPER, MASTER
from fleet import Fleet
from runs import wait_until
from test_9_other_doors import (
    PUBLISHER,
    SECONDS,
    SUBSCRIBER,
    assert_alone,
    assert_own_nodes,
    deployments,
    kubectl,
    replaced,
)

APPS = [PUBLISHER, SUBSCRIBER]
KILL = "delete pod --force --grace-period=0 -l rosops.fleet/app="


def break_it(fleet: Fleet, what: str) -> None:
    if what == "keeper":
        kubectl(fleet, KILL + KEEPER)
    elif what == "kubelet":
        fleet.hosts.ssh("robot1", "systemctl restart k3s-agent")
    elif what == "API server":
        fleet.hosts.ssh("edge1", "systemctl restart k3s")
    else:
        kubectl(fleet, KILL + MASTER)


@pytest.mark.parametrize("what", ["keeper", "kubelet", "API server", "master"])
def test_what_begins_anew_in_the_middle_of_a_change(fleet: Fleet, what: str) -> None:
    """The old pods work on until the new ones have been looked at."""
    before, watch, began = fleet.pods()["robot1"], fleet.watch(), time.monotonic()
    kubectl(fleet, f"rollout restart {deployments(APPS)}")
    break_it(fleet, what)
    replaced(fleet, APPS, before)
    took = time.monotonic() - began
    fleet.wait_settled()
    assert_alone(fleet, APPS)
    if what == "master":
        watch.assert_only_lookups_failed("robot1")
    else:
        watch.assert_nothing_lost("robot1")
    fleet.figures.append(f"{what} killed or restarted: the new pods were Ready after {took:.0f} s")


def test_a_reboot_takes_the_proof_back(fleet: Fleet) -> None:
    """Kubernetes keeps a pod's conditions over a boot of its host: what was proven was another container."""
    (before,) = fleet.pods()["robot1"][PUBLISHER]
    assert before.containers[0] in before.gate
    fleet.hosts.power("robot1", "reboot")

    def containers() -> tuple[str, ...]:
        return fleet.pods()["robot1"][PUBLISHER][0].containers

    wait_until(containers, lambda now: now != before.containers, SECONDS, "another container")
    fleet.wait_settled(SECONDS)
    (pod,) = fleet.pods()["robot1"][PUBLISHER]
    assert pod.uid == before.uid
    assert pod.containers[0] in pod.gate, pod
    fleet.wait_for_goal("robot1", time.time())
    assert_own_nodes(fleet, [PUBLISHER])
